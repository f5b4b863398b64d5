// SPDX-License-Identifier: GPL-3.0-or-later
#include <CLI/CLI.hpp>
#include <functional>

#include "cli/commands.h"
#include "cli/session.h"

int main(int argc, char** argv) {
  using namespace interglow::cli;
  CLI::App app("Predicts what matte and fluorescent objects look like when they light each other.", "interglow");
  app.set_version_flag("--version", INTERGLOW_VERSION);
  app.require_subcommand(1);
  Session session;
  std::function<int()> action;
  add_run_command(app, session, action);
  add_inspect_command(app, session, action);
  add_compare_command(app, session, action);
  add_cross_check_command(app, session, action);
  add_capture_command(app, session, action);
  add_export_command(app, session, action);
  add_register_command(app, session, action);
  add_decompose_command(app, session, action);
  add_w_ratio_command(app, session, action);
  add_simulate_capture_command(app, session, action);
  add_fit_command(app, session, action);
  add_simulate_scan_command(app, session, action);
  add_form_factors_command(app, session, action);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    const int status = app.exit(error);
    return status == 0 ? kSuccess : kBadInput;
  }
  return run_guarded(session, action);
}
