// SPDX-License-Identifier: GPL-3.0-or-later
/// The subcommands of `interglow`, one source file each.
#pragma once

#include <functional>

#include "cli/session.h"

namespace interglow::cli {

// One line a command, in the order `interglow --help` lists them; each is defined in <name>_command.cpp.
void add_run_command(CLI::App& app, Session& session, std::function<int()>& action);
void add_inspect_command(CLI::App& app, Session& session, std::function<int()>& action);
void add_compare_command(CLI::App& app, Session& session, std::function<int()>& action);
void add_cross_check_command(CLI::App& app, Session& session, std::function<int()>& action);
void add_capture_command(CLI::App& app, Session& session, std::function<int()>& action);
void add_export_command(CLI::App& app, Session& session, std::function<int()>& action);
void add_register_command(CLI::App& app, Session& session, std::function<int()>& action);
void add_decompose_command(CLI::App& app, Session& session, std::function<int()>& action);
void add_w_ratio_command(CLI::App& app, Session& session, std::function<int()>& action);
void add_simulate_capture_command(CLI::App& app, Session& session, std::function<int()>& action);
void add_fit_command(CLI::App& app, Session& session, std::function<int()>& action);
void add_simulate_scan_command(CLI::App& app, Session& session, std::function<int()>& action);
void add_form_factors_command(CLI::App& app, Session& session, std::function<int()>& action);

}  // namespace interglow::cli
