// SPDX-License-Identifier: GPL-3.0-or-later
/// Spectral images as folders of grey pictures, one a band.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

#include "image/spectral_image.h"

namespace interglow::image {

struct BandFolder {
  SpectralImage image;             ///< values as in the files, not divided by full scale
  std::vector<std::string> files;  ///< one a band
  int whole_bits = 0;              ///< 8, 16 or 32: whole numbers of so many bits; 0: floats
  double gamma = 1.0;              ///< that a file says its values were encoded with; 1: none says so
};

/// Reads the TIFF and PNG files (.tif, .tiff, .png) of a folder as bands. Which is which, in this order:
///   1. `wavelengths.csv` in the folder: a line "file,wavelength_nm", then one line a band, in any order; every picture
///      in the folder must be listed;
///   2. `wavelength_nm`, increasing, for the files in the order of their names (numbers in names count as numbers);
///   3. a number before "nm" in every file's name, as in band_550nm.tif.
/// With 1 a `wavelength_nm` that is not empty must agree.
///
/// @throws InvalidInput naming folder, file and value: no pictures, counts that differ, wavelengths that repeat or (2)
///         do not increase, pictures of different sizes or types, and whatever `read_grey_file` refuses.
BandFolder read_band_folder(const std::filesystem::path& folder, const Eigen::VectorXd& wavelength_nm = {});

/// Writes band_<wavelength>nm<extension> with 16 bits for each band, and wavelengths.csv last.
/// @param extension  .png, .tif or .tiff
/// @throws InvalidInput if a value is no whole number from 0 to 65535, naming its place, or a file cannot be written
void write_band_folder(const std::filesystem::path& folder, const SpectralImage& image,
                       const std::string& extension = ".tif");

}  // namespace interglow::image
