// SPDX-License-Identifier: GPL-3.0-or-later
/// The outline of a convex patch as a point of a surface sees it.
#pragma once

#include <Eigen/Core>
#include <array>

namespace interglow::rendering {

/// Corners from the patch's front. Six are enough for a quad that is clipped at the horizon, and its parts.
struct SeenOutline {
  std::array<Eigen::Vector3d, 6> corner;
  int corners = 0;

  SeenOutline() { corner.fill(Eigen::Vector3d::Zero()); }
};

/// Keeps what lies above the horizon of the point; false if nothing does.
bool clip_at_horizon(const Eigen::Vector3d& position, const Eigen::Vector3d& normal, SeenOutline& outline);

/// Lambert: (1 / 2π) Σ over edges of angle times the normal's share of the edge's plane, in [0, 1].
/// @pre clipped at the horizon
double contour_form_factor(const Eigen::Vector3d& position, const Eigen::Vector3d& normal, const SeenOutline& outline);

}  // namespace interglow::rendering
