// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "cli/commands.h"
#include "cli/indirect_light.h"
#include "cli/registration_report.h"
#include "cli/run_pipeline.h"
#include "cli/shading_files.h"
#include "diagnostics/error.h"
#include "files/atomic_file.h"
#include "fitting/capture_file.h"
#include "fitting/interreflection.h"
#include "image/channel_file.h"
#include "image/mask_file.h"
#include "rendering/paper_images.h"

namespace interglow::cli {
namespace {

/// Pixels that an object covers less are silhouettes: they mix object and background.
constexpr float kLeastCoverage = 0.999F;

struct Options {
  std::filesystem::path scene;
  std::filesystem::path capture;
  std::filesystem::path out;
  std::string mask;
  std::optional<double> region_mm{};
  int components = 4;
  bool registered = false;
  fitting::RegionParams region{};
};

/// Scene bands of the picture's bands: the camera's, in which the capture's must be found.
std::vector<Eigen::Index> bands_of(const fitting::Capture& capture, const image::SpectralImage& rendered) {
  std::vector<Eigen::Index> bands;
  for (const double wavelength : capture.image.wavelength_nm) {
    Eigen::Index nearest = 0;
    (rendered.wavelength_nm.array() - wavelength).abs().minCoeff(&nearest);
    if (std::abs(rendered.wavelength_nm[nearest] - wavelength) > 0.01) {
      throw InvalidInput(
          fmt::format("The capture has a band at {} nm, the scene's camera the bands {} to {} nm without it. Set "
                      "[wavelengths] and the camera's range in the scene file to hold the capture's.",
                      wavelength, rendered.wavelength_nm[0], rendered.wavelength_nm[rendered.bands() - 1]));
    }
    bands.push_back(nearest);
  }
  return bands;
}

image::SpectralImage selected(const image::SpectralImage& image, const std::vector<Eigen::Index>& bands) {
  image::SpectralImage part{image.width, image.height, image.wavelength_nm(bands), {}};
  const auto all = static_cast<std::size_t>(image.bands());
  for (std::size_t first = 0; first < image.value.size(); first += all) {
    for (const Eigen::Index band : bands) part.value.push_back(image.value[first + static_cast<std::size_t>(band)]);
  }
  return part;
}

/// One over the standard deviation at the mean value, relative to its mean; empty if the noise is not known.
Eigen::VectorXd weights_of(const fitting::Capture& capture) {
  if (!capture.noise.known()) return {};
  const int bands = capture.image.bands();
  Eigen::VectorXd weight(bands);
  for (int b = 0; b < bands; ++b) {
    double variance = 0.0;
    for (std::size_t p = 0; p < capture.use.size(); ++p) {
      if (capture.use[p] != 0) variance += capture.variance(p, b);
    }
    weight[b] = 1.0 / std::sqrt(variance / static_cast<double>(capture.used));
  }
  return weight / weight.mean();
}

void require_two_objects(const scene::Scene& scene) {
  if (scene.objects.size() == 2) return;
  throw InvalidInput(fmt::format(
      "The scene has {} objects; w/w' is defined for two that face each other. Leave the others out of the scene file.",
      scene.objects.size()));
}

void fit_camera(scene::Camera& camera, const image::SpectralImage& capture) {
  const double wanted = static_cast<double>(camera.width) / camera.height;
  const double found = static_cast<double>(capture.width) / capture.height;
  // A pixel more or less on one side is rounding.
  if (std::abs(wanted / found - 1.0) > 1.5 / std::min(capture.width, capture.height)) {
    throw InvalidInput(
        fmt::format("The capture has {} × {} pixels, the scene's camera {} × {}: other proportions. Correct width_px "
                    "and height_px.",
                    capture.width, capture.height, camera.width, camera.height));
  }
  camera.width = capture.width;
  camera.height = capture.height;
}

fitting::ShadingMaps maps_of(const fitting::Decomposition& found) {
  const auto map = [&](const char* name) {
    const auto at = std::find(found.name.begin(), found.name.end(), name);
    if (at == found.name.end()) {
      throw InvalidInput(fmt::format("There is no component \"{}\" (only {}): one of the objects is black.", name,
                                     fmt::join(found.name, ", ")));
    }
    return found.shading[static_cast<std::size_t>(at - found.name.begin())];
  };
  return {map("re"), map("rr")};
}

/// The factor on all light between the objects at which the simulated picture has the captured w, found by the secant
/// method. Unlike w / w' it does not owe anything to bounces whose spectrum is not that of two reflections.
struct IndirectFactor {
  double factor = 0.0;
  double slope = 0.0;  ///< d ln w / d ln factor there: 1 if the two terms described the picture exactly
};

/// @param w_at  w of the picture with this factor
std::optional<IndirectFactor> find_factor(const std::function<double(double)>& w_at, double w_simulated,
                                          double w_captured) {
  double left = 1.0, at_left = w_simulated;
  double right = w_captured / w_simulated, at_right = 0.0;
  if (std::abs(right - 1.0) < 1e-3) right = 1.001;
  for (int step = 0; step < 12; ++step) {
    if (!(right > 0.0) || !(right < 1e3)) return std::nullopt;
    at_right = w_at(right);
    const double rise = at_right - at_left;
    if (!std::isfinite(at_right) || rise == 0.0) return std::nullopt;
    const double next = right + (w_captured - at_right) * (right - left) / rise;
    // Far below what noise leaves of any capture.
    if (std::abs(next - right) < 1e-6 * right) return IndirectFactor{next, rise / (right - left) * right / at_right};
    left = right;
    at_left = at_right;
    right = next;
  }
  return std::nullopt;
}

nlohmann::json to_json(const fitting::RegionRatio& region) {
  return {{"radius_px", region.radius_px},
          {"pixels", region.pixels},
          {"w", region.captured},
          {"w_simulated", region.simulated},
          {"w_over_w_simulated", region.ratio}};
}

int w_ratio(const Options& options, const Session& session) {
  fitting::Capture capture = fitting::read_capture(options.capture);
  scene::SceneDescription description = scene::read_scene_file(options.scene);
  if (description.solve.model == scene::LightModel::kPaper)
    throw InvalidInput(options.scene.string() + ": solve.model is \"paper\"; w' is simulated with \"exact\".");
  fit_camera(description.camera, capture.image);
  const double region_mm = options.region_mm.value_or(description.output.contact_region_mm);
  description.output.contact_region_mm = region_mm;
  const RunOutcome run = run_scene(description, session.progress);
  session.clear_progress();
  const scene::Scene& scene = run.built.scene;
  require_two_objects(scene);

  const std::vector<Eigen::Index> bands = bands_of(capture, run.images.total);
  const image::SpectralImage simulated = selected(run.images.total, bands);
  Eigen::VectorXd weight = weights_of(capture);
  if (capture.has_white()) {
    // Radiance factors times the lamp's spectrum are radiances, for which the components are known.
    const Eigen::VectorXd lamp =
        rendering::light_spectrum(scene).segment(scene.camera.first_band, run.images.total.bands())(bands);
    const auto count = static_cast<std::size_t>(lamp.size());
    for (std::size_t v = 0; v < capture.image.value.size(); ++v)
      capture.image.value[v] *= static_cast<float>(lamp[static_cast<Eigen::Index>(v % count)]);
    if (weight.size() > 0) weight = weight.cwiseQuotient(lamp).eval();
  } else {
    capture.warnings.push_back("No white frame: the bands' gains are taken as equal, which real cameras' are not.");
  }
  for (const std::string& warning : capture.warnings) fmt::print(stderr, "warning: {}\n", warning);

  nlohmann::json figures = {{"scene", options.scene.string()},
                            {"capture", options.capture.string()},
                            {"version", INTERGLOW_VERSION},
                            {"region_mm", region_mm},
                            {"white_reference", capture.has_white()}};
  if (options.registered) {
    RegisteredImage moved = register_on(capture.image, simulated);
    print_registration(moved.found);
    figures["registration"] = registration_json(moved.found);
    // Pixels that cannot be used move along: as a picture of ones and zeros, and every mixture is out.
    image::SpectralImage use{capture.image.width, capture.image.height, Eigen::VectorXd::Ones(1), {}};
    for (const std::uint8_t flag : capture.use) use.value.push_back(flag);
    const fitting::WarpedImage moved_use =
        fitting::warp(use, moved.found.moving_from_fixed, simulated.width, simulated.height, 3);
    for (std::size_t p = 0; p < capture.use.size(); ++p)
      capture.use[p] = moved.warped.covered[p] != 0 && moved_use.image.value[p] > 0.99F ? 1 : 0;
    capture.image = std::move(moved.warped.image);
  }

  const std::vector<std::uint8_t> mask = image::read_mask(options.mask, simulated.width, simulated.height);
  std::vector<int> object = run.images.object;
  for (std::size_t p = 0; p < object.size(); ++p) {
    if (capture.use[p] == 0 || run.images.coverage[p] < kLeastCoverage || (!mask.empty() && mask[p] == 0))
      object[p] = -1;
  }
  std::vector<fitting::ComponentBasis> bases;
  for (const int i : {0, 1}) {
    bases.push_back(fitting::paper_basis(rendering::camera_functions(scene, i, 1 - i), options.components));
    bases.back().spectrum = bases.back().spectrum(bands, Eigen::all).eval();
  }
  const fitting::DecompositionParams params{.band_weight = weight};
  const fitting::Decomposition of_capture = fitting::decompose(capture.image, object, bases, params);
  const fitting::Decomposition of_simulation = fitting::decompose(simulated, object, bases, params);

  const std::vector<int> contact = rendering::contact_region(scene, run.elements, region_mm);
  std::vector<std::uint8_t> region;
  std::vector<std::uint16_t> picture;
  for (std::size_t p = 0; p < contact.size(); ++p) {
    region.push_back(object[p] >= 0 && contact[p] >= 0 && contact[p] != object[p] ? 1 : 0);
    picture.push_back(region.back() != 0 ? 65535 : 0);
  }
  const fitting::InterreflectionRatio ratio =
      fitting::interreflection_ratio(maps_of(of_capture), maps_of(of_simulation), region, options.region);

  std::vector<int> object_in_region = object;
  for (std::size_t p = 0; p < region.size(); ++p) {
    if (region[p] == 0) object_in_region[p] = -1;
  }
  const auto w_at = [&](double factor) {
    const fitting::Decomposition found =
        fitting::decompose(selected(with_indirect_scaled(run.images, factor), bands), object_in_region, bases, params);
    const fitting::ShadingMaps maps = maps_of(found);
    return fitting::interreflection_ratio(maps, maps, region, {.radius_px = {0.0}}).region.captured;
  };
  const std::optional<IndirectFactor> equivalent = find_factor(w_at, ratio.region.simulated, ratio.region.captured);

  nlohmann::json curve = nlohmann::json::array();
  for (const fitting::RegionRatio& point : ratio.curve) curve.push_back(to_json(point));
  figures.update({{"region", to_json(ratio.region)},
                  {"curve", curve},
                  {"lowest", ratio.lowest},
                  {"highest", ratio.highest},
                  {"tile_sd", ratio.tile_sd},
                  {"tiles", ratio.tiles},
                  {"capture_decomposition", decomposition_json(of_capture)},
                  {"simulation_decomposition", decomposition_json(of_simulation)},
                  {"warnings", capture.warnings}});
  double factor_sd = 0.0;
  if (equivalent) {
    factor_sd = ratio.tile_sd / ratio.region.ratio * equivalent->factor / equivalent->slope;
    figures["equivalent_factor"] = {
        {"factor", equivalent->factor}, {"tile_sd", factor_sd}, {"slope", equivalent->slope}};
  }
  write_shading(options.out / "shading_captured.exr", of_capture);
  write_shading(options.out / "shading_simulated.exr", of_simulation);
  image::write_grey_words(options.out / "region.png", simulated.width, simulated.height, picture);
  files::write_text_atomically(options.out / "w_ratio.json", figures.dump(2) + "\n");
  fmt::print("w/w' = {:.4f} ± {:.4f} (tiles of {} px); w = {:.4f}, w' = {:.4f}, {} pixels within {} mm\n",
             ratio.region.ratio, ratio.tile_sd, options.region.tile_px, ratio.region.captured, ratio.region.simulated,
             ratio.region.pixels, region_mm);
  fmt::print("over regions grown by {} to {} px: {:.4f} to {:.4f}\n", ratio.curve.front().radius_px,
             ratio.curve.back().radius_px, ratio.lowest, ratio.highest);
  if (equivalent) {
    fmt::print("the simulated picture has this w with {:.4f} ± {:.4f} times the light between the objects\n",
               equivalent->factor, factor_sd);
  }
  for (std::size_t i = 0; i < of_capture.quality.size(); ++i)
    fmt::print("{}: {}\n", scene.objects[i].name, of_capture.quality[i].sentence);
  fmt::print("relative residuals: captured {:.3g}, simulated {:.3g}\n", of_capture.total_relative_residual,
             of_simulation.total_relative_residual);
  return kSuccess;
}

}  // namespace

void add_w_ratio_command(CLI::App& app, Session& session, std::function<int()>& action) {
  CLI::App* command = app.add_subcommand(
      "w-ratio", "w/w': interreflection near a contact in a capture over the same in the simulated picture");
  auto options = std::make_shared<Options>();
  command->add_option("scene", options->scene, "Scene file with two objects, light and camera as captured")->required();
  command->add_option("--capture", options->capture, "capture.toml, its folder, or a bare file of floats")->required();
  command->add_option("--out", options->out, "Folder for w_ratio.json, shading terms and the region")->required();
  command->add_option("--region", options->region_mm, "Points nearer than this to the other object [mm; the scene's]")
      ->check(CLI::PositiveNumber);
  command->add_option("--components", options->components, "2 (re, rr), 4 (and lum, rl) or 5 (le and li apart)")
      ->check(CLI::IsMember({2, 4, 5}))
      ->capture_default_str();
  command->add_option("--mask", options->mask, "Grey EXR, PNG or TIFF; only pixels that are not 0 count [all]");
  command->add_flag("--register", options->registered, "Align the capture to the simulated picture before");
  command->add_option("--tile", options->region.tile_px, "Side of the tiles that are left out in turn [px]")
      ->capture_default_str();
  add_session_options(*command, session);
  command->callback(
      [options, &session, &action] { action = [options, &session] { return w_ratio(*options, session); }; });
}

}  // namespace interglow::cli
