// SPDX-License-Identifier: GPL-3.0-or-later
/// Tables of numbers in text files: the one reader behind spectra, observers and Donaldson matrices.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

namespace interglow::spectral {

/// A rectangular table over wavelength; the first column is the wavelength.
struct NumericTable {
  std::string path;                 ///< for messages
  std::vector<std::string> column;  ///< names of the value columns, without the wavelength column
  Eigen::VectorXd wavelength_nm;    ///< strictly increasing, positive
  Eigen::MatrixXd value;            ///< one row a wavelength, one column a name
  std::vector<int> line;            ///< line of each row in the file, from 1
};

/// Reads comma-separated values: lines beginning with '#' are comments, the first other line names the columns and
/// every further line is one wavelength [nm] and its values with decimal points.
/// @throws InvalidInput with file, line, column and value for decimal commas, ragged rows, words, NaN or infinite
///         values, wavelengths that do not increase or cannot be nanometres, and files that are no text.
NumericTable read_csv_table(const std::filesystem::path& path);

/// Reads a Mitsuba .spd file: lines of "wavelength value", '#' comments. The one column is named "value".
/// @throws as read_csv_table.
NumericTable read_spd_table(const std::filesystem::path& path);

}  // namespace interglow::spectral
