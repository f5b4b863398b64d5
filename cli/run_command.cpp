// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>

#include "cli/commands.h"
#include "cli/run_images.h"
#include "cli/run_pipeline.h"
#include "cli/run_result.h"
#include "diagnostics/error.h"
#include "files/atomic_file.h"

namespace interglow::cli {
namespace {

struct Options {
  std::filesystem::path scene;
  std::filesystem::path out;
  std::string bounces;
};

std::optional<int> bounces_of(const std::string& text) {
  if (text == "inf") return std::nullopt;
  std::size_t used = 0;
  try {
    const int bounces = std::stoi(text, &used);
    if (used == text.size() && bounces >= 0 && bounces <= 10000) return bounces;
  } catch (const std::exception&) {  // no number: refused below with the others
  }
  throw InvalidParams("--bounces " + text + ": expected a whole number from 0 to 10000, or inf.");
}

int run(const Options& options, const Session& session) {
  scene::SceneDescription description = scene::read_scene_file(options.scene);
  std::string command_line = "interglow run " + options.scene.string() + " --out " + options.out.string();
  if (!options.bounces.empty()) {
    description.solve.bounces = bounces_of(options.bounces);
    command_line += " --bounces " + options.bounces;
  }
  RunOutcome outcome = run_scene(description, session.progress);
  // An older result must not name pictures that are being replaced.
  std::error_code none_there;
  std::filesystem::remove(options.out / "result.json", none_there);
  const WrittenImages written = outcome.times.measure(
      "write", [&] { return write_images(outcome.images, description.output, options.out, command_line); });
  // result.json comes last: where it is, everything it names is there.
  files::write_text_atomically(options.out / "result.json", result_json(description, outcome, written, command_line));
  session.clear_progress();
  fmt::print("{}", summary(outcome, written, options.out.string()));
  return kSuccess;
}

}  // namespace

void add_run_command(CLI::App& app, Session& session, std::function<int()>& action) {
  CLI::App* command = app.add_subcommand("run", "Solves a scene and writes its spectral image, components and figures");
  auto options = std::make_shared<Options>();
  command->add_option("scene", options->scene, "Scene file (docs/scene-format.md)")->required();
  command->add_option("--out", options->out, "Folder for the results; made if it does not exist")->required();
  command->add_option("--bounces", options->bounces,
                      "Indirect bounces, a number or inf (default: solve.bounces of the scene, or inf)");
  add_session_options(*command, session);
  command->callback([options, &session, &action] { action = [options, &session] { return run(*options, session); }; });
}

}  // namespace interglow::cli
