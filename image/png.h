// SPDX-License-Identifier: GPL-3.0-or-later
/// Pictures and maps for people to look at.
#pragma once

#include <filesystem>
#include <vector>

#include "image/channel_file.h"
#include "image/preview.h"

namespace interglow::image {

/// Writes encoded sRGB, 8 bits, clipped per channel.
void write_png(const std::filesystem::path& path, const RgbImage& rgb, const Attributes& attributes = {});

/// One number a pixel; not-a-number where there is none.
struct ScalarMap {
  int width = 0;
  int height = 0;
  std::vector<float> value;  ///< height × width; row 0 is the top
};

enum class MapColours {
  kGrey,       ///< 16-bit grey, linear from black (lowest) to white (highest); no value: black
  kCubehelix,  ///< 8-bit colours of monotonically rising luminance [green-2011], from black to white; no value:
               ///< transparent
};

/// Writes a map with `lowest` and below at one end of the colours and `highest` and above at the other.
/// @throws InvalidParams unless lowest < highest, both finite.
void write_map_png(const std::filesystem::path& path, const ScalarMap& map, double lowest, double highest,
                   MapColours colours, const Attributes& attributes = {});

}  // namespace interglow::image
