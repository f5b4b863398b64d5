// SPDX-License-Identifier: GPL-3.0-or-later
/// Where the tables that the program ships are found (spectra, observers, Donaldson matrices).
#pragma once

#include <filesystem>

namespace interglow::files {

/// The folder of shipped tables. Searched in this order: the environment variable INTERGLOW_TABLES; the installed
/// place relative to the running program (../share/interglow/tables), so that an installation may be moved;
/// the source tree of the build (spectral/tables).
/// @throws InvalidInput naming the places that were tried.
std::filesystem::path tables_directory();

}  // namespace interglow::files
