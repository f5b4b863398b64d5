// SPDX-License-Identifier: GPL-3.0-or-later
/// The grey scenes that another renderer has made images of (tests/data/mitsuba), and how an image is compared with
/// these.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "image/spectral_image.h"
#include "scene/scene.h"

namespace interglow::test {

/// The scene of a folder from its camera.json and OBJ files, with grey bands of 1 nm from 500 nm upwards.
scene::Scene mitsuba_scene(const std::filesystem::path& folder, int bands);

/// Joins triangles a b c, a c d of one plane, as the files list them, to quads.
void join_triangle_pairs(mesh::PatchMesh& mesh);

/// The half-cylinders on quads that cover the same facets exactly: all 128 around, 32 / `merge` along the axis.
/// With `closed` they become solids (end caps and a bottom, which the camera does not see and which light nothing it
/// sees), so that their insides need no elements.
scene::Scene half_cylinder_strips(const std::filesystem::path& folder, int bands, int merge, bool closed);

/// 1 where no pixel within two pixels shows another object: the silhouettes' band is 0.
std::vector<char> inside_silhouettes(const std::vector<int>& object, int width, int height);

struct Difference {
  double rms = 0.0;       ///< relative to the mean of the reference
  double bias = 0.0;      ///< mean difference, relative to the mean of the reference
  double mean = 0.0;      ///< of the reference
  std::size_t count = 0;  ///< pixels or blocks compared
};

/// Over the pixels where `keep` is 1 and the reference is not 0; first band of both. `block` > 1: of means over block x
/// block pixels.
Difference compare(const image::SpectralImage& picture, const image::SpectralImage& reference,
                   const std::vector<char>& keep, int block = 1);

/// What of the difference the noise of the reference does not explain, pixel by pixel: with d = ours - theirs and the
/// standard errors s of the reference (unbiased s², noise independent from pixel to pixel), d² - s² has the square of
/// our own deviation as its expectation. Both values are relative to the mean of the reference.
struct OwnDifference {
  double rms = 0.0;    ///< sqrt(max(0, mean(d² - s²)))
  double bound = 0.0;  ///< sqrt(mean + 2.33 standard errors of that mean): exceeds the true value with 99 %
};
OwnDifference own_difference(const image::SpectralImage& picture, const image::SpectralImage& reference,
                             const image::SpectralImage& standard_error, const std::vector<char>& keep);

}  // namespace interglow::test
