// SPDX-License-Identifier: GPL-3.0-or-later
/// Spectral images that commands take in any format, captures included.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "image/spectral_image.h"

namespace interglow::cli {

struct SpectralInput {
  image::SpectralImage image;     ///< finite; 0 where a value is not
  std::vector<std::uint8_t> use;  ///< height × width, 1: can be used
};

/// A capture (a description, or a folder that holds capture.toml) corrected, or a bare file of any format as it is.
/// Warnings go to stderr.
/// @throws InvalidInput as `fitting::read_capture` and `image::read_cube`
SpectralInput read_spectral_input(const std::string& path);

/// Clears the pixels that a mask file (image/mask_file.h) leaves out; an empty name leaves out none.
void apply_mask(SpectralInput& input, const std::string& mask);

}  // namespace interglow::cli
