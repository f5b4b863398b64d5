// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/risen_blockers.h"

#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace interglow::radiosity {

using Eigen::Vector3d;

bool lies_low(const Polygon& patch, const Vector3d& normal, std::span<const Vector3d> body, double slope,
              double slack) {
  const auto beyond = [&](const Vector3d& outward) {  // of the patch, across its supporting line
    double reach = -std::numeric_limits<double>::infinity();
    for (int k = 0; k < patch.corners; ++k)
      reach = std::max(reach, outward.dot(patch.corner[static_cast<std::size_t>(k)]));
    const double plane = normal.dot(patch.corner[0]);
    return std::all_of(body.begin(), body.end(), [&](const Vector3d& vertex) {
      const double outside = outward.dot(vertex) - reach;
      return outside >= -slack && normal.dot(vertex) - plane <= slack + slope * std::max(outside, 0.0);
    });
  };
  const auto outward_of = [&](int k) -> Vector3d {
    const Vector3d& corner = patch.corner[static_cast<std::size_t>(k)];
    const Vector3d& next = patch.corner[static_cast<std::size_t>((k + 1) % patch.corners)];
    return (next - corner).cross(normal).normalized();
  };
  Vector3d before = outward_of(patch.corners - 1);
  for (int k = 0; k < patch.corners; ++k) {
    const Vector3d outward = outward_of(k), between = (before + outward).normalized();
    if (!outward.isZero(0) && beyond(outward)) return true;
    if (!between.isZero(0) && beyond(between)) return true;
    before = outward;
  }
  return false;
}

RisenBlockers::RisenBlockers(const Elements& elements, const ElementTree& tree, const Blockers& blockers,
                             const std::vector<int>& first, double row_tolerance)
    : elements_(elements),
      tree_(tree),
      sine_(std::sqrt(0.25 * row_tolerance)),
      words_((blockers.body.size() + 63) / 64),
      bits_((first.empty() ? 0 : first.size() - 1) * words_, 0) {
  if (first.size() < 2) return;
  tbb::parallel_for(std::size_t{0}, first.size() - 1, [&](std::size_t tile) {
    std::vector<int> pending;
    for (const BodyTree& bodies : blockers.tree) {
      pending.assign(1, 0);
      while (!pending.empty()) {
        const BodyTree::Node& node = bodies.node[static_cast<std::size_t>(pending.back())];
        pending.pop_back();
        for (int k = first[tile]; k < first[tile + 1]; ++k) {
          const int element = tree.order()[static_cast<std::size_t>(k)];
          if (node.body >= 0) {
            if (!above_element(element, blockers.body[static_cast<std::size_t>(node.body)])) continue;
            bits_[tile * words_ + static_cast<std::size_t>(node.body) / 64] |= std::uint64_t{1} << (node.body % 64);
            break;
          }
          const Vector3d normal = elements.normal.row(element).transpose();
          const Vector3d& origin = tree.polygon(element).corner[0];
          const double highest =
              normal.cwiseProduct(node.box.low - origin).cwiseMax(normal.cwiseProduct(node.box.high - origin)).sum();
          if (highest <= tree.flat()) continue;
          pending.push_back(node.right);
          pending.push_back(node.left);
          break;
        }
      }
    }
  });
}

bool RisenBlockers::above_element(int element, const ConvexBody& body) const {
  const Polygon& polygon = tree_.polygon(element);
  const Vector3d normal = elements_.normal.row(element).transpose();
  const Vector3d& origin = polygon.corner[0];
  const double flat = tree_.flat();
  double highest = 0.0;
  for (const Vector3d& vertex : body.vertex) highest = std::max(highest, normal.dot(vertex - origin));
  if (highest <= flat) return false;
  const Vector3d centre = elements_.centroid.row(element).transpose();
  double radius = 0.0;
  for (int k = 0; k < polygon.corners; ++k) {
    radius = std::max(radius, (polygon.corner[static_cast<std::size_t>(k)] - centre).norm());
  }
  const double gap = (centre.cwiseMax(body.box.low).cwiseMin(body.box.high) - centre).norm() - radius;
  if (gap > 0.0 && highest <= sine_ * gap) return false;
  return !lies_low(polygon, normal, body.vertex, sine_, flat);
}

}  // namespace interglow::radiosity
