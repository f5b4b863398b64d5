// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <string>

#include "cli/commands.h"
#include "exchange/renderer_export.h"
#include "scene/scene_builder.h"

namespace interglow::cli {
namespace {

struct Options {
  std::filesystem::path scene, out;
  std::string format;
  exchange::RendererExportParams params;
};

exchange::Renderer renderer_of(const std::string& format) {
  if (format == "mitsuba3") return exchange::Renderer::kMitsuba3;
  return format == "mitsuba06" ? exchange::Renderer::kMitsuba06 : exchange::Renderer::kPbrt4;
}

int export_scene(Options options, const Session& session) {
  const scene::SceneDescription description = scene::read_scene_file(options.scene);
  options.params.bounces = description.solve.bounces;
  const scene::BuiltScene built = scene::build_scene(description, session.progress);
  const exchange::RendererExport written =
      exchange::export_for_renderer(built.scene, renderer_of(options.format), options.out, options.params);
  session.clear_progress();
  for (const Warnings& warnings : {built.warnings, written.warnings}) {
    for (const std::string& warning : warnings) fmt::print("warning: {}\n", warning);
  }
  fmt::print("{}, and {} meshes beside it\n", written.files.front().string(), written.files.size() - 1);
  return kSuccess;
}

}  // namespace

void add_export_command(CLI::App& app, Session& session, std::function<int()>& action) {
  CLI::App* command =
      app.add_subcommand("export", "Writes a scene's patches, camera, lights and spectra for another renderer");
  auto options = std::make_shared<Options>();
  command->add_option("scene", options->scene, "Scene file (docs/scene-format.md)")->required();
  command->add_option("--format", options->format, "Renderer")
      ->required()
      ->check(CLI::IsMember({"mitsuba3", "mitsuba06", "pbrt4"}));
  command->add_option("--out", options->out, "Folder for the scene and its meshes; made if it does not exist")
      ->required();
  command->add_option("--samples", options->params.samples_per_pixel, "Paths a pixel")->capture_default_str();
  add_session_options(*command, session);
  command->callback(
      [options, &session, &action] { action = [options, &session] { return export_scene(*options, session); }; });
}

}  // namespace interglow::cli
