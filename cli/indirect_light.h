// SPDX-License-Identifier: GPL-3.0-or-later
/// Pictures with more or less light between the objects than there is.
#pragma once

#include <vector>

#include "image/spectral_image.h"
#include "rendering/render.h"

namespace interglow::cli {

/// total + (factor - 1) · Σ parts. Parts without values are 0, the others have the size of the total.
image::SpectralImage with_parts_scaled(const image::SpectralImage& total,
                                       const std::vector<const image::SpectralImage*>& parts, double factor);

/// The picture with `factor` times what came from other surfaces: rr, lr, ll and rl.
image::SpectralImage with_indirect_scaled(const rendering::RenderedImages& images, double factor);

}  // namespace interglow::cli
