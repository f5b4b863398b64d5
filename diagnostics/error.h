// SPDX-License-Identifier: GPL-3.0-or-later
/// How the libraries tell their caller that they cannot go on. They never print and never exit.
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

namespace interglow {

/// A file, mesh or table that cannot be used. The message is a sentence with file, line, key, value,
/// what was expected and what to do; the program prints it and exits with status 2.
class InvalidInput : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// A parameter out of its range. The message names field, value and range; exit status 2.
class InvalidParams : public std::invalid_argument {
  using std::invalid_argument::invalid_argument;
};

/// A computation that cannot give a trustworthy number (singular system, no convergence); exit status 1.
class NumericalFailure : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Thrown by `Progress::update` once the caller asked to stop (Ctrl-C); exit status 130.
class Cancelled : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Sentences for the user about input that was used, but is not what it should be.
using Warnings = std::vector<std::string>;

}  // namespace interglow
