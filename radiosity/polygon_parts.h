// SPDX-License-Identifier: GPL-3.0-or-later
/// Outlines of any planar shape as convex polygons of three or four corners.
#pragma once

#include <span>
#include <vector>

#include "radiosity/polygon.h"

namespace interglow::radiosity {

/// The outline itself if it is convex with at most four corners, else triangles that cover it once (ears cut off one by
/// one). Repeated and collinear corners are allowed.
///
/// @param outline  a simple closed outline, counter-clockwise seen from the front
/// @throws InvalidParams if fewer than three corners are given, a corner is not finite, the corners are not in a plane
///         (farther off than 1e-6 of the size), or the outline crosses itself
/// Cost: O(n³) in the worst case, O(n²) as a rule.
std::vector<Polygon> convex_parts(std::span<const Eigen::Vector3d> outline);

}  // namespace interglow::radiosity
