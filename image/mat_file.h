// SPDX-License-Identifier: GPL-3.0-or-later
/// Spectral images in MATLAB files: the only place that knows libmatio.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>

#include "image/spectral_image.h"

namespace interglow::image {

struct MatNames {
  /// Array of rows × columns × bands. Empty: the only numeric array of three dimensions in the file.
  std::string cube{};
  /// Vector with one number a band [nm]. Empty: the only vector of that length whose name is or begins with wavelength,
  /// wave, wl, lambda or bands.
  std::string wavelength{};
};

struct MatFile {
  SpectralImage image;
  std::string cube;    ///< the variable that was read
  int whole_bits = 0;  ///< 8, 16, 32 or 64: whole numbers of so many bits; 0: floats
};

/// Reads the versions 4, 5 (to 7) and 7.3. Values are kept in single precision.
///
/// @param wavelength_nm  of the bands; empty: from the file
/// @throws InvalidInput naming file, variable and sizes: a variable that is not there or could be one of several,
///         complex or sparse values, cells and structures, no or several wavelength vectors, wavelengths that do not
///         increase, more values than the file can hold, a damaged file.
MatFile read_mat(const std::filesystem::path& path, const MatNames& names = {},
                 const Eigen::VectorXd& wavelength_nm = {});

enum class MatType {
  kSingle,
  kUint16,  ///< values must be whole numbers from 0 to 65535
};

/// Writes version 5, compressed, with the variables `cube` (rows × columns × bands) and `wavelength_nm` (a column);
/// version 7.3 where the cube has 2 GiB or more, which version 5 cannot hold. Atomically.
/// @throws InvalidParams if sizes disagree; InvalidInput if a value does not fit the type or the file cannot be written
void write_mat(const std::filesystem::path& path, const SpectralImage& image, MatType type = MatType::kSingle);

}  // namespace interglow::image
