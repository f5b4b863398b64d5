// SPDX-License-Identifier: GPL-3.0-or-later
#include "cli/fit_report.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "image/preview.h"
#include "report/packing.h"

namespace interglow::cli {
namespace {

using fitting::ParameterEstimate;
using report::Json;

constexpr const char* kNotDetermined = "not determined";

Json number(double value) { return std::isfinite(value) ? Json(value) : Json("∞"); }

std::string vector_text(const Eigen::Vector3d& v) {
  return fmt::format("({:.5f}, {:.5f}, {:.5f})", v.x(), v.y(), v.z());
}

/// Value and standard deviation in the unit that people read: angles in degrees.
Json estimate_row(const ParameterEstimate& one) {
  const bool angle = one.unit == "rad";
  const double factor = angle ? 180.0 / std::numbers::pi : 1.0;
  const std::string unit = angle ? "°" : one.unit;
  // Tilts and turns are steps about the fitted state: only their deviation means something.
  const bool step = one.parameter <= fitting::kTurnZ;
  Json row = Json::array();
  row.push_back(one.name);
  row.push_back(step ? Json("see below") : Json(fmt::format("{:.6g}", one.value)));
  row.push_back(unit);
  if (!one.determined) {
    row.insert(row.end(), {kNotDetermined, kNotDetermined, kNotDetermined, kNotDetermined, "–"});
    return row;
  }
  row.push_back(fmt::format("{:.2g}", factor * one.sd));
  row.push_back(step ? Json("–")
                     : Json(fmt::format("{:.6g} to {:.6g}", one.value - 1.96 * one.sd, one.value + 1.96 * one.sd)));
  row.push_back(fmt::format("{:.2g}", factor * one.model_sd));
  row.push_back(fmt::format("{:+.2g} ± {:.1g}", factor * one.mesh_shift, factor * one.mesh_sd));
  row.push_back(fmt::format("{:+.1f}", one.half_difference_sigmas));
  return row;
}

Json estimates_section(const fitting::Uncertainty& uncertainty) {
  Json rows = Json::array();
  for (const ParameterEstimate& one : uncertainty.parameters) rows.push_back(estimate_row(one));
  return {
      {"type", "table"},
      {"title", "Estimates"},
      {"text",
       "Standard deviations in sandwich form: from the scatter of small squares of the picture, so that they hold for "
       "residuals that are correlated or larger than the noise. Beside them what noise alone would give, by "
       "how much the width of the patches moved the fit (from patches twice and four times as wide; taken off the "
       "value, what is uncertain of it is in the standard deviation), and the difference of the fits to the two halves "
       "of a chequered picture, in its own standard deviation. They do not hold for what the model lacks: see the "
       "causes below."},
      {"columns",
       {"Parameter", "Value", "Unit", "Standard deviation", "95 % interval", "By noise alone", "By patches",
        "Halves differ [σ]"}},
      {"rows", rows},
      {"show", 30}};
}

Json weak_section(const fitting::Uncertainty& uncertainty) {
  Json items = Json::array();
  for (const fitting::WeakDirection& weak : uncertainty.weak) {
    items.push_back(std::isfinite(weak.sd_share) ? fmt::format("{} (standard deviation {:.2g} of the plausible range).",
                                                               weak.sentence, weak.sd_share)
                                                 : weak.sentence + " (the capture says nothing at all).");
  }
  for (const std::string& note : uncertainty.notes) items.push_back(note);
  if (uncertainty.twin_light) {
    items.push_back(fmt::format("The mirrored light {} fits as well (χ² rises by {:.2g}): both are listed.",
                                vector_text(*uncertainty.twin_light), uncertainty.twin_rise));
  }
  Json paragraphs = Json::array();
  paragraphs.push_back(items.empty() ? "Every free parameter is determined by the capture."
                                     : "Values along these directions are what the fit began with, or chance:");
  return {
      {"type", "text"}, {"title", "What the capture does not determine"}, {"paragraphs", paragraphs}, {"items", items}};
}

Json state_section(const fitting::FitState& start, const fitting::FitState& end, const fitting::SceneFit& fit) {
  const auto angle = [](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    return std::atan2(a.cross(b).norm(), a.dot(b)) * 180.0 / std::numbers::pi;
  };
  Json rows;
  rows["light travels along"] = fmt::format("{}, {:.3f}° from the start", vector_text(end.light_direction),
                                            angle(start.light_direction, end.light_direction));
  const Eigen::Vector3d eye = end.camera.position();
  rows["camera position [mm]"] = fmt::format("({:.3f}, {:.3f}, {:.3f}), {:.3f} from the start", eye.x(), eye.y(),
                                             eye.z(), (eye - start.camera.position()).norm());
  rows["camera looks along"] = vector_text(end.camera.rotation.row(2).transpose());
  rows["horizontal field of view [°]"] =
      fmt::format("{:.4f}, before {:.4f}", end.camera.horizontal_fov_deg(), start.camera.horizontal_fov_deg());
  rows["blur, standard deviation [px]"] =
      end.blur_px <= fitting::kLeastBlur ? "below 0.2: none seen" : fmt::format("{:.3f}", end.blur_px);
  rows["w/w'"] = fmt::format("{:.5f}", end.w);
  rows["residuals"] = fmt::format(
      "{} values, mean square {:.3f} of their variance{}, {:.2f} % count linearly", fit.residuals, fit.chi_square,
      fit.noise_known ? "" : " (noise not declared: 0.2 % of the peak assumed)", 100.0 * fit.robust_share);
  return {{"type", "facts"}, {"title", "Fitted state"}, {"rows", rows}};
}

Json stage_section(const fitting::SceneFit& fit) {
  Json rows = Json::array();
  for (const fitting::FitStage& stage : fit.stages)
    rows.push_back(
        {stage.name, stage.width, stage.iterations, number(stage.cost_before), number(stage.cost), stage.end});
  return {{"type", "table"},
          {"title", "Stages"},
          {"columns", {"Stage", "Width [px]", "Iterations", "Cost before", "Cost after", "Ended because"}},
          {"rows", rows}};
}

Json band_section(const fitting::SceneFit& fit) {
  Json wavelength = Json::array(), gain = Json::array();
  for (Eigen::Index b = 0; b < fit.state.gain.size(); ++b) {
    wavelength.push_back(fit.data.image.wavelength_nm[b]);
    gain.push_back(fit.state.gain[b]);
  }
  return {
      {"type", "chart"},
      {"title", "Gain of the bands"},
      {"x", {{"label", "Wavelength [nm]"}, {"scale", "linear"}}},
      {"y", {{"label", "Unit of the capture per W m⁻² sr⁻¹ nm⁻¹"}, {"scale", "linear"}}},
      {"series", Json::array({{{"name", "gain"}, {"x", wavelength}, {"y", gain}, {"points", true}, {"line", true}}})}};
}

Json band_table(const fitting::SceneFit& fit) {
  Json rows = Json::array();
  for (Eigen::Index b = 0; b < fit.state.gain.size(); ++b)
    rows.push_back({fit.data.image.wavelength_nm[b], fit.state.gain[b], fit.state.offset[b]});
  return {{"type", "table"},
          {"title", "Gains and offsets"},
          {"columns", {"Wavelength [nm]", "Gain", "Offset"}},
          {"rows", rows}};
}

Json correlation_section(const fitting::Uncertainty& uncertainty) {
  Json columns = Json::array({""});
  for (std::size_t k = 0; k < uncertainty.parameters.size(); ++k) columns.push_back(fmt::format("{}", k + 1));
  Json rows = Json::array();
  for (std::size_t i = 0; i < uncertainty.parameters.size(); ++i) {
    Json row = Json::array({fmt::format("{} {}", i + 1, uncertainty.parameters[i].name)});
    for (std::size_t j = 0; j < uncertainty.parameters.size(); ++j) {
      const bool known = uncertainty.parameters[i].determined && uncertainty.parameters[j].determined;
      row.push_back(known ? Json(fmt::format("{:+.2f}", uncertainty.correlation(static_cast<Eigen::Index>(i),
                                                                                static_cast<Eigen::Index>(j))))
                          : Json("–"));
    }
    rows.push_back(row);
  }
  return {{"type", "table"}, {"title", "Correlations"}, {"columns", columns}, {"rows", rows}, {"show", 30}};
}

Json profile_section(const fitting::WProfile& profile) {
  return {
      {"type", "chart"},
      {"title", "Profile of w/w'"},
      {"text", fmt::format("Rise of χ² when w/w' is held and the rest refitted to first order; 95 % interval {:.5g} to "
                           "{:.5g} (rise of 3.84).",
                           profile.low, profile.high)},
      {"x", {{"label", "w/w'"}, {"scale", "linear"}}},
      {"y", {{"label", "Rise of χ²"}, {"scale", "linear"}}},
      {"series",
       Json::array({{{"name", "profile"}, {"x", profile.w}, {"y", profile.rise}, {"points", true}, {"line", true}}})}};
}

Json attribution_section(const fitting::Attribution& attribution) {
  Json rows = Json::array();
  for (const fitting::Cause& cause : attribution.causes) {
    rows.push_back({cause.name, cause.size, fmt::format("{:+.4f}", cause.shift), fmt::format("{:.0f}", cause.angle_deg),
                    cause.absorbed ? Json("absorbed by free parameters")
                                   : Json(fmt::format("{:+.2f} ± {:.2f}", cause.amplitude, cause.amplitude_sd)),
                    cause.absorbed ? Json("–") : Json(fmt::format("{:.4f}", cause.w_with)),
                    cause.supported ? "yes" : "no"});
  }
  return {
      {"type", "table"},
      {"title", "What w/w' may stand for"},
      {"text", attribution.sentence +
                   " To first order: how far each cause shifts w/w' at a plausible size, how unlike w/w' its change of "
                   "the picture is (90° can be told apart, 0° cannot), and how much of it the residuals hold."},
      {"columns",
       {"Cause", "Size tried", "Shift of w/w'", "Angle [°]", "Amount in the residuals [sizes]", "w/w' with it",
        "Supported"}},
      {"rows", rows},
      {"show", 30}};
}

Json viewer_section(const fitting::SceneFit& fit, const image::SpectralImage& fitted) {
  const image::SpectralImage& captured = fit.data.image;
  const double exposure = image::automatic_exposure(captured);
  const auto rgb = [&](const std::string& name, const image::SpectralImage& image) -> Json {
    const image::RgbImage preview = image::make_preview(image, {.exposure = exposure});
    return {{"name", name},
            {"kind", "rgb"},
            {"unit", "(linear sRGB)"},
            {"values", report::pack_half(preview.value, {image.height, image.width, 3})}};
  };
  const auto bands = static_cast<std::size_t>(captured.bands());
  std::vector<float> sigma(fit.data.use.size(), std::numeric_limits<float>::quiet_NaN());
  std::vector<float> relative = sigma;
  double largest = 0.0;
  for (const float v : captured.value) largest = std::max(largest, static_cast<double>(v));
  for (std::size_t p = 0; p < sigma.size(); ++p) {
    if (fit.data.use[p] == 0) continue;
    double z = 0.0, difference = 0.0;
    for (std::size_t b = 0; b < bands; ++b) {
      const std::size_t at = p * bands + b;
      const double d = static_cast<double>(captured.value[at]) - static_cast<double>(fitted.value[at]);
      z += d / static_cast<double>(fit.data.sigma[at]);
      difference += d;
    }
    sigma[p] = static_cast<float>(z / std::sqrt(static_cast<double>(bands)));
    relative[p] = static_cast<float>(100.0 * difference / static_cast<double>(bands) / largest);
  }
  const auto map = [&](const std::string& name, const std::string& unit, double range,
                       const std::vector<float>& values) -> Json {
    return {{"name", name},
            {"kind", "map"},
            {"unit", unit},
            {"range", {-range, range}},
            {"values", report::pack_half(values, {captured.height, captured.width})}};
  };
  return {{"type", "viewer"},
          {"title", "Capture, fit and difference"},
          {"width", captured.width},
          {"height", captured.height},
          {"spectral_unit", "unit of the capture"},
          {"images", Json::array({rgb("capture", captured), rgb("fit", fitted),
                                  map("capture − fit", "% of the peak, mean of the bands", 2.0, relative),
                                  map("capture − fit over noise", "σ of the sum over the bands", 10.0, sigma)})},
          {"spectra", Json::array({{{"name", "capture"}, {"mean", report::pack_spectra(captured)}},
                                   {{"name", "fit"}, {"mean", report::pack_spectra(fitted)}}})}};
}

}  // namespace

std::pair<std::string, std::string> fit_verdict(const fitting::SceneFit& fit, const fitting::Uncertainty& uncertainty,
                                                const fitting::Attribution& attribution) {
  if (!fit.converged) {
    return {"not converged",
            fmt::format("The fit stopped at its limit of iterations with a mean squared residual of {:.3g}.",
                        fit.chi_square)};
  }
  std::string text = attribution.sentence;  // begins with w/w', or why there is none
  if (uncertainty.find(fitting::kW) == nullptr) text = "Fitted with w/w' held.";
  if (!uncertainty.weak.empty()) {
    text += fmt::format(" Not determined: {}{}.", uncertainty.weak.front().sentence,
                        uncertainty.weak.size() > 1 ? fmt::format(" and {} more", uncertainty.weak.size() - 1) : "");
  }
  return {uncertainty.find(fitting::kW) != nullptr ? fitting::name(attribution.verdict) : "fitted", text};
}

report::Json fit_report(const fitting::ForwardModel& model, const fitting::Capture& capture,
                        const fitting::FitState& start, const fitting::SceneFit& fit, const fitting::FitParams& params,
                        const fitting::Uncertainty& uncertainty, const fitting::Attribution& attribution,
                        const image::SpectralImage& fitted, const FitReportInput& input) {
  const auto [state, sentence] = fit_verdict(fit, uncertainty, attribution);
  Json sections = Json::array();
  sections.push_back(state_section(start, uncertainty.state, fit));
  sections.push_back(weak_section(uncertainty));
  sections.push_back(estimates_section(uncertainty));
  if (uncertainty.profile) sections.push_back(profile_section(*uncertainty.profile));
  if (!attribution.causes.empty()) sections.push_back(attribution_section(attribution));
  sections.push_back(viewer_section(fit, fitted));
  sections.push_back(band_section(fit));
  sections.push_back(band_table(fit));
  sections.push_back(correlation_section(uncertainty));
  sections.push_back(stage_section(fit));
  Json rows;
  rows["command"] = input.command_line;
  rows["interglow"] = input.version;
  rows["capture"] = fmt::format("{} × {} pixels, {} bands; {} pixels used, {} masked, {} saturated, {} invalid",
                                capture.image.width, capture.image.height, capture.image.bands(), capture.used,
                                capture.masked, capture.saturated, capture.invalid);
  rows["patches"] = model.elements().size();
  rows["spectral modes"] = model.spectra().modes();
  rows["Huber limit [σ]"] = params.huber_sigmas;
  rows["error of the model added to the noise"] = params.model_sigma;
  rows["seconds"] = fmt::format("{:.1f}", input.seconds);
  for (const auto& [file, hash] : input.inputs) rows["SHA-256 of " + file] = hash;
  sections.push_back({{"type", "facts"}, {"title", "Settings"}, {"rows", rows}});
  if (!input.warnings.empty()) {
    Json items = Json::array();
    for (const std::string& warning : input.warnings) items.push_back(warning);
    sections.push_back({{"type", "text"}, {"title", "Warnings"}, {"paragraphs", Json::array()}, {"items", items}});
  }
  return {{"title", input.title},
          {"subtitle", "Fit of light, camera and w/w' to a capture"},
          {"verdict", {{"state", state}, {"text", sentence}}},
          {"sections", sections},
          {"footer", "interglow " + input.version}};
}

}  // namespace interglow::cli
