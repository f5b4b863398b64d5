// SPDX-License-Identifier: GPL-3.0-or-later
#include "cli/image_mask.h"

#include <fmt/format.h>

#include "diagnostics/error.h"
#include "image/spectral_exr.h"

namespace interglow::cli {

std::vector<std::uint8_t> read_mask(const std::string& path, int width, int height) {
  std::vector<std::uint8_t> flags;
  if (path.empty()) return flags;
  const image::SpectralImage mask = image::read_spectral_exr(path).image;
  if (mask.bands() != 1)
    throw InvalidInput(fmt::format("{}: {} bands; expected a mask of one grey channel.", path, mask.bands()));
  if (mask.width != width || mask.height != height) {
    throw InvalidInput(fmt::format("{}: {} × {} pixels; expected {} × {}, the size of the image.", path, mask.width,
                                   mask.height, width, height));
  }
  for (const float value : mask.value) flags.push_back(value != 0.0F ? 1 : 0);
  return flags;
}

}  // namespace interglow::cli
