// SPDX-License-Identifier: GPL-3.0-or-later
#include "cli/run_result.h"

#include <fmt/format.h>
#include <sys/resource.h>
#include <tbb/global_control.h>

#include <nlohmann/json.hpp>

#include "radiosity/form_factor.h"

namespace interglow::cli {
namespace {

using Json = nlohmann::ordered_json;

double peak_memory_mib() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;  // Linux counts in KiB
}

/// Sum over all pixels of the integral over the image's bands.
double integrated(const image::SpectralImage& image, const Eigen::VectorXd& widths_nm) {
  double sum = 0.0;
  const auto bands = static_cast<std::size_t>(image.bands());
  for (std::size_t k = 0; k < image.value.size(); ++k)
    sum += image.value[k] * widths_nm[static_cast<Eigen::Index>(k % bands)];
  return sum;
}

Eigen::VectorXd camera_widths_nm(const scene::Scene& scene) {
  const int last = scene.camera.last_band < 0 ? static_cast<int>(scene.grid.size()) - 1 : scene.camera.last_band;
  return scene.grid.widths_nm().segment(scene.camera.first_band, last - scene.camera.first_band + 1);
}

Json bounces_json(const std::optional<int>& bounces) { return bounces ? Json(*bounces) : Json("inf"); }

Json settings_json(const scene::SceneDescription& description) {
  const scene::SolveDescription& solve = description.solve;
  const auto& grid = description.grid;
  return {{"wavelengths_nm", std::vector<double>(grid.centers_nm().begin(), grid.centers_nm().end())},
          {"bounces", bounces_json(solve.bounces)},
          {"tolerance", solve.tolerance},
          {"max_iterations", solve.max_iterations},
          {"form_factor_tolerance", solve.form_factor_tolerance},
          {"occlusion", solve.occlusion},
          {"smooth_closure", solve.smooth_closure},
          {"model", solve.model == scene::LightModel::kExact ? "exact" : "paper"},
          {"samples_per_side", description.render.samples_per_side},
          {"gather_tolerance", description.render.gather_tolerance},
          {"contact_region_mm", description.output.contact_region_mm}};
}

Json object_json(const scene::Object& object, const scene::ObjectReport& report) {
  const auto& distance = report.remesh.distance;
  return {{"name", object.name},
          {"mesh", report.file.string()},
          {"format", report.read.format},
          {"scan_points", report.read.points_in_file},
          {"scan_faces", report.read.faces_in_file},
          {"patches", object.patches.faces.size()},
          {"area_mm2", mesh::total_area(object.patches)},
          {"scan_area_mm2", report.remesh.scan_area_mm2},
          {"closed", object.patches.closed},
          {"noise_sigma_mm", report.remesh.noise_sigma_mm},
          {"edge_length_mm", report.remesh.edge_length_mm},
          {"distance_to_scan_rms_mm", distance.rms_mm},
          {"distance_to_scan_max_mm", distance.maximum_mm},
          {"normal_change_rms_deg", report.remesh.normal_change_deg},
          {"smallest_angle_deg", report.remesh.angles.minimum_deg},
          {"crossings", report.remesh.crossings},
          {"scan_overlap_mm2", report.remesh.scan_overlap.area_mm2},
          {"scan_overlap_depth_mm", report.remesh.scan_overlap.depth_mm},
          {"patch_overlap_mm2", report.remesh.patch_overlap.area_mm2},
          {"closed_contact_mm", report.remesh.closed_contact_mm},
          {"repair",
           {{"points_merged", report.repair.points_merged},
            {"unused_points_removed", report.repair.unused_points_removed},
            {"duplicate_faces_removed", report.repair.duplicate_faces_removed},
            {"flat_faces", report.repair.flat_faces_removed + report.repair.flat_faces_flipped},
            {"edges_split", report.repair.edges_split},
            {"points_split", report.repair.points_split},
            {"faces_turned", report.repair.faces_turned},
            {"components", report.repair.components},
            {"components_removed", report.repair.components_removed},
            {"border_loops", report.repair.borders.size()},
            {"holes_filled", report.repair.holes_filled}}}};
}

Json form_factor_json(const radiosity::TransportReport& report) {
  Json methods = Json::object();
  for (std::size_t m = 0; m < report.pairs_by_method.size(); ++m) {
    if (report.pairs_by_method[m] > 0)
      methods[radiosity::name(static_cast<radiosity::FormFactorMethod>(m))] = report.pairs_by_method[m];
  }
  return {{"elements", report.elements},
          {"pairs", report.pairs},
          {"facing_pairs", report.facing_pairs},
          {"stored_pairs", report.stored_pairs},
          {"partially_visible_pairs", report.partially_visible_pairs},
          {"blocked_pairs", report.blocked_pairs},
          {"pairs_by_method", methods},
          {"max_row_sum", report.max_row_sum},
          {"closure_max", report.closure_max},
          {"closure_rms", report.closure_rms},
          {"error_estimate_max", report.error_estimate_max},
          {"error_estimate_rms", report.error_estimate_rms},
          {"smoothing_change_max", report.smoothing_change_max},
          {"bytes", report.bytes}};
}

Json energy_json(const radiosity::EnergyBalance& balance) {
  return {{"received_W", balance.received},       {"absorbed_W", balance.absorbed},
          {"escaped_W", balance.escaped},         {"stokes_loss_W", balance.stokes_loss},
          {"last_bounce_W", balance.last_bounce}, {"relative_error", balance.relative_error}};
}

Json error_json(const radiosity::ErrorEstimate& error) {
  Json json;
  const auto add = [&](const char* name, const radiosity::ComponentError& component) {
    json[name] = {{"mean", component.mean}, {"element", component.element}};
  };
  add("image", error.total);
  add("re", error.re);
  add("rr", error.rr);
  add("le", error.le);
  add("li", error.li);
  add("rl", error.rl);
  add("form_factors", error.form_factors);
  json["residual"] = error.residual;
  json["faceting"] = error.faceting;
  json["assessed_share"] = error.assessed_share;
  return json;
}

Json contact_json(const std::optional<rendering::ContactRatio>& contact) {
  if (!contact) return nullptr;
  return {{"w_prime", contact->w},
          {"mean_f_re_per_sr", contact->mean_f_re},
          {"mean_f_rr_per_sr", contact->mean_f_rr},
          {"region_mm", contact->distance_mm},
          {"pixels", contact->pixels},
          {"estimator", contact->least_squares ? "least squares" : "projection"}};
}

}  // namespace

