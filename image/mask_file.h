// SPDX-License-Identifier: GPL-3.0-or-later
/// Masks in image files.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

namespace interglow::image {

/// One flag a pixel: 1 where the grey OpenEXR, TIFF or PNG is not 0. An empty path gives an empty mask, that is all
/// pixels.
/// @throws InvalidInput unless the file has one channel and the given size.
std::vector<std::uint8_t> read_mask(const std::filesystem::path& path, int width, int height);

}  // namespace interglow::image
