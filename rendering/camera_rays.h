// SPDX-License-Identifier: GPL-3.0-or-later
/// Rays through the pixels of a pinhole camera.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "scene/scene.h"

namespace interglow::rendering {

/// The camera's frame; see scene::Camera for the rule.
struct CameraRays {
  Eigen::Vector3d origin;   ///< mm
  Eigen::Vector3d forward;  ///< unit
  Eigen::Vector3d across;   ///< from the middle of the image to its right border, at distance 1 along forward
  Eigen::Vector3d upward;   ///< from the middle of the image to its top border, at distance 1 along forward
  int width = 0;
  int height = 0;

  /// Direction, not normalised: its component along `forward` is 1. @param column, row  in pixels; pixel (i, j) covers
  /// [j, j + 1) x [i, i + 1), row 0 at the top.
  Eigen::Vector3d direction(double column, double row) const {
    return forward + (2.0 * column / width - 1.0) * across + (1.0 - 2.0 * row / height) * upward;
  }
  /// Where a point is seen (column, row), inside the image or not; nothing if it is not in front of the camera.
  std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& point) const;
  /// Side of a pixel at distance 1 along `forward`.
  double pixel_side() const { return 2.0 * across.norm() / width; }
};

/// @throws InvalidParams if the camera looks nowhere, `up` is parallel to the viewing direction, or a size or angle is
/// out of range.
CameraRays camera_rays(const scene::Camera& camera);

}  // namespace interglow::rendering
