// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/visible_part.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace interglow::radiosity {
namespace {

using Eigen::Vector3d;

/// Where the line from a (height > 0) to b (height < 0) crosses height 0; the same double for both directions of
/// travel.
Vector3d crossing(const Vector3d& a, double height_a, const Vector3d& b, double height_b) {
  return (a * -height_b + b * height_a) / (height_a - height_b);
}

/// Keeps the part of a convex outline with normal · x >= offset.
void keep_above(const std::vector<Vector3d>& in, const Vector3d& normal, double offset, std::vector<Vector3d>& out) {
  out.clear();
  for (std::size_t k = 0; k < in.size(); ++k) {
    const Vector3d& a = in[k];
    const Vector3d& b = in[(k + 1) % in.size()];
    const double height_a = normal.dot(a) - offset;
    const double height_b = normal.dot(b) - offset;
    if (height_a >= 0.0) out.push_back(a);
    if (height_a > 0.0 && height_b < 0.0) out.push_back(crossing(a, height_a, b, height_b));
    if (height_a < 0.0 && height_b > 0.0) out.push_back(crossing(b, height_b, a, height_a));
  }
}

}  // namespace

void VisiblePart::cut(const Fragment& fragment, const Vector3d& plane, Fragment* inside, Fragment* outside) {
  if (inside != nullptr) inside->corners = 0;
  if (outside != nullptr) outside->corners = 0;
  const auto keep = [](Fragment* to, const Vector3d& v) {
    if (to != nullptr) to->corner[static_cast<std::size_t>(to->corners++)] = v;
  };
  std::array<double, Fragment::kMost + 4> height;
  const auto n = static_cast<std::size_t>(fragment.corners);
  for (std::size_t k = 0; k < n; ++k) height[k] = plane.dot(fragment.corner[k]);
  for (std::size_t k = 0; k < n; ++k) {
    const std::size_t next = k + 1 < n ? k + 1 : 0;
    const Vector3d& a = fragment.corner[k];
    if (height[k] >= 0.0) keep(inside, a);
    if (height[k] <= 0.0) keep(outside, a);
    if ((height[k] > 0.0 && height[next] < 0.0) || (height[k] < 0.0 && height[next] > 0.0)) {
      const Vector3d& b = fragment.corner[next];
      const Vector3d c =
          height[k] > 0.0 ? crossing(a, height[k], b, height[next]) : crossing(b, height[next], a, height[k]);
      keep(inside, c);
      keep(outside, c);
    }
  }
}

double VisiblePart::contour(const Fragment& fragment, const Vector3d& normal) {
  double sum = 0.0;
  const auto n = static_cast<std::size_t>(fragment.corners);
  for (std::size_t k = 0; k < n; ++k) {
    const Vector3d& a = fragment.corner[k];
    const Vector3d& b = fragment.corner[k + 1 < n ? k + 1 : 0];
    const Vector3d across = a.cross(b);
    const double length = across.norm();
    if (length > 0.0) sum += normal.dot(across) / length * std::atan2(length, a.dot(b));
  }
  // Seen from the point a polygon runs counter-clockwise, about the reversed normal.
  return std::max(0.0, -sum / (2.0 * std::numbers::pi));
}

bool VisiblePart::shadow_cone(BlockerOutline blocker, const Vector3d& point, const Vector3d& plane) {
  clipped_.clear();
  bool within = true;
  for (const Vector3d& corner : blocker) {
    clipped_.push_back(corner - point);
    const double depth = plane.dot(clipped_.back());
    within = within && depth >= 0.0 && depth <= 1.0;
  }
  if (!within) {
    // `plane` is scaled so that the point has depth 0 and the polygon's plane depth 1.
    keep_above(clipped_, plane, 0.0, clipped_again_);
    keep_above(clipped_again_, -plane, -1.0, clipped_);
  }
  const std::size_t n = clipped_.size();
  if (n < 3) return false;
  Vector3d area = Vector3d::Zero();
  for (std::size_t k = 2; k < n; ++k) area += (clipped_[k - 1] - clipped_[0]).cross(clipped_[k] - clipped_[0]);
  const double side = area.dot(clipped_[0]);
  // Seen edge on (to rounding) it covers nothing.
  if (!(std::abs(side) > 1e-15 * area.norm() * clipped_[0].norm())) return false;
  cone_.clear();
  for (std::size_t k = 0; k < n; ++k) {
    const Vector3d inward = clipped_[k].cross(clipped_[(k + 1) % n]);
    if (inward.squaredNorm() > 0.0) cone_.push_back(side > 0.0 ? inward : Vector3d(-inward));
  }
  return true;
}

void VisiblePart::subtract_cone(const Fragment& fragment) {
  for (const Vector3d& plane : cone_) {
    double highest = -1.0;
    for (int k = 0; k < fragment.corners; ++k)
      highest = std::max(highest, plane.dot(fragment.corner[static_cast<std::size_t>(k)]));
    if (highest <= 0.0) {
      remaining_.push_back(fragment);
      return;
    }
  }
  Fragment rest = fragment;
  Fragment inside;
  for (const Vector3d& plane : cone_) {
    if (rest.corners > Fragment::kMost) {  // too many corners for one fragment: two halves
      Fragment half = rest;
      const int middle = rest.corners / 2;
      half.corners = middle + 1;
      rest.corners = rest.corners - middle + 1;
      std::copy(half.corner.begin() + middle, half.corner.begin() + middle + rest.corners - 1, rest.corner.begin() + 1);
      rest.corner[0] = half.corner[0];
      subtract_cone(half);
    }
    remaining_.emplace_back();
    cut(rest, plane, &inside, &remaining_.back());
    if (remaining_.back().corners < 3) remaining_.pop_back();
    if (inside.corners < 3) return;
    rest = inside;
  }
}

SeenShare VisiblePart::seen(const Vector3d& point, const Vector3d& normal, const Polygon& source,
                            std::span<const BlockerOutline> blockers) {
  Fragment whole;
  whole.corners = source.corners;
  for (std::size_t k = 0; k < static_cast<std::size_t>(source.corners); ++k) whole.corner[k] = source.corner[k] - point;
  Vector3d area = Vector3d::Zero();
  for (std::size_t k = 2; k < static_cast<std::size_t>(source.corners); ++k) {
    area += (source.corner[k - 1] - source.corner[0]).cross(source.corner[k] - source.corner[0]);
  }
  const double height = area.dot(whole.corner[0]);
  if (!(height < 0.0)) return {};
  Fragment above;
  cut(whole, normal, &above, nullptr);
  if (above.corners < 3) return {};
  SeenShare result;
  result.whole = contour(above, normal);
  const Vector3d plane = area / height;
  fragments_.clear();
  fragments_.push_back(above);
  bool touched = false;
  for (const BlockerOutline& blocker : blockers) {
    if (!shadow_cone(blocker, point, plane)) continue;
    touched = true;
    remaining_.clear();
    for (const Fragment& fragment : fragments_) subtract_cone(fragment);
    fragments_.swap(remaining_);
    if (fragments_.empty()) return result;
  }
  if (!touched) {
    result.visible = result.whole;
    return result;
  }
  for (const Fragment& fragment : fragments_) result.visible += contour(fragment, normal);
  result.visible = std::min(result.visible, result.whole);
  return result;
}

}  // namespace interglow::radiosity
