// SPDX-License-Identifier: GPL-3.0-or-later
/// Surfaces of touching objects that pass through each other: how much, and moving them apart.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

namespace interglow::mesh {

/// How far an object passes through others.
struct Overlap {
  double area_mm2 = 0;     ///< of the parts behind another object's front
  double depth_mm = 0;     ///< the largest
  int crossing_pairs = 0;  ///< pairs of triangles, one of this object and one of another, that cross
};

/// One object's triangles.
struct SolidSurface {
  std::vector<Eigen::Vector3d> points;
  std::vector<std::array<int, 3>> triangles;
  std::vector<Eigen::Vector3d> normals;  ///< per point
  std::vector<char> is_fixed;            ///< per point: stays where it is
  double tolerance_mm = 1;  ///< a point deeper than this behind another surface is taken to be elsewhere, not inside
};

/// Area-weighted normals at the points.
std::vector<Eigen::Vector3d> point_normals(const std::vector<Eigen::Vector3d>& points,
                                           const std::vector<std::array<int, 3>>& triangles);

/// A point is inside another object if the nearest point of that is not on its border, faces it, and has it behind by
/// at most `tolerance_mm`; a triangle counts with the share of its corners that are.
std::vector<Overlap> measure_overlap(const std::vector<SolidSurface>& surfaces);

/// Moves points until none lies inside another object and no triangles cross: both sides by half the depth and a tiny
/// clearance, along the normal of the surface they are behind.
/// @return true if nothing is left inside
/// Cost: up to 40 rounds of O(points log triangles).
bool separate(std::vector<SolidSurface>& surfaces);

}  // namespace interglow::mesh
