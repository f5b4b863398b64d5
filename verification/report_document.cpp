// SPDX-License-Identifier: GPL-3.0-or-later
#include "verification/report_document.h"

#include <fmt/format.h>
#include <sys/utsname.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include "verification/check_scene.h"
#include "verification/report_charts.h"

namespace interglow::verification {
namespace {

using cross_check::RegionResult;
using cross_check::Verdict;
using report::Json;

/// "3.4 %", three digits.
std::string percent(double share) { return fmt::format("{:.3g} %", 100.0 * share); }

Json percent_number(double share) { return std::isfinite(share) ? Json(100.0 * share) : Json("∞"); }

double reach(const RegionResult& region) { return region.half_width + region.discretisation; }

const RegionResult* worst(const CrossCheck& check, Verdict verdict) {
  const RegionResult* found = nullptr;
  for (const RegionResult& region : check.agreement.regions) {
    if (region.verdict != verdict) continue;
    if (found == nullptr ||
        std::abs(region.relative_difference) + reach(region) > std::abs(found->relative_difference) + reach(*found))
      found = &region;
  }
  return found;
}

std::size_t count(const CrossCheck& check, Verdict verdict) {
  return static_cast<std::size_t>(std::count_if(check.agreement.regions.begin(), check.agreement.regions.end(),
                                                [&](const RegionResult& one) { return one.verdict == verdict; }));
}

Json summary_section(const CrossCheck& check) {
  Json rows;
  const RegionResult* whole = nullptr;
  for (const RegionResult& region : check.agreement.regions) {
    if (region.region == "whole" && region.channel == "total") whole = &region;
  }
  if (whole != nullptr) {
    rows["whole picture"] =
        fmt::format("{} differs from {} by {:+.4f} % ± {:.4f} % (one standard error)", check.candidate_name,
                    check.reference_name, 100.0 * whole->relative_difference, 100.0 * whole->standard_error);
    rows["discretisation of the whole"] =
        check.candidate_run() == nullptr ? "none: the path tracer needs no smaller patches"
        : check.coarser_run() != nullptr
            ? percent(whole->discretisation) + ", from halving the patches"
            : percent(whole->discretisation) + ", estimated without halving: " + check.discretisation_note;
  }
  rows["regions that agree"] = fmt::format("{} of {}", count(check, Verdict::kAgrees), check.agreement.regions.size());
  rows["regions that disagree"] = count(check, Verdict::kDisagrees);
  rows["regions undecided"] = count(check, Verdict::kUndecided);
  rows["regions too dark to judge"] = check.agreement.not_judged.size();
  rows["any difference detected"] = check.agreement.difference_detected ? "yes, beyond discretisation" : "no";
  if (check.reference_has_error) {
    rows["z root mean square"] =
        fmt::format("{:.3f} (by chance {:.3f})", check.diagnosis.z_rms, check.diagnosis.expected_z_rms);
    rows["pixels that differ"] = fmt::format("{} of {} (false-discovery rate 1 %)", check.diagnosis.significant_pixels,
                                             check.diagnosis.judged_pixels);
  }
  for (const RadiosityRun* run : {check.coarser_run(), check.candidate_run()}) {
    if (run == nullptr) continue;
    rows[run == check.candidate_run() ? "radiosity" : "radiosity on the scene's own patches"] =
        fmt::format("{} patches, {:.2f} s", run->patches, run->seconds());
  }
  if (check.batches > 0) {
    rows["path tracer"] =
        fmt::format("{} paths in {} batches, {:.1f} s", check.paths, check.batches, check.seconds_path_tracer);
  }
  rows["whole check"] =
      fmt::format("{:.1f} s{}", check.seconds, check.out_of_time ? ", stopped by the time limit" : "");
  return {{"type", "facts"}, {"title", "Summary"}, {"rows", rows}};
}

Json verdict_section(const CrossCheck& check, const CrossCheckParams& params) {
  Json rows = Json::array();
  const double risk = 1.0 - params.agreement.confidence;
  for (const RegionResult& region : check.agreement.regions) {
    rows.push_back({region.channel + ", " + region.region, Json{{"verdict", cross_check::name(region.verdict)}},
                    percent_number(region.relative_difference), percent_number(region.half_width),
                    region.bernstein_half_width ? percent_number(*region.bernstein_half_width) : Json("–"),
                    percent_number(region.discretisation), region.reference,
                    region.difference_detected ? "yes" : "no"});
  }
  return {
      {"type", "table"},
      {"title", "Verdicts"},
      {"text",
       fmt::format("A region agrees if difference, interval and discretisation together stay inside {}. The "
                   "interval is one-sided (Student's t) at {}, so that all looks at the growing samples, of which "
                   "this is number {}, err together with less than the stated risk of {}; for the whole picture the "
                   "Bernstein interval, which does not trust the sample variance, must fit too. Components below {} "
                   "of the total are measured by that share of it.",
                   percent(params.agreement.margin),
                   fmt::format("{:.3f} %", 100.0 * (1.0 - cross_check::risk_of_look(risk, check.looks))), check.looks,
                   percent(risk), percent(params.comparison.faint_component_share))},
      {"columns",
       {"Region", "Verdict", "Difference [%]", "Interval ± [%]", "Bernstein ± [%]", "Discretisation [%]",
        "Reference [W m⁻² sr⁻¹]", "Detected"}},
      {"rows", rows}};
}

Json forest_section(const CrossCheck& check, const CrossCheckParams& params) {
  constexpr std::size_t kShown = 40;
  std::vector<const RegionResult*> shown;
  for (const RegionResult& region : check.agreement.regions) shown.push_back(&region);
  const auto is_whole = [](const RegionResult* one) { return one->region == "whole"; };
  std::stable_sort(shown.begin(), shown.end(), [&](const RegionResult* a, const RegionResult* b) {
    if (is_whole(a) != is_whole(b)) return is_whole(a);
    if (is_whole(a)) return false;
    return std::abs(a->relative_difference) + reach(*a) > std::abs(b->relative_difference) + reach(*b);
  });
  const std::size_t all = shown.size();
  if (all > kShown) shown.resize(kShown);
  Json rows = Json::array();
  for (const RegionResult* one : shown) {
    if (!std::isfinite(one->relative_difference)) continue;
    rows.push_back({{"name", one->channel + ", " + one->region},
                    {"value", 100.0 * one->relative_difference},
                    {"low", 100.0 * (one->relative_difference - reach(*one))},
                    {"high", 100.0 * (one->relative_difference + reach(*one))},
                    {"verdict", cross_check::name(one->verdict)}});
  }
  return {{"type", "forest"},
          {"title", "Equivalence"},
          {"text",
           fmt::format("Relative difference with interval and discretisation against the margin: the whole picture of "
                       "each channel, then the regions farthest out ({} of {}).",
                       rows.size(), all)},
          {"margin", 100.0 * params.agreement.margin},
          {"unit", "%"},
          {"rows", rows}};
}

Json component_section(const CrossCheck& check) {
  Json rows = Json::array();
  const double whole = mean_radiance(check.comparisons.front().reference.mean, check.comparisons.front().band_width_nm);
  for (const auto& one : check.comparisons) {
    const double candidate = mean_radiance(one.candidate, one.band_width_nm);
    const double reference = mean_radiance(one.reference.mean, one.band_width_nm);
    rows.push_back({one.channel, candidate, reference, 100.0 * reference / whole, rms_noise(one.reference) * 100.0});
  }
  return {{"type", "table"},
          {"title", "Components"},
          {"text",
           "Mean radiance over the picture. re: reflection of direct light; rr: interreflection; le: luminescence "
           "excited by direct light; li: by indirect light; rl: interreflection of fluorescent light."},
          {"columns",
           {"Component", check.candidate_name + " [W m⁻² sr⁻¹]", check.reference_name + " [W m⁻² sr⁻¹]",
            "Share of total [%]", "Noise of a pixel [%]"}},
          {"rows", rows}};
}

Json energy_section(const CrossCheck& check) {
  Json rows = Json::array();
  for (const RadiosityRun* run : {check.coarser_run(), check.candidate_run()}) {
    if (run == nullptr) continue;
    const radiosity::EnergyBalance& energy = run->energy;
    rows.push_back({fmt::format("{} patches", run->patches), energy.received, energy.absorbed, energy.escaped,
                    energy.stokes_loss, energy.last_bounce, fmt::format("{:.2e}", energy.relative_error),
                    fmt::format("{:.2e}", run->relative_residual), fmt::format("{:.6f}", run->transport.max_row_sum)});
  }
  return {{"type", "table"},
          {"title", "Energy balance of the radiosity"},
          {"columns",
           {"Run", "Received [W]", "Absorbed [W]", "Escaped [W]", "Stokes loss [W]", "Under way [W]", "Relative error",
            "Residual", "Largest row sum of F"}},
          {"rows", rows}};
}

std::string processor() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    const std::size_t colon = line.find(": ");
    if (line.starts_with("model name") && colon != std::string::npos) return line.substr(colon + 2);
  }
  return "unknown";
}

