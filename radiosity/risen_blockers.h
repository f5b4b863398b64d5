// SPDX-License-Identifier: GPL-3.0-or-later
/// Which obstacles rise high enough above a patch to matter: the neighbours on the same smooth surface do not.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "radiosity/blockers.h"
#include "radiosity/element_tree.h"
#include "radiosity/elements.h"
#include "radiosity/polygon.h"

namespace interglow::radiosity {

/// Whether a convex body lies beside a patch and below a plane through one of its edges or corners that rises outwards
/// by `slope`: whatever line from the patch meets it leaves at no more than that. What lies over the patch, however
/// low, does not.
/// @param body  its vertices
/// @param slack  how far they may be over that plane, and over the patch [mm]
bool lies_low(const Polygon& patch, const Eigen::Vector3d& normal, std::span<const Eigen::Vector3d> body, double slope,
              double slack);

/// Lines that leave a patch at an angle of at most θ above its plane carry a share of at most sin²θ of its flux. A body
/// that nowhere rises by more than θ, seen from the patch, hides no more than that, whatever the number of such bodies;
/// it is left out where sin²θ is a quarter of the wanted row error. So scans whose patches are not quite convex need no
/// occlusion work among neighbours.
class RisenBlockers {
 public:
  /// @param first  position in tree.order() of the first element of each tile, and the end
  /// Memory: tiles × bodies bits. Cost O(elements log bodies) where surfaces are convex, O(elements × bodies) at most.
  /// Same bits for any number of threads.
  RisenBlockers(const Elements& elements, const ElementTree& tree, const Blockers& blockers,
                const std::vector<int>& first, double row_tolerance);

  /// Whether the body rises above some element of the tile.
  bool above_tile(int tile, int body) const {
    return (bits_[static_cast<std::size_t>(tile) * words_ + static_cast<std::size_t>(body) / 64] >> (body % 64) & 1U) !=
           0;
  }
  /// Whether it rises above the element.
  bool above_element(int element, const ConvexBody& body) const;

 private:
  const Elements& elements_;
  const ElementTree& tree_;
  double sine_;
  std::size_t words_;
  std::vector<std::uint64_t> bits_;
};

}  // namespace interglow::radiosity
