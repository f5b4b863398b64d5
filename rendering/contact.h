// SPDX-License-Identifier: GPL-3.0-or-later
/// Where a picture shows one object close to another, and how strong interreflection is there.
#pragma once

#include <optional>
#include <vector>

#include "radiosity/elements.h"
#include "rendering/render.h"
#include "scene/scene.h"

namespace interglow::rendering {

/// Per pixel the nearest other object, if the point that the pixel's centre shows lies within `distance_mm` of it;
/// otherwise -1. Cost O(pixels × objects × log faces).
std::vector<int> contact_region(const scene::Scene& scene, const radiosity::Elements& elements, double distance_mm);

/// w' = mean(f_rr) / mean(f_re) over the contact region [tominaga2021, section 3.3].
struct ContactRatio {
  double w = 0.0;              ///< w'
  double mean_f_re = 0.0;      ///< [1/sr]
  double mean_f_rr = 0.0;      ///< [1/sr]
  double distance_mm = 0.0;    ///< limit of the region
  int pixels = 0;              ///< in the region
  bool least_squares = false;  ///< how the terms were found, see contact_ratio
};

/// Two objects: the shading terms of `paper_shading_terms`, as in the paper. Otherwise, or where these cannot be told
/// apart, the components are projected one by one: f_re = <re, a1> / <a1, a1>, f_rr = <rr, a2> / <a2, a2> with a1 = S_i
/// E, a2 = S_i S_j E, i the object seen, j its neighbour, E the light's spectrum.
/// @returns nothing if no pixel belongs to the region, or no light falls on it
std::optional<ContactRatio> contact_ratio(const scene::Scene& scene, const radiosity::Elements& elements,
                                          const RenderedImages& images, double distance_mm);

}  // namespace interglow::rendering