std::string operating_system() {
  utsname names{};
  if (uname(&names) != 0) return "unknown";
  return fmt::format("{} {}", names.sysname, names.machine);
}

Json settings_section(const CrossCheck& check, const CrossCheckParams& params, const Provenance& provenance) {
  const scene::Camera& camera = check.scene.camera;
  Json rows;
  rows["command"] = provenance.command_line;
  rows["interglow"] = provenance.version;
  rows["margin"] = params.agreement.margin;
  rows["confidence"] = params.agreement.confidence;
  rows["tiles"] = fmt::format("{0} x {0}", params.agreement.tiles_per_side);
  rows["time limit [s]"] = params.time_limit_s;
  rows["picture"] =
      fmt::format("{} x {} pixels, {} bands", camera.width, camera.height, check.comparisons.front().candidate.bands());
  rows["bounces"] = params.radiosity.solve.bounces ? Json(*params.radiosity.solve.bounces) : Json("all");
  rows["form factor tolerance"] = params.radiosity.transport.tolerance;
  rows["solve tolerance"] = params.radiosity.solve.tolerance;
  rows["gather tolerance"] = params.radiosity.render.gather_tolerance;
  rows["samples per pixel side (radiosity picture)"] = params.radiosity.render.samples_per_side;
  rows["seed (path tracer)"] = params.seed;
  rows["paths per batch and pixel"] = params.samples_per_batch;
  rows["processor"] = processor();
  rows["threads"] = tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism);
  rows["system"] = operating_system();
  rows["compiler"] = __VERSION__;
  for (const auto& [file, hash] : provenance.inputs) rows["SHA-256 of " + file] = hash;
  return {{"type", "facts"}, {"title", "Settings, versions, hardware"}, {"rows", rows}};
}

