// SPDX-License-Identifier: GPL-3.0-or-later
/// What a point sees of a polygon past convex blockers, exactly.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "radiosity/polygon.h"

namespace interglow::radiosity {

/// An opaque, two-sided, planar convex obstacle; its corners are kept by somebody else.
using BlockerOutline = std::span<const Eigen::Vector3d>;

/// Configuration factors of a polygon as a whole and of the part of it that is seen.
struct SeenShare {
  double whole = 0.0;
  double visible = 0.0;  ///< in [0, whole]
};

/// The polygon is cut at the point's horizon; each blocker is cut down to its part between the point and the polygon's
/// plane, its shadow cone taken out of what is left of the polygon, and Lambert's contour formula summed over the
/// remaining convex fragments. Taking the cones out one after another makes overlapping blockers a union.
/// Holds only memory to work in: use one a thread.
class VisiblePart {
 public:
  /// @param normal  unit, of the surface element at `point`
  /// Cost O(blockers × fragments). A point behind or in the plane of `source` sees nothing of it.
  SeenShare seen(const Eigen::Vector3d& point, const Eigen::Vector3d& normal, const Polygon& source,
                 std::span<const BlockerOutline> blockers);

 private:
  struct Fragment {
    static constexpr int kMost = 28;
    int corners = 0;
    std::array<Eigen::Vector3d, kMost + 4> corner;
  };
  bool shadow_cone(BlockerOutline blocker, const Eigen::Vector3d& point, const Eigen::Vector3d& plane);
  void subtract_cone(const Fragment& fragment);
  static void cut(const Fragment& fragment, const Eigen::Vector3d& plane, Fragment* inside, Fragment* outside);
  static double contour(const Fragment& fragment, const Eigen::Vector3d& normal);

  std::vector<Eigen::Vector3d> clipped_, clipped_again_;
  std::vector<Eigen::Vector3d> cone_;  ///< inward normals of the planes through the point and the blocker's edges
  std::vector<Fragment> fragments_, remaining_;
};

}  // namespace interglow::radiosity