std::vector<ComponentMean> component_means(const rendering::RenderedImages& images, const Eigen::VectorXd& widths_nm) {
  double covered = 0.0;
  for (const float share : images.coverage) covered += share;
  const double whole = integrated(images.total, widths_nm);
  std::vector<ComponentMean> means;
  const auto add = [&](const char* name, const image::SpectralImage& image) {
    const double sum = integrated(image, widths_nm);
    means.push_back({name, covered > 0.0 ? sum / covered : 0.0, whole > 0.0 ? sum / whole : 0.0});
  };
  add("image", images.total);
  add("re", images.re);
  add("rr", images.rr);
  add("le", images.le);
  add("li", indirect_luminescence(images));
  add("rl", images.rl);
  add("lr", images.lr);
  add("ll", images.ll);
  if (!images.emission.value.empty()) add("emission", images.emission);
  return means;
}

std::string result_json(const scene::SceneDescription& description, const RunOutcome& outcome,
                        const WrittenImages& written, const std::string& command_line) {
  const scene::Scene& scene = outcome.built.scene;
  Json result;
  result["interglow"] = INTERGLOW_VERSION;
  result["command"] = command_line;
  result["scene"] = description.file.string();
  result["settings"] = settings_json(description);
  result["inputs"] = Json::array();
  for (const scene::InputFile& input : outcome.built.inputs) {
    result["inputs"].push_back({{"path", input.path.string()}, {"sha256", input.sha256}});
  }
  result["warnings"] = outcome.built.warnings;
  result["objects"] = Json::array();
  std::size_t patches = 0;
  for (std::size_t o = 0; o < scene.objects.size(); ++o) {
    result["objects"].push_back(object_json(scene.objects[o], outcome.built.objects[o]));
    patches += scene.objects[o].patches.faces.size();
  }
  result["patches"] = patches;
  result["form_factors"] = form_factor_json(outcome.transport);
  result["solve"] = {{"bounces", bounces_json(description.solve.bounces)},
                     {"iterations", outcome.solution.iterations},
                     {"relative_residual", outcome.solution.relative_residual},
                     {"converged", outcome.solution.converged}};
  result["energy"] = energy_json(outcome.balance);
  result["error"] = error_json(outcome.error);
  result["image"] = {{"width", outcome.images.total.width},
                     {"height", outcome.images.total.height},
                     {"bands", outcome.images.total.bands()},
                     {"exposure", written.exposure},
                     {"primary_rays", outcome.images.report.primary_rays},
                     {"divided_pixels", outcome.images.report.divided_pixels},
                     {"gather_points", outcome.images.report.gather_points},
                     {"gather_channels", outcome.images.report.gather_channels}};
  for (const auto& [name, share] : written.clipped_share) result["image"]["clipped_share"][name] = share;
  for (const ComponentMean& mean : component_means(outcome.images, camera_widths_nm(scene))) {
    result["components"][mean.name] = {{"mean_radiance_W_m2_sr", mean.radiance}, {"share", mean.share}};
  }
  result["contact"] = contact_json(outcome.contact);
  for (const StageTimes::Stage& stage : outcome.times.stages()) {
    result["seconds"][stage.name] = stage.wall_s;
    result["processor_seconds"][stage.name] = stage.processor_s;
  }
  result["seconds"]["total"] = outcome.times.total_wall_s();
  result["processor_seconds"]["total"] = outcome.times.total_processor_s();
  result["threads"] = tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism);
  result["peak_memory_MiB"] = peak_memory_mib();
  result["files"] = written.files;
  return result.dump(1) + "\n";
}

