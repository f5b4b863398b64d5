// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "cli/commands.h"
#include "cli/registration_report.h"
#include "cli/spectral_input.h"
#include "files/atomic_file.h"
#include "image/spectral_exr.h"

namespace interglow::cli {
namespace {

struct Options {
  std::string image;
  std::string reference;
  std::string mask;
  std::string out;
  std::string json;
  fitting::AffineParams params;
};

int register_images(Options options) {
  const image::SpectralImage image = read_spectral_input(options.image).image;
  SpectralInput input = read_spectral_input(options.reference);
  apply_mask(input, options.mask);
  const image::SpectralImage& reference = input.image;
  options.params.fixed_mask = input.use;
  const RegisteredImage registered = register_on(image, reference, options.params);
  if (!options.out.empty()) {
    image::write_spectral_exr(
        options.out, registered.warped.image,
        {{"Software", "interglow " INTERGLOW_VERSION},
         {"interglow:command", fmt::format("interglow register {} {}", options.image, options.reference)},
         {"interglow:registration", registration_json(registered.found).dump()}});
  }
  if (!options.json.empty())
    files::write_text_atomically(options.json, registration_json(registered.found).dump(2) + "\n");
  print_registration(registered.found);
  return kSuccess;
}

}  // namespace

void add_register_command(CLI::App& app, Session& session, std::function<int()>& action) {
  CLI::App* command =
      app.add_subcommand("register", "Aligns an image to a reference by an affine map and resamples it there");
  auto options = std::make_shared<Options>();
  command->add_option("image", options->image, "Spectral image of any format, or capture, that is moved")->required();
  command->add_option("reference", options->reference, "The one that stays")->required();
  command->add_option("--out", options->out, "Spectral EXR for the resampled image, 0 where it has no value [none]");
  command->add_option("--mask", options->mask,
                      "Grey EXR, PNG or TIFF; only pixels of the reference that are not 0 count [all]");
  command->add_option("--json", options->json, "File for the map, its covariance and all figures [none]");
  command->add_option("--spline-order", options->params.spline_order, "3 or 5")->capture_default_str();
  command->add_option("--prefilter", options->params.prefilter_sigma_px, "Blur before the last level [px]")
      ->capture_default_str();
  command
      ->add_option("--search-turn", options->params.search_turn_deg,
                   "Turns that are searched, to either side [degrees]")
      ->capture_default_str();
  command->add_option("--search-scale", options->params.search_scale, "Largest scale that is searched")
      ->capture_default_str();
  command->add_option("--search-shift", options->params.search_shift, "Largest shift that is searched, share of a side")
      ->capture_default_str();
  add_session_options(*command, session);
  command->callback([options, &action] { action = [options] { return register_images(*options); }; });
}

}  // namespace interglow::cli
