// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "cli/commands.h"
#include "cli/registration_report.h"
#include "cli/spectral_input.h"
#include "diagnostics/error.h"
#include "files/atomic_file.h"
#include "image/comparison_files.h"
#include "image/image_metrics.h"
#include "image/mask_file.h"

namespace interglow::cli {
namespace {

struct Options {
  std::string image;
  std::string reference;
  std::string mask;
  std::string out;
  std::string json;
  std::optional<double> exposure{};
  bool registered = false;
};

nlohmann::json to_json(const image::Statistic& statistic) {
  return {{"mean", statistic.mean},
          {"standard_deviation", statistic.standard_deviation},
          {"largest", statistic.largest},
          {"pixels", statistic.count}};
}

nlohmann::json to_json(const image::ImageComparison& comparison, const Options& options,
                       const Eigen::VectorXd& wavelength_nm) {
  const auto list = [](const Eigen::VectorXd& values) { return std::vector<double>(values.begin(), values.end()); };
  return {
      {"image", options.image},
      {"reference", options.reference},
      {"version", INTERGLOW_VERSION},
      {"pixels", comparison.pixels},
      {"exposure", comparison.exposure},
      {"clipped_share", {{"image", comparison.image_clipped_share}, {"reference", comparison.reference_clipped_share}}},
      {"spectral_angle_deg", to_json(comparison.spectral_angle_deg)},
      {"delta_srgb", to_json(comparison.delta_srgb)},
      {"ciede2000", to_json(comparison.ciede2000)},
      {"pixels_above_white", comparison.above_white},
      {"rmse", comparison.rmse},
      {"relative_rmse", comparison.relative_rmse},
      {"mean_difference", comparison.mean_difference},
      {"relative_mean_difference", comparison.relative_mean_difference},
      {"wavelength_nm", list(wavelength_nm)},
      {"band_rmse", list(comparison.band_rmse)},
      {"band_relative_rmse", list(comparison.band_relative_rmse)}};
}

void print(const image::ImageComparison& comparison) {
  const auto line = [](const char* name, const image::Statistic& statistic, const char* unit) {
    fmt::print("{:<18} mean {:.4g}{}, SD {:.4g}{}, largest {:.4g}{} ({} pixels)\n", name, statistic.mean, unit,
               statistic.standard_deviation, unit, statistic.largest, unit, statistic.count);
  };
  fmt::print("{:<18} {}\n", "pixels compared", comparison.pixels);
  line("spectral angle", comparison.spectral_angle_deg, "°");
  line("sRGB difference", comparison.delta_srgb, "");
  line("CIEDE2000", comparison.ciede2000, "");
  if (comparison.above_white > 0) {
    fmt::print("{:<18} {} pixels are brighter than the white of the exposure, where CIEDE2000 is not defined\n", "",
               comparison.above_white);
  }
  fmt::print("{:<18} {:.4g} W m^-2 sr^-1 nm^-1, {:.4g} % of the reference's mean\n", "RMSE", comparison.rmse,
             100.0 * comparison.relative_rmse);
  fmt::print("{:<18} {:+.4g} W m^-2 sr^-1 nm^-1, {:+.4g} %\n", "mean difference", comparison.mean_difference,
             100.0 * comparison.relative_mean_difference);
  fmt::print("{:<18} {:.4g}; clipped {:.1f} % of the image, {:.1f} % of the reference\n", "exposure",
             comparison.exposure, 100.0 * comparison.image_clipped_share, 100.0 * comparison.reference_clipped_share);
}

/// The mask of the user, or all pixels that are not black in either image, where the registered image has a value.
std::vector<std::uint8_t> covered_mask(std::vector<std::uint8_t> mask, const fitting::WarpedImage& warped,
                                       const image::SpectralImage& reference) {
  const auto bands = static_cast<std::size_t>(reference.bands());
  const auto lit = [&](const image::SpectralImage& image, std::size_t pixel) {
    const auto first = image.value.begin() + static_cast<std::ptrdiff_t>(pixel * bands);
    return std::any_of(first, first + static_cast<std::ptrdiff_t>(bands), [](float value) { return value != 0.0F; });
  };
  if (mask.empty() && warped.image.bands() == reference.bands()) {
    for (std::size_t p = 0; p < warped.covered.size(); ++p)
      mask.push_back(lit(warped.image, p) || lit(reference, p) ? 1 : 0);
  }
  for (std::size_t p = 0; p < mask.size(); ++p) mask[p] = mask[p] != 0 && warped.covered[p] != 0 ? 1 : 0;
  return mask;
}

int compare(const Options& options) {
  image::SpectralImage image = read_spectral_input(options.image).image;
  const image::SpectralImage reference = read_spectral_input(options.reference).image;
  std::vector<std::uint8_t> mask = image::read_mask(options.mask, reference.width, reference.height);
  std::optional<fitting::AffineRegistration> registration;
  if (options.registered) {
    RegisteredImage moved = register_on(image, reference, {.fixed_mask = mask});
    mask = covered_mask(std::move(mask), moved.warped, reference);
    image = std::move(moved.warped.image);
    registration = moved.found;
    print_registration(*registration);
  }
  const auto comparison = image::compare(image, reference, {.mask = mask, .exposure = options.exposure});
  print(comparison);
  if (!options.json.empty()) {
    nlohmann::json figures = to_json(comparison, options, image.wavelength_nm);
    if (registration) figures["registration"] = registration_json(*registration);
    files::write_text_atomically(options.json, figures.dump(2) + "\n");
  }
  if (!options.out.empty()) {
    const std::string command = fmt::format("interglow compare {} {}", options.image, options.reference);
    const image::Attributes attributes = {{"Software", "interglow " INTERGLOW_VERSION}, {"interglow:command", command}};
    for (const auto& map : image::write_comparison_maps(options.out, comparison, attributes)) {
      fmt::print("{}: {}, black 0 to white {:g}\n", map.file.string(), map.quantity, map.highest);
    }
  }
  return kSuccess;
}

}  // namespace

void add_compare_command(CLI::App& app, Session& session, std::function<int()>& action) {
  CLI::App* command = app.add_subcommand("compare", "Differences of two spectral images, as numbers and maps");
  auto options = std::make_shared<Options>();
  command->add_option("image", options->image, "Spectral EXR")->required();
  command->add_option("reference", options->reference, "Spectral EXR with the same size and bands")->required();
  command->add_option("--mask", options->mask,
                      "Grey EXR; only pixels that are not 0 are compared [all that are not black]");
  command->add_flag("--register", options->registered,
                    "Align the image to the reference by an affine map before (docs/fitting.md)");
  command->add_option("--exposure", options->exposure,
                      "Factor from XYZ to the display's white [automatic, from the reference]");
  command->add_option("--out", options->out, "Folder for the maps (PNG and EXR) [none]");
  command->add_option("--json", options->json, "File for all figures [none]");
  add_session_options(*command, session);
  command->callback([options, &action] { action = [options] { return compare(*options); }; });
}

}  // namespace interglow::cli
