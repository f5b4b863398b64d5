// SPDX-License-Identifier: GPL-3.0-or-later
/// From a radiosity solution to pixels.
#pragma once

#include <optional>
#include <vector>

#include "diagnostics/progress.h"
#include "image/spectral_image.h"
#include "radiosity/direct_light.h"
#include "radiosity/elements.h"
#include "radiosity/solution.h"
#include "scene/scene.h"

namespace interglow::rendering {

struct RenderParams {
  /// Primary rays per pixel side where the picture changes within the pixel (silhouettes, shadow edges); 1 elsewhere.
  int samples_per_side = 4;
  /// Wanted relative error of the gathered indirect irradiance at a surface point.
  double gather_tolerance = 1e-3;
};

void validate(const RenderParams& params);

/// The picture and its components; their sum is the picture to rounding. All the same size and bands.
struct RenderedImages {
  image::SpectralImage total;
  image::SpectralImage re, rr, le, lr, ll, rl;  ///< empty where the scene has no such light
  std::vector<float> coverage;                  ///< share of each pixel covered by objects
};

/// Primary hits by Embree; direct light evaluated at the hits with shadow rays and the smooth surface's normal; indirect
/// irradiance gathered at the vertices of what is seen with the form-factor kernels and interpolated. Radiance = radiosity / π.
/// Deterministic for any number of threads.
RenderedImages render(const scene::Scene& scene, const radiosity::Elements& elements, const radiosity::Solution& solution,
                      const RenderParams& params, const Progress& progress = {});

}  // namespace interglow::rendering
