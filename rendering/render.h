// SPDX-License-Identifier: GPL-3.0-or-later
/// From a radiosity solution to pixels.
#pragma once

#include <cstdint>
#include <vector>

#include "diagnostics/progress.h"
#include "image/spectral_image.h"
#include "radiosity/elements.h"
#include "radiosity/solution.h"
#include "scene/scene.h"

namespace interglow::rendering {

struct RenderParams {
  /// Primary rays per pixel side where the picture changes within the pixel (silhouettes, creases, shadow edges), in
  /// [1, 64]; 1 elsewhere.
  int samples_per_side = 4;
  /// Wanted error of the gathered indirect irradiance, relative to the mean irradiance of the lit surfaces, in [1e-9,
  /// 1].
  double gather_tolerance = 1e-3;
};

/// @throws InvalidParams naming field, value and range.
void validate(const RenderParams& params);

/// What render() did.
struct RenderReport {
  std::int64_t primary_rays = 0;
  std::int64_t divided_pixels = 0;  ///< with samples_per_side² samples
  std::int64_t gather_points = 0;
  int gather_channels = 0;    ///< spectral dimensions of the light that was gathered
  double seconds_rays = 0.0;  ///< primary hits and beams
  double seconds_gather = 0.0;
  double seconds_pixels = 0.0;  ///< from coefficients to spectra
};

/// The picture and its components; total = re + rr + le + lr + ll + rl + emission to rounding. All the same size and
/// bands, those of the camera; a component that the scene cannot have (nothing luminesces, no bounces) has no values.
struct RenderedImages {
  image::SpectralImage total;
  image::SpectralImage re, rr, le, lr, ll, rl;
  image::SpectralImage emission;  ///< what emitting surfaces show of themselves: exitance / π
  std::vector<float> coverage;    ///< share of each pixel covered by objects
  std::vector<int> object;        ///< object that covers most of each pixel; -1: none
  RenderReport report;
};

/// Primary hits by Embree. Beams are evaluated at the hits with shadow rays and the smooth surface's normal. Light from
/// other surfaces (indirect, emitting objects, and what these hide of the sky) is gathered at the corners of the faces
/// that are seen with form-factor kernels, on the few spectral channels that it spans, and interpolated; faces over
/// which it bends are divided. A pixel is the mean over its square: one sample at its centre where nothing changes, a
/// lattice of samples elsewhere. Radiance = radiosity / π. Backs of one-sided sheets are black; the sky seen directly
/// is 0.
///
/// @param elements  of the scene's faces, as in `make_elements(scene)`
/// @param solution  of these elements; without bounces only direct light is shown
/// @throws InvalidParams for params or a camera out of range
/// Deterministic for any number of threads. Cost O(pixels × bands + visible faces × log faces / tolerance).
RenderedImages render(const scene::Scene& scene, const radiosity::Elements& elements,
                      const radiosity::Solution& solution, const RenderParams& params, const Progress& progress = {});

}  // namespace interglow::rendering
