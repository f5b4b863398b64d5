// SPDX-License-Identifier: GPL-3.0-or-later
/// The paper's correction factor w / w′ over a region, and what it owes to the choice of the region.
#pragma once

#include <cstdint>
#include <vector>

#include "image/png.h"

namespace interglow::fitting {

/// f_re (f_1) and f_rr (f_2) of one image; not-a-number where there is none.
struct ShadingMaps {
  image::ScalarMap direct;
  image::ScalarMap indirect;
};

struct RegionParams {
  /// The region is grown (positive) and shrunk (negative) by each of these distances [px].
  std::vector<double> radius_px{-8, -6, -4, -2, -1, 0, 1, 2, 4, 6, 8};
  /// Side of the square tiles that are left out in turn [px]; at least 1. Larger tiles than shading is correlated over.
  int tile_px = 16;
};

/// w, w′ and their ratio over the region grown by radius_px.
struct RegionRatio {
  double radius_px = 0.0;
  std::size_t pixels = 0;  ///< with all four terms
  double captured = 0.0;   ///< w = mean f_2 / mean f_1
  double simulated = 0.0;  ///< w′
  double ratio = 0.0;      ///< w / w′
};

struct InterreflectionRatio {
  RegionRatio region;              ///< as given
  std::vector<RegionRatio> curve;  ///< one a radius whose region is not empty and has both kinds of light
  double lowest = 0.0;             ///< of the ratio along the curve
  double highest = 0.0;
  double tile_sd = 0.0;  ///< standard deviation of the ratio by the jackknife over tiles; not finite with one tile
  int tiles = 0;
};

/// w = mean f_2 / mean f_1 over the region in the captured image, w′ the same in the simulated one
/// [tominaga-guarnera-2021, section 3.3]. Pixels in which any of the four maps is not a number are left out of both.
///
/// @param region  height × width, not 0: in the region
/// @throws InvalidParams if sizes disagree; InvalidInput if the region is empty, has no direct light, or the simulated
///         image has no interreflection there
/// Cost O(pixels × radii).
InterreflectionRatio interreflection_ratio(const ShadingMaps& captured, const ShadingMaps& simulated,
                                           const std::vector<std::uint8_t>& region, const RegionParams& params = {});

/// Distance of every pixel centre to the nearest pixel centre of the other kind, less half a pixel: positive outside
/// the region, negative inside, exact. If all pixels are of one kind, infinite.
std::vector<float> signed_distance_px(const std::vector<std::uint8_t>& region, int width, int height);

}  // namespace interglow::fitting