Json not_tested_section(const CrossCheck& check, const CrossCheckParams& params, const Provenance& provenance) {
  Json items = Json::array();
  items.push_back(
      "Smooth shading: both methods see the flat patches, so that they solve the same problem. What the "
      "smooth normals of a curved object change is not part of this check.");
  items.push_back("How well the patches stand for the scans: both methods use the same patches.");
  items.push_back(
      "The measured spectra and Donaldson matrices, the scene reader, and the resampling to bands: both "
      "methods share them.");
  items.push_back(
      "Anything but diffuse surfaces: gloss, translucency, participating media and polarisation are not modelled "
      "by either method.");
  items.push_back("What the camera does not see: light there is tested only by what it sends into the picture.");
  items.push_back("Bands outside the camera's range, except through the luminescence they excite.");
  if (check.coarser_run() == nullptr && check.candidate_run() != nullptr) {
    items.push_back(
        "The discretisation error of the patches by measurement: it is estimated from how sources vary between "
        "neighbouring patches, twice over. Patches that lie across a shadow or a contact may err by more. Not "
        "halved: " +
        check.discretisation_note + ".");
  }
  if (!check.reference_has_error)
    items.push_back(
        "Agreement itself: the reference image came without a standard error, so that only differences are shown.");
  if (!check.agreement.not_judged.empty()) {
    items.push_back(fmt::format("{} regions that hold less than {} of the mean signal.",
                                check.agreement.not_judged.size(), percent(params.agreement.least_signal)));
  }
  for (const std::string& warning : provenance.warnings) items.push_back("Warning: " + warning);
  return {{"type", "text"}, {"title", "What was not tested"}, {"paragraphs", Json::array()}, {"items", items}};
}

