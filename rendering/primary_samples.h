// SPDX-License-Identifier: GPL-3.0-or-later
/// What each pixel of a picture sees, and how the beams light it there.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "diagnostics/progress.h"
#include "radiosity/visibility.h"
#include "rendering/camera_rays.h"
#include "rendering/surface.h"
#include "scene/scene.h"

namespace interglow::rendering {

/// One ray through a pixel.
struct Sample {
  int side = -1;  ///< 2 × face + (1 for its back); -1: no object
  FacePoint at;
};

/// Samples of all pixels, row by row: one at the centre, or a lattice of them where a hit, normal, depth or shadow
/// differs between the centre and the corners of the pixel.
struct PrimarySamples {
  std::vector<std::size_t> first;  ///< pixels + 1: samples of pixel p are first[p] ... first[p + 1] - 1
  std::vector<Sample> sample;
  std::vector<float> beam;  ///< samples x beams: visible cosine of each directional light
  std::int64_t rays = 0;
  std::int64_t divided_pixels = 0;
};

/// Cost O(pixels) + samples_per_side² for each divided pixel. Same result for any number of threads.
PrimarySamples primary_samples(const scene::Scene& scene, const CameraRays& camera, const Surface& surface,
                               const radiosity::Visibility& visibility, int samples_per_side, const Progress& progress);

/// Gives pixels with one sample a lattice of them, where `pixels` (one value a pixel) is not 0. Cost O(samples) +
/// samples_per_side² for each such pixel.
void divide_pixels(PrimarySamples& samples, const std::vector<char>& pixels, const scene::Scene& scene,
                   const CameraRays& camera, const Surface& surface, const radiosity::Visibility& visibility,
                   int samples_per_side);

}  // namespace interglow::rendering
