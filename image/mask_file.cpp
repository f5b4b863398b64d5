// SPDX-License-Identifier: GPL-3.0-or-later
#include "image/mask_file.h"

#include <fmt/format.h>

#include "diagnostics/error.h"
#include "image/channel_file.h"
#include "image/spectral_exr.h"

namespace interglow::image {

std::vector<std::uint8_t> read_mask(const std::filesystem::path& path, int width, int height) {
  std::vector<std::uint8_t> flags;
  if (path.empty()) return flags;
  GreyImage mask;
  if (path.extension() == ".exr") {
    SpectralImage image = read_spectral_exr(path).image;
    if (image.bands() != 1)
      throw InvalidInput(
          fmt::format("{}: {} bands; expected a mask of one grey channel.", path.string(), image.bands()));
    mask.width = image.width;
    mask.height = image.height;
    mask.value = std::move(image.value);
  } else {
    mask = read_grey_file(path);
  }
  if (mask.width != width || mask.height != height) {
    throw InvalidInput(fmt::format("{}: {} × {} pixels; expected {} × {}, the size of the image.", path.string(),
                                   mask.width, mask.height, width, height));
  }
  for (const float value : mask.value) flags.push_back(value != 0.0F ? 1 : 0);
  return flags;
}

}  // namespace interglow::image
