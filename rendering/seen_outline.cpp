// SPDX-License-Identifier: GPL-3.0-or-later
#include "rendering/seen_outline.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace interglow::rendering {

using Eigen::Vector3d;

bool clip_at_horizon(const Vector3d& position, const Vector3d& normal, SeenOutline& outline) {
  std::array<double, 6> height;
  bool below = false;
  bool above = false;
  for (int k = 0; k < outline.corners; ++k) {
    const auto i = static_cast<std::size_t>(k);
    height[i] = normal.dot(outline.corner[i] - position);
    below = below || height[i] < 0.0;
    above = above || height[i] > 0.0;
  }
  if (!below) return above;
  if (!above) return false;
  SeenOutline kept;
  for (int k = 0; k < outline.corners; ++k) {
    const auto i = static_cast<std::size_t>(k);
    const auto j = static_cast<std::size_t>((k + 1) % outline.corners);
    if (height[i] >= 0.0 && kept.corners < 6) kept.corner[static_cast<std::size_t>(kept.corners++)] = outline.corner[i];
    if ((height[i] < 0.0) != (height[j] < 0.0) && kept.corners < 6) {
      const double t = height[i] / (height[i] - height[j]);
      kept.corner[static_cast<std::size_t>(kept.corners++)] =
          outline.corner[i] + t * (outline.corner[j] - outline.corner[i]);
    }
  }
  outline = kept;
  return outline.corners >= 3;
}

double contour_form_factor(const Vector3d& position, const Vector3d& normal, const SeenOutline& outline) {
  double sum = 0.0;
  Vector3d a = outline.corner[static_cast<std::size_t>(outline.corners - 1)] - position;
  for (int k = 0; k < outline.corners; ++k) {
    const Vector3d b = outline.corner[static_cast<std::size_t>(k)] - position;
    const Vector3d cross = a.cross(b);
    const double sine = cross.norm();
    if (sine > 0.0) sum -= normal.dot(cross) / sine * std::atan2(sine, a.dot(b));
    a = b;
  }
  return std::max(0.0, sum * (0.5 / std::numbers::pi));
}

}  // namespace interglow::rendering
