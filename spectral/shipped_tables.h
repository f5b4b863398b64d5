// SPDX-License-Identifier: GPL-3.0-or-later
/// Tables that come with the program, by name.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace interglow::spectral {

/// Begins the name of a shipped table, as in "interglow:illuminants/d65".
inline constexpr std::string_view kShippedPrefix = "interglow:";

/// Where a table is: a name beginning with "interglow:" is looked up among the shipped tables, any other name is a
/// path, relative to `folder` unless absolute (and not checked).
/// @throws InvalidInput for an unknown shipped name, with the nearest known one.
std::filesystem::path find_table(const std::string& name, const std::filesystem::path& folder = {});

/// Names of all shipped tables with their prefix, sorted.
std::vector<std::string> shipped_tables();

}  // namespace interglow::spectral
