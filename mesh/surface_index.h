// SPDX-License-Identifier: GPL-3.0-or-later
/// Nearest-point, line-of-sight and crossing queries on a set of triangles (CGAL's AABB tree).
#pragma once

#include <Eigen/Core>
#include <array>
#include <memory>
#include <utility>
#include <vector>

namespace interglow::mesh {

/// A point of a triangle mesh.
struct SurfacePoint {
  int triangle = -1;
  Eigen::Vector3d point = Eigen::Vector3d::Zero();        ///< mm
  Eigen::Vector3d barycentric = Eigen::Vector3d::Zero();  ///< sums to 1
};

/// Immutable once built; all queries may run on several threads at once.
class SurfaceIndex {
 public:
  /// @pre at least one triangle, all indices in range, coordinates finite
  SurfaceIndex(const std::vector<Eigen::Vector3d>& points, const std::vector<std::array<int, 3>>& triangles);
  ~SurfaceIndex();
  SurfaceIndex(SurfaceIndex&&) noexcept;
  SurfaceIndex& operator=(SurfaceIndex&&) noexcept;

  /// The point of the surface nearest to `query`. Cost: O(log triangles).
  SurfacePoint closest(const Eigen::Vector3d& query) const;
  /// The same, quicker when `hint` is near the answer.
  SurfacePoint closest(const Eigen::Vector3d& query, const SurfacePoint& hint) const;
  /// True if the half line from `origin` along `direction` meets a triangle.
  bool is_hit(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const;

 private:
  struct Tree;
  std::unique_ptr<Tree> tree_;
};

/// Nearest-point queries on line segments (borders and creases).
class CurveIndex {
 public:
  /// @pre indices in range; no segment at all is allowed
  CurveIndex(const std::vector<Eigen::Vector3d>& points, const std::vector<std::array<int, 2>>& segments);
  ~CurveIndex();
  CurveIndex(CurveIndex&&) noexcept;
  CurveIndex& operator=(CurveIndex&&) noexcept;

  bool empty() const;
  /// @pre not empty()
  Eigen::Vector3d closest(const Eigen::Vector3d& query) const;

 private:
  struct Tree;
  std::unique_ptr<Tree> tree_;
};

/// Surfaces that are nearer to each other touch and do not pass through each other.
inline constexpr double kContactRoundingMm = 1e-9;

/// Triangles of one mesh and of another that have a point in common, decided with exact predicates; sorted. Those that
/// reach no deeper than kContactRoundingMm are left out.
/// Pairs that share a vertex with bit-equal coordinates touch on purpose and are left out unless they also
/// cross away from it.
std::vector<std::pair<int, int>> crossing_triangles(const std::vector<Eigen::Vector3d>& points_a,
                                                    const std::vector<std::array<int, 3>>& triangles_a,
                                                    const std::vector<Eigen::Vector3d>& points_b,
                                                    const std::vector<std::array<int, 3>>& triangles_b);

}  // namespace interglow::mesh
