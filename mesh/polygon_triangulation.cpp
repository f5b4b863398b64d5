// SPDX-License-Identifier: GPL-3.0-or-later
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "mesh/polygon_file.h"

namespace interglow::mesh::detail {
namespace {

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

/// Twice the signed area.
double turn(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c) {
  return cross(b - a, c - a);
}

/// The polygon in its mean plane (Newell's normal up), around its first corner.
std::vector<Eigen::Vector2d> flattened(const std::vector<Eigen::Vector3d>& points, const int* corners,
                                       std::size_t count) {
  const Eigen::Vector3d& origin = points[corners[0]];
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  for (std::size_t k = 0; k < count; ++k) {
    normal += (points[corners[k]] - origin).cross(points[corners[(k + 1) % count]] - origin);
  }
  const Eigen::Vector3d up = normal.norm() > 0.0 ? Eigen::Vector3d(normal.normalized()) : Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d u = up.unitOrthogonal();
  const Eigen::Vector3d v = up.cross(u);
  std::vector<Eigen::Vector2d> flat(count);
  for (std::size_t k = 0; k < count; ++k) {
    const Eigen::Vector3d offset = points[corners[k]] - origin;
    flat[k] = {offset.dot(u), offset.dot(v)};
  }
  return flat;
}

/// True if the polygon turns left at every corner and once around in all, so that a fan fits.
bool is_convex(const std::vector<Eigen::Vector2d>& flat) {
  double whole_turn = 0.0;
  for (std::size_t k = 0; k < flat.size(); ++k) {
    const Eigen::Vector2d before = flat[(k + 1) % flat.size()] - flat[k];
    const Eigen::Vector2d after = flat[(k + 2) % flat.size()] - flat[(k + 1) % flat.size()];
    const double left = cross(before, after);
    // A straight corner would make a fan triangle without area.
    if (!(left > 1e-9 * before.norm() * after.norm())) return false;
    whole_turn += std::atan2(left, before.dot(after));
  }
  return whole_turn < 3.0 * M_PI;  // 2 pi; a star that goes round twice has 4 pi
}

/// Clips the ear with the largest smallest angle first, so that no sliver is made where a better one can be had.
void clip_ears(const std::vector<Eigen::Vector2d>& flat, const int* corners,
               std::vector<std::array<int, 3>>& triangles) {
  std::vector<std::size_t> left(flat.size());
  for (std::size_t k = 0; k < left.size(); ++k) left[k] = k;
  const auto ear_quality = [&](std::size_t k) {
    const std::size_t n = left.size();
    const Eigen::Vector2d& a = flat[left[(k + n - 1) % n]];
    const Eigen::Vector2d& b = flat[left[k]];
    const Eigen::Vector2d& c = flat[left[(k + 1) % n]];
    const double area = turn(a, b, c);
    const double longest = std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
    if (!(area > 0.0)) return longest > 0.0 ? area / longest - 1.0 : -1.0;
    for (const std::size_t other : left) {
      const Eigen::Vector2d& p = flat[other];
      if (p == a || p == b || p == c) continue;
      if (turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0) return -1.0;
    }
    return area / longest;
  };
  std::vector<double> quality(left.size());
  const auto best_ear = [&] {
    return static_cast<std::size_t>(std::max_element(quality.begin(), quality.end()) - quality.begin());
  };
  const auto measure_all = [&] {
    for (std::size_t k = 0; k < left.size(); ++k) quality[k] = ear_quality(k);
  };
  measure_all();
  while (left.size() > 3) {
    const std::size_t n = left.size();
    std::size_t best = best_ear();
    if (quality[best] <= 0.0) {
      // A corner clipped meanwhile may have freed the ear that it stood in.
      measure_all();
      best = best_ear();
    }
    if (quality[best] <= 0.0) break;
    triangles.push_back({corners[left[(best + n - 1) % n]], corners[left[best]], corners[left[(best + 1) % n]]});
    left.erase(left.begin() + static_cast<std::ptrdiff_t>(best));
    quality.erase(quality.begin() + static_cast<std::ptrdiff_t>(best));
    const std::size_t m = left.size();
    quality[best % m] = ear_quality(best % m);
    quality[(best + m - 1) % m] = ear_quality((best + m - 1) % m);
  }
  // Three corners are left, or a rest that is not a simple polygon and has no right triangulation.
  for (std::size_t k = 1; k + 1 < left.size(); ++k) {
    triangles.push_back({corners[left[0]], corners[left[k]], corners[left[k + 1]]});
  }
}

}  // namespace

void triangulate_polygon(const std::vector<Eigen::Vector3d>& points, const int* corners, std::size_t count,
                         std::vector<std::array<int, 3>>& triangles) {
  const std::vector<Eigen::Vector2d> flat =
      count > 3 ? flattened(points, corners, count) : std::vector<Eigen::Vector2d>();
  if (count == 3 || is_convex(flat)) {
    for (std::size_t k = 1; k + 1 < count; ++k) triangles.push_back({corners[0], corners[k], corners[k + 1]});
  } else {
    clip_ears(flat, corners, triangles);
  }
}

}  // namespace interglow::mesh::detail