Json result_json(const CrossCheck& check, const CrossCheckParams& params) {
  Json regions = Json::array();
  for (const RegionResult& region : check.agreement.regions) {
    regions.push_back(
        {{"channel", region.channel},
         {"region", region.region},
         {"reference_W_m2_sr", region.reference},
         {"relative_difference", region.relative_difference},
         {"standard_error", region.standard_error},
         {"half_width", region.half_width},
         {"bernstein_half_width", region.bernstein_half_width ? Json(*region.bernstein_half_width) : Json()},
         {"discretisation", region.discretisation},
         {"p_difference", region.p_difference},
         {"difference_detected", region.difference_detected},
         {"verdict", cross_check::name(region.verdict)}});
  }
  Json runs = Json::array();
  for (const RadiosityRun* run : {check.coarser_run(), check.candidate_run()}) {
    if (run == nullptr) continue;
    const cross_check::Comparison& total = check.comparisons.front();
    const image::SpectralImage& picture = run == check.candidate_run() ? total.candidate : *total.coarser;
    runs.push_back({{"patches", run->patches},
                    {"seconds", run->seconds()},
                    {"relative_rms_error", rms_error(picture, total.reference, total.band_width_nm)},
                    {"energy_relative_error", run->energy.relative_error}});
  }
  Json noise = Json::array();
  for (const NoisePoint& point : check.noise) {
    noise.push_back({{"seconds", point.seconds},
                     {"paths_per_pixel", point.paths_per_pixel},
                     {"relative_rms_error", point.relative_error}});
  }
  return {{"verdict", cross_check::name(check.verdict)},
          {"margin", params.agreement.margin},
          {"confidence", params.agreement.confidence},
          {"looks", check.looks},
          {"difference_detected", check.agreement.difference_detected},
          {"z_rms", check.diagnosis.z_rms},
          {"z_rms_by_chance", check.diagnosis.expected_z_rms},
          {"autocorrelation", check.diagnosis.autocorrelation},
          {"autocorrelation_z", check.diagnosis.autocorrelation_z},
          {"judged_pixels", check.diagnosis.judged_pixels},
          {"significant_pixels", check.diagnosis.significant_pixels},
          {"radiosity", runs},
          {"path_tracer",
           {{"batches", check.batches},
            {"paths", check.paths},
            {"seconds", check.seconds_path_tracer},
            {"largest_sample_W_m2_sr", check.largest_sample},
            {"noise", noise}}},
          {"seconds", check.seconds},
          {"out_of_time", check.out_of_time},
          {"reference_noise_limits", check.reference_limits},
          {"discretisation", check.coarser_run() != nullptr      ? "measured"
                             : check.coarser_images() != nullptr ? "estimated"
                                                                 : "none"},
          {"regions", regions},
          {"not_judged", check.agreement.not_judged}};
}

}  // namespace

