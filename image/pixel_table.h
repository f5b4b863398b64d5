// SPDX-License-Identifier: GPL-3.0-or-later
/// Spectra of single pixels as a table.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "image/spectral_image.h"

namespace interglow::image {

/// Row 0 is the top, column 0 the left.
struct PixelPosition {
  int row = 0;
  int column = 0;
};

/// Writes CSV: one line a band, one column a pixel named "row<r>_column<c>", radiance in the image's unit.
/// @throws InvalidParams for a pixel outside the image, naming it and the size.
void write_pixel_table(const std::filesystem::path& path, const SpectralImage& image,
                       const std::vector<PixelPosition>& pixels, const std::vector<std::string>& comments = {});

}  // namespace interglow::image
