// SPDX-License-Identifier: GPL-3.0-or-later
/// Runs the built program as a user does.
#pragma once

#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <stdexcept>
#include <string>

namespace interglow::cli {

struct ProgramRun {
  int status = -1;
  std::string output;  ///< stdout; with `2>&1` among the arguments stderr too
};

inline ProgramRun run_program(const std::string& arguments) {
  FILE* pipe = ::popen((std::string("'") + INTERGLOW_PROGRAM + "' " + arguments).c_str(), "r");
  if (pipe == nullptr) throw std::runtime_error("the program cannot be started");
  ProgramRun run;
  std::array<char, 4096> buffer{};
  while (const std::size_t count = std::fread(buffer.data(), 1, buffer.size(), pipe))
    run.output.append(buffer.data(), count);
  const int status = ::pclose(pipe);
  run.status = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return run;
}

}  // namespace interglow::cli
