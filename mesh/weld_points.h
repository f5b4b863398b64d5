// SPDX-License-Identifier: GPL-3.0-or-later
/// Merges points that are the same point.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace interglow::mesh {

struct WeldedPoints {
  std::vector<Eigen::Vector3d> points;  ///< in the order of their first appearance
  std::vector<int> index_of;            ///< for each point given, its index in `points`
};

/// Merges points with equal coordinates (-0 equals 0; points that are not finite stay single). Cost: linear.
[[nodiscard]] WeldedPoints weld_equal_points(const std::vector<Eigen::Vector3d>& points);

/// Merges each point into the first earlier kept point within `distance` of it, so that no two kept points are nearer
/// than that. Deterministic; depends on the order of the points. Cost: linear for evenly spread points.
/// @pre points finite, distance > 0
[[nodiscard]] WeldedPoints weld_near_points(const std::vector<Eigen::Vector3d>& points, double distance);

}  // namespace interglow::mesh
