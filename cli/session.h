// SPDX-License-Identifier: GPL-3.0-or-later
/// What all subcommands share: threads, progress on the terminal, Ctrl-C, exit status.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

#include "diagnostics/progress.h"

namespace interglow::cli {

/// Exit statuses. Bad input never leaves half-written files.
enum ExitStatus { kSuccess = 0, kFailure = 1, kBadInput = 2, kDisagrees = 3, kUndecided = 4, kInterrupted = 130 };

/// Options before or after the subcommand's name, and the progress that long work reports to.
struct Session {
  int threads = 0;  ///< 0: all cores
  bool quiet = false;
  Progress progress;  ///< a bar with time left on a terminal, silent otherwise; stops on Ctrl-C
  std::function<void()> clear_progress = [] {};  ///< call before printing results
};

/// Adds --threads and --quiet to a subcommand.
void add_session_options(CLI::App& command, Session& session);

/// Limits threads, installs the Ctrl-C handler, runs the command's action and turns exceptions into a message on stderr
/// and an exit status.
int run_guarded(Session& session, const std::function<int()>& action);

/// One subcommand: declares its options on `app` and, when chosen, stores what to run in `action`.
using AddCommand = void (*)(CLI::App& app, Session& session, std::function<int()>& action);

}  // namespace interglow::cli
