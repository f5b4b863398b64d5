// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <chrono>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "cli/commands.h"
#include "cli/fit_report.h"
#include "cli/fitted_scene.h"
#include "diagnostics/error.h"
#include "diagnostics/suggestion.h"
#include "files/atomic_file.h"
#include "fitting/capture_file.h"
#include "image/png.h"
#include "image/spectral_exr.h"
#include "scene/scene_builder.h"

namespace interglow::cli {
namespace {

struct Options {
  std::filesystem::path scene, capture, out;
  std::vector<std::string> free, fix;
  fitting::FitParams params{};
};

const std::map<std::string, bool fitting::FitParams::*>& groups() {
  static const std::map<std::string, bool fitting::FitParams::*> all{
      {"light", &fitting::FitParams::light},
      {"pose", &fitting::FitParams::pose},
      {"focal", &fitting::FitParams::focal},
      {"principal", &fitting::FitParams::principal},
      {"distortion", &fitting::FitParams::distortion},
      {"blur", &fitting::FitParams::blur},
      {"w", &fitting::FitParams::w},
      {"reflectance", &fitting::FitParams::reflectance},
      {"reflectance-offset", &fitting::FitParams::reflectance_offset},
      {"gain", &fitting::FitParams::gain},
      {"offset", &fitting::FitParams::offset}};
  return all;
}

void set_groups(const std::vector<std::string>& names, bool free, fitting::FitParams& params) {
  for (const std::string& name : names) {
    const auto found = groups().find(name);
    if (found == groups().end()) {
      std::vector<std::string> known;
      for (const auto& [group, member] : groups()) known.push_back(group);
      const auto near = nearest_word(name, known);
      throw InvalidParams(
          fmt::format("{} {}: expected light, pose, focal, principal, distortion, blur, w, reflectance, "
                      "reflectance-offset, gain or offset{}.",
                      free ? "--free" : "--fix", name, near ? "; did you mean " + *near + "?" : ""));
    }
    params.*(found->second) = free;
  }
}

/// Mean difference over the bands, over the peak.
void write_difference(const std::filesystem::path& path, const fitting::SceneFit& fit,
                      const image::SpectralImage& fitted) {
  const image::SpectralImage& captured = fit.data.image;
  image::ScalarMap map{captured.width, captured.height, std::vector<float>(fit.data.use.size(), 0.0F)};
  float largest = 0.0F;
  const auto bands = static_cast<std::size_t>(captured.bands());
  for (std::size_t i = 0; i < captured.value.size(); ++i) {
    largest = std::max(largest, captured.value[i]);
    if (fit.data.use[i / bands])
      map.value[i / bands] += (captured.value[i] - fitted.value[i]) / static_cast<float>(bands);
  }
  for (float& value : map.value) value /= largest;
  image::write_map_png(path, map, -0.02, 0.02, image::MapColours::kCubehelix,
                       {{"quantity", "capture - fit over the capture's largest value, black -2 %, white +2 %"}});
}

int fit(const Options& options, const Session& session) {
  const auto begin = std::chrono::steady_clock::now();
  fitting::FitParams params = options.params;
  set_groups(options.free, true, params);
  set_groups(options.fix, false, params);
  const scene::SceneDescription description = scene::read_scene_file(options.scene);
  const fitting::Capture capture = fitting::read_capture(options.capture);
  const scene::BuiltScene built = scene::build_scene(description, session.progress);
  const fitting::ForwardParams forward{.transport = {.tolerance = description.solve.form_factor_tolerance,
                                                     .occlusion = description.solve.occlusion,
                                                     .smooth_closure = description.solve.smooth_closure,
                                                     .black_sides = false},
                                       .bounces = description.solve.bounces};
  fitting::ForwardModel model(built.scene, forward, session.progress);
  const fitting::ForwardModel coarse(built.scene, fitting::coarser(forward), session.progress);
  const fitting::ForwardModel coarsest(built.scene, fitting::coarser(fitting::coarser(forward)), session.progress);
  params.small_pictures = &coarse;
  const fitting::FitState start = model.initial_state();
  const fitting::SceneFit found = fitting::fit_scene(model, capture, start, params, session.progress);
  const fitting::Uncertainty uncertainty =
      fitting::examine(model, found, params, {.coarser = &coarse, .coarsest = &coarsest}, session.progress);
  const fitting::Attribution attribution =
      fitting::attribute_w(model, forward, found, params, uncertainty, session.progress);
  const image::SpectralImage fitted = fitting::picture(model, found.state, model.evaluate(found.state, {}));

  FitReportInput input{.title = options.scene.string(),
                       .command_line = fmt::format("interglow fit {} --capture {} --out {}", options.scene.string(),
                                                   options.capture.string(), options.out.string()),
                       .version = INTERGLOW_VERSION,
                       .inputs = {},
                       .warnings = built.warnings,
                       .seconds = 0.0};
  for (const std::string& group : options.free) input.command_line += " --free " + group;
  for (const std::string& group : options.fix) input.command_line += " --fix " + group;
  for (const scene::InputFile& file : built.inputs) input.inputs.emplace_back(file.path.string(), file.sha256);
  input.warnings.insert(input.warnings.end(), capture.warnings.begin(), capture.warnings.end());
  input.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();

  std::filesystem::create_directories(options.out);
  write_fitted_materials(model, uncertainty.state, options.out);
  const std::string scene_text = fitted_scene_text(description, model, uncertainty.state, options.out);
  const report::Json document =
      fit_report(model, capture, start, found, params, uncertainty, attribution, fitted, input);
  image::write_spectral_exr(options.out / "fitted.exr", fitted);
  write_difference(options.out / "difference.png", found, fitted);
  files::write_text_atomically(options.out / "scene.toml", scene_text);
  files::write_text_atomically(options.out / "report.html", report::html_page(document));
  files::write_text_atomically(options.out / "report.json", document.dump(1) + "\n");
  session.clear_progress();
  const auto [state, sentence] = fit_verdict(found, uncertainty, attribution);
  fmt::print("{}: {}\n", state, sentence);
  // The verdict names the first.
  for (std::size_t k = 1; k < uncertainty.weak.size(); ++k)
    fmt::print("not determined: {}\n", uncertainty.weak[k].sentence);
  for (const std::string& note : uncertainty.notes) fmt::print("note: {}\n", note);
  fmt::print("{}\n", (options.out / "report.html").string());
  return found.converged ? kSuccess : kFailure;
}

}  // namespace

void add_fit_command(CLI::App& app, Session& session, std::function<int()>& action) {
  CLI::App* command = app.add_subcommand("fit", "Fits light, camera, blur and w/w' of a scene to a captured image");
  auto options = std::make_shared<Options>();
  const fitting::FitParams& defaults = options->params;
  command->add_option("scene", options->scene, "Scene file with a rough camera and one directional light")->required();
  command->add_option("--capture", options->capture, "Captured spectral image or its description (docs/captures.md)")
      ->required();
  command->add_option("--out", options->out, "Folder for scene.toml, report.html, report.json and pictures")
      ->required();
  command
      ->add_option(
          "--free", options->free,
          "Also fit: principal, distortion, reflectance (a factor on each material), reflectance-offset (added to "
          "its reflectance in all bands); default: light, pose, focal, blur, w, gain, offset")
      ->delimiter(',');
  command->add_option("--fix", options->fix, "Hold any of these")->delimiter(',');
  command
      ->add_option("--reflectance-sigma", options->params.reflectance_sigma,
                   "Standard deviation of the prior on reflectance scales")
      ->default_val(defaults.reflectance_sigma);
  command
      ->add_option("--reflectance-offset-sigma", options->params.reflectance_offset_sigma,
                   "Standard deviation of the prior on reflectance offsets")
      ->default_val(defaults.reflectance_offset_sigma);
  command->add_option("--model-sigma", options->params.model_sigma, "Relative error of the model, added to the noise")
      ->default_val(defaults.model_sigma);
  command->add_flag("!--near", options->params.staged, "The start is near: skip silhouettes and small pictures");
  add_session_options(*command, session);
  command->callback([options, &session, &action] { action = [options, &session] { return fit(*options, session); }; });
}

}  // namespace interglow::cli
