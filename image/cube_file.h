// SPDX-License-Identifier: GPL-3.0-or-later
/// Spectral images in any of the formats the program knows.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>

#include "image/mat_file.h"
#include "image/spectral_image.h"

namespace interglow::image {

/// What a file may not say itself.
struct CubeHints {
  /// Of the bands [nm], increasing; only for folders and .mat files, empty: from the file.
  Eigen::VectorXd wavelength_nm{};
  MatNames mat{};
};

struct CubeFile {
  SpectralImage image;
  std::string format;  ///< "spectral EXR", "ENVI", "MATLAB", "folder of bands"
  int whole_bits = 0;  ///< 8, 16, 32 or 64: whole numbers of so many bits; 0: floats
  double gamma = 1.0;  ///< that the file says its values were encoded with
};

/// Reads by what the path is: a folder (band_folder.h), .exr (spectral_exr.h), .mat (mat_file.h), or ENVI's header or
/// data file (envi.h) otherwise.
/// @throws InvalidInput as these do, or for wavelengths given beside a format that has its own
CubeFile read_cube(const std::filesystem::path& path, const CubeHints& hints = {});

/// Writes spectral EXR (.exr), MATLAB (.mat), or ENVI (.img, .dat, .raw, .bsq, .bil, .bip; with its .hdr beside it; the
/// last three choose the interleave, otherwise bsq) in single precision.
/// @throws InvalidParams for another extension; InvalidInput if the file cannot be written
void write_cube(const std::filesystem::path& path, const SpectralImage& image);

}  // namespace interglow::image