namespace {

/// "3 are undecided because ..." for each of the two reasons: samples cannot decide some regions; for the others there
/// were too few.
std::string undecided_regions(const CrossCheck& check) {
  const auto is_full = [](const RegionResult& region) {
    return region.verdict == Verdict::kUndecided && std::isinf(region.samples_factor);
  };
  const auto full =
      static_cast<std::size_t>(std::count_if(check.agreement.regions.begin(), check.agreement.regions.end(), is_full));
  const std::size_t noisy = count(check, Verdict::kUndecided) - full;
  const auto number = [](std::size_t regions) { return fmt::format("{} {}", regions, regions == 1 ? "is" : "are"); };
  std::string text;
  if (full > 0) {
    text = fmt::format(
        "{} undecided whatever the samples, because discretisation error and difference fill the "
        "margin (smaller patches help)",
        number(full));
  }
  if (noisy > 0) {
    text += fmt::format("{}{} undecided because {}", text.empty() ? "" : ", ", number(noisy),
                        check.paths == 0 || check.reference_limits ? "the reference image is too noisy"
                        : check.out_of_time                        ? "time ran out"
                                                                   : "more samples would be needed");
  }
  return text;
}

}  // namespace

std::string verdict_sentence(const CrossCheck& check, const CrossCheckParams& params) {
  const std::string sides = fmt::format("{} and {}", check.candidate_name, check.reference_name);
  const std::size_t regions = check.agreement.regions.size();
  if (!check.reference_has_error) {
    return fmt::format(
        "The reference image came without a standard error: differences of {} are shown, nothing is claimed.", sides);
  }
  if (check.verdict == Verdict::kAgrees) {
    return fmt::format("Within {} with {} confidence: {} in every one of {} regions{}.",
                       percent(params.agreement.margin), percent(params.agreement.confidence), sides, regions,
                       check.coarser_run() == nullptr && check.candidate_run() != nullptr
                           ? " (the patches' discretisation error was estimated, not measured)"
                           : "");
  }
  const RegionResult* region = worst(check, check.verdict);
  if (region == nullptr) return fmt::format("No region of {} was bright enough to judge.", sides);
  const std::string where = fmt::format("{}, {}: {:+.3f} % ± {:.3f} % (interval){}", region->channel, region->region,
                                        100.0 * region->relative_difference, 100.0 * region->half_width,
                                        check.coarser_images() != nullptr
                                            ? fmt::format(", discretisation {:.3f} %", 100.0 * region->discretisation)
                                            : "");
  if (check.verdict == Verdict::kDisagrees) {
    return fmt::format("{} differ by more than {} in {} of {} regions; the worst is {}.{}", sides,
                       percent(params.agreement.margin), count(check, Verdict::kDisagrees), regions, where,
                       check.coarser_run() == nullptr && check.candidate_run() != nullptr
                           ? " The patches were not halved and their error only estimated, as \"What was not tested\" "
                             "says: look there for patches across shadows or contacts that are too large."
                           : "");
  }
  return fmt::format("{} of {} regions agree within {}, {}; the widest is {}.", count(check, Verdict::kAgrees), regions,
                     percent(params.agreement.margin), undecided_regions(check), where);
}

report::Json report_document(const CrossCheck& check, const CrossCheckParams& params, const Provenance& provenance) {
  Json document;
  document["title"] = "Cross-check of " + provenance.title;
  document["subtitle"] = fmt::format("{} against {}", check.candidate_name, check.reference_name);
  document["verdict"] = {{"state", cross_check::name(check.verdict)}, {"text", verdict_sentence(check, params)}};
  Json sections = Json::array({summary_section(check), viewer_section(check), verdict_section(check, params),
                               forest_section(check, params), component_section(check)});
  if (check.reference_has_error) {
    sections.push_back(z_histogram_section(check));
    sections.push_back(z_quantile_section(check));
    sections.push_back(autocorrelation_section(check));
    sections.push_back(error_against_time_section(check));
  }
  if (check.candidate_run() != nullptr) sections.push_back(energy_section(check));
  sections.push_back(settings_section(check, params, provenance));
  sections.push_back(not_tested_section(check, params, provenance));
  document["sections"] = sections;
  document["result"] = result_json(check, params);
  document["footer"] = fmt::format("Made by interglow {}.", provenance.version);
  return document;
}

}  // namespace interglow::verification
