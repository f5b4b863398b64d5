// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "cli/commands.h"
#include "cli/form_factor_cases.h"
#include "cli/form_factor_scene.h"
#include "diagnostics/error.h"
#include "files/atomic_file.h"

namespace interglow::cli {
namespace {

struct Options {
  std::string input;
  std::string output;
  std::optional<double> tolerance{};
  bool timing = false;
};

/// Of cases without --tolerance; a scene file has its own.
constexpr double kCaseTolerance = 1e-4;

int run_cases(const Options& options) {
  const double tolerance = options.tolerance.value_or(kCaseTolerance);
  const std::string text = evaluate_form_factor_cases(options.input, tolerance, options.timing).dump(1) + "\n";
  if (options.output.empty())
    std::fwrite(text.data(), 1, text.size(), stdout);
  else
    files::write_text_atomically(options.output, text);
  return kSuccess;
}

int run_scene(const Options& options, const Session& session) {
  const std::string text = evaluate_scene_form_factors(
      {.scene = options.input,
       .output = options.output,
       .tolerance = options.tolerance,
       .comment = fmt::format("form factors F_ij of {}, made by interglow {}", options.input, INTERGLOW_VERSION)},
      session.progress);
  session.clear_progress();
  std::fwrite(text.data(), 1, text.size(), stdout);
  return kSuccess;
}

int run(const Options& options, const Session& session) {
  if (options.input.ends_with(".json")) return run_cases(options);
  if (options.input.ends_with(".toml")) return run_scene(options, session);
  throw InvalidInput(fmt::format("{}: expected a scene (.toml) or a file of cases (.json).", options.input));
}

}  // namespace

void add_form_factors_command(CLI::App& app, Session& session, std::function<int()>& action) {
  CLI::App* command = app.add_subcommand("form-factors", "Form factors of a scene, or of the cases in a JSON file");
  const auto options = std::make_shared<Options>();
  command->add_option("input", options->input, "SCENE.toml, or CASES.json: cases with id, kind and geometry")
      ->required();
  command->add_option(
      "--tolerance", options->tolerance,
      fmt::format(
          "wanted absolute error: of a row of the scene's matrix (default: the scene file's), or of a case's form "
          "factor (default {:g}; 0: round-off)",
          kCaseTolerance));
  command->add_option("--out", options->output,
                      "file to write: the matrix as .mtx or .npz, or the cases' results; without it no matrix, and "
                      "results to the terminal");
  command->add_flag("--timing", options->timing, "add the seconds each case took");
  add_session_options(*command, session);
  command->callback([options, &session, &action] { action = [options, &session] { return run(*options, session); }; });
}

}  // namespace interglow::cli