std::string summary(const RunOutcome& outcome, const WrittenImages& written, const std::string& folder) {
  const scene::Scene& scene = outcome.built.scene;
  std::string text;
  std::size_t patches = 0;
  for (const scene::Object& object : scene.objects) patches += object.patches.faces.size();
  text += fmt::format("{} patches, {} bands, {} x {} x {} image in {:.1f} s, {:.0f} MiB\n", patches, scene.grid.size(),
                      outcome.images.total.width, outcome.images.total.height, outcome.images.total.bands(),
                      outcome.times.total_wall_s(), peak_memory_mib());
  text += fmt::format(
      "energy balance   {:.1e} relative ({:.6g} W in = {:.6g} absorbed + {:.6g} escaped + {:.6g} Stokes loss",
      outcome.balance.relative_error, outcome.balance.received, outcome.balance.absorbed, outcome.balance.escaped,
      outcome.balance.stokes_loss);
  if (outcome.balance.last_bounce > 0.0) text += fmt::format(" + {:.3g} under way", outcome.balance.last_bounce);
  text += ")\n";
  if (outcome.contact) {
    text +=
        fmt::format("w'               {:.4f}, mean f_rr / mean f_re of {} pixels within {:g} mm of another object\n",
                    outcome.contact->w, outcome.contact->pixels, outcome.contact->distance_mm);
  }
  const radiosity::ErrorEstimate& error = outcome.error;
  const std::vector<std::pair<std::string, radiosity::ComponentError>> errors = {
      {"image", error.total}, {"re", error.re}, {"rr", error.rr}, {"le", error.le}, {"li", error.li}, {"rl", error.rl}};
  for (const ComponentMean& mean : component_means(outcome.images, camera_widths_nm(scene))) {
    text += fmt::format("mean of {:<8} {:.6g} W m^-2 sr^-1, {:6.2f} %", mean.name, mean.radiance, 100.0 * mean.share);
    for (const auto& [name, estimate] : errors) {
      if (name == mean.name && mean.radiance > 0.0)
        text += fmt::format(", within {:.1e} relative ({:.1e} at a point)", estimate.mean, estimate.element);
    }
    text += "\n";
  }
  for (const std::string& warning : outcome.built.warnings) text += "warning: " + warning + "\n";
  text += fmt::format("written to {}: {}, result.json\n", folder, fmt::join(written.files, ", "));
  return text;
}

}  // namespace interglow::cli
