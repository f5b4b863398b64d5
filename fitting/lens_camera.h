// SPDX-License-Identifier: GPL-3.0-or-later
/// A camera with the freedom that a fit needs: pose about a pivot, focal length, principal point, radial distortion.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "scene/scene.h"

namespace interglow::fitting {

/// Camera axes: x right, y down, z forward. With p = rotation (point - pivot) + pivot_in_camera, r² = (p_x² + p_y²) /
/// p_z²:
///   column = principal_x + focal (1 + distortion r²) p_x / p_z,   row likewise with p_y.
/// Pixel (i, j) covers rows [i, i + 1) and columns [j, j + 1).
struct LensCamera {
  static constexpr int kParameters = 10;

  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< camera from world
  Eigen::Vector3d pivot = Eigen::Vector3d::Zero();         ///< in the world [mm]; not fitted
  Eigen::Vector3d pivot_in_camera{0.0, 0.0, 1.0};          ///< [mm]
  double focal_px = 1.0;
  Eigen::Vector2d principal_px = Eigen::Vector2d::Zero();
  double distortion = 0.0;  ///< radial term k1
  int width = 0;
  int height = 0;

  /// Column, row and 1 / depth [1/mm]; nothing if the point is not in front of the camera.
  std::optional<Eigen::Vector3d> project(const Eigen::Vector3d& point) const;
  Eigen::Vector3d position() const { return pivot - rotation.transpose() * pivot_in_camera; }
  double horizontal_fov_deg() const;

  /// The camera after a step in the tangent space: rotation about the camera's axes through the pivot [rad], shift of
  /// the pivot in the camera's frame [mm], logarithm of the focal length, principal point [px], distortion.
  LensCamera moved(const Eigen::Matrix<double, kParameters, 1>& step) const;
};

/// @param pivot  a point amid the objects, about which the pose turns
LensCamera lens_camera(const scene::Camera& camera, const Eigen::Vector3d& pivot);

/// The pinhole camera of the same pose and focal length; principal point and distortion are dropped. The bands are
/// those of `like`.
scene::Camera pinhole_camera(const LensCamera& camera, const scene::Camera& like);

/// Root mean square over the points of the distance between where two cameras see them [px].
double reprojection_rms_px(const LensCamera& a, const LensCamera& b, const std::vector<Eigen::Vector3d>& points);

}  // namespace interglow::fitting
