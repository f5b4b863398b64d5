// SPDX-License-Identifier: GPL-3.0-or-later
#include "cli/indirect_light.h"

namespace interglow::cli {

image::SpectralImage with_parts_scaled(const image::SpectralImage& total,
                                       const std::vector<const image::SpectralImage*>& parts, double factor) {
  image::SpectralImage sum = total;
  if (factor == 1.0) return sum;
  for (const image::SpectralImage* part : parts) {
    for (std::size_t v = 0; v < part->value.size(); ++v)
      sum.value[v] += static_cast<float>((factor - 1.0) * part->value[v]);
  }
  return sum;
}

image::SpectralImage with_indirect_scaled(const rendering::RenderedImages& images, double factor) {
  return with_parts_scaled(images.total, {&images.rr, &images.lr, &images.ll, &images.rl}, factor);
}

}  // namespace interglow::cli
