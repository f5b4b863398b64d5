// SPDX-License-Identifier: GPL-3.0-or-later
/// Masks that commands read from image files.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace interglow::cli {

/// One flag a pixel: 1 where the grey EXR is not 0. An empty path gives an empty mask, that is all pixels.
/// @throws InvalidInput unless the file has one channel and the given size.
std::vector<std::uint8_t> read_mask(const std::string& path, int width, int height);

}  // namespace interglow::cli
