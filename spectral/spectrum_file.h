// SPDX-License-Identifier: GPL-3.0-or-later
/// Spectra from and to files.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "spectral/spectrum.h"

namespace interglow::spectral {

/// Reads one spectrum: a Mitsuba .spd file by its extension, comma-separated values otherwise (docs of table_file.h).
/// @param column  name of the value column; may be empty where the file has only one
/// @throws InvalidInput for a bad table, and for a column that is not there (naming the nearest and all others).
Spectrum read_spectrum(const std::filesystem::path& path, std::string_view column = {});

/// The names read_spectrum knows in this file, in their order.
std::vector<std::string> spectrum_columns(const std::filesystem::path& path);

/// A column of a CSV file to be written.
struct NamedValues {
  std::string name;
  Eigen::VectorXd value;
};

/// Writes columns over wavelength as CSV, readable by read_spectrum without loss, atomically.
/// @param comments  lines without the leading '#': unit, source, command
/// @pre every column has as many values as there are wavelengths
void write_spectra_csv(const std::filesystem::path& path, const Eigen::VectorXd& wavelength_nm,
                       const std::vector<NamedValues>& columns, const std::vector<std::string>& comments = {});

}  // namespace interglow::spectral
