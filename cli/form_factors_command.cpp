// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "cli/commands.h"
#include "cli/form_factor_cases.h"
#include "diagnostics/error.h"
#include "files/atomic_file.h"

namespace interglow::cli {
namespace {

struct Options {
  std::string input;
  std::string output;
  double tolerance = 1e-4;
  bool timing = false;
};

int run_cases(const Options& options) {
  const std::string text = evaluate_form_factor_cases(options.input, options.tolerance, options.timing).dump(1) + "\n";
  if (options.output.empty())
    std::fwrite(text.data(), 1, text.size(), stdout);
  else
    files::write_text_atomically(options.output, text);
  return kSuccess;
}

int run(const Options& options) {
  if (options.input.ends_with(".json")) return run_cases(options);
  throw InvalidInput(fmt::format("{}: expected a file of cases that ends in .json.", options.input));
}

}  // namespace

void add_form_factors_command(CLI::App& app, Session& session, std::function<int()>& action) {
  CLI::App* command = app.add_subcommand("form-factors", "Form factors of the cases in a JSON file");
  const auto options = std::make_shared<Options>();
  command->add_option("input", options->input, "CASES.json: cases with id, kind and geometry")->required();
  command->add_option("--tolerance", options->tolerance, "wanted absolute error of a form factor; 0: round-off")
      ->capture_default_str();
  command->add_option("--out", options->output, "file to write; the terminal if not given");
  command->add_flag("--timing", options->timing, "add the seconds each case took");
  add_session_options(*command, session);
  command->callback([options, &action] { action = [options] { return run(*options); }; });
}

}  // namespace interglow::cli
