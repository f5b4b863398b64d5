// SPDX-License-Identifier: GPL-3.0-or-later
#include "rendering/camera_rays.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "diagnostics/error.h"

namespace interglow::rendering {

std::optional<Eigen::Vector2d> CameraRays::project(const Eigen::Vector3d& point) const {
  const Eigen::Vector3d to = point - origin;
  const double depth = forward.dot(to);
  if (!(depth > 0.0)) return std::nullopt;
  return Eigen::Vector2d(0.5 * width * (1.0 + across.dot(to) / (across.squaredNorm() * depth)),
                         0.5 * height * (1.0 - upward.dot(to) / (upward.squaredNorm() * depth)));
}

CameraRays camera_rays(const scene::Camera& camera) {
  if (camera.width < 1 || camera.height < 1) {
    throw InvalidParams(
        fmt::format("camera: size {} x {} pixels, expected at least 1 x 1.", camera.width, camera.height));
  }
  if (!(camera.horizontal_fov_deg > 0.0 && camera.horizontal_fov_deg < 180.0)) {
    throw InvalidParams(
        fmt::format("camera: horizontal_fov_deg is {}, expected a value in (0, 180).", camera.horizontal_fov_deg));
  }
  const Eigen::Vector3d view = camera.target - camera.position;
  const Eigen::Vector3d right = view.cross(camera.up);
  // A cross product below a few roundings of its factors has no direction.
  if (!(view.norm() > 0.0) || !(right.norm() > 1e-12 * view.norm() * camera.up.norm())) {
    throw InvalidParams(
        fmt::format("camera: up ({}, {}, {}) is parallel to the viewing direction ({}, {}, {}). Choose another up.",
                    camera.up.x(), camera.up.y(), camera.up.z(), view.x(), view.y(), view.z()));
  }
  CameraRays rays;
  rays.origin = camera.position;
  rays.forward = view.normalized();
  rays.width = camera.width;
  rays.height = camera.height;
  const double h = std::tan(0.5 * camera.horizontal_fov_deg * std::numbers::pi / 180.0);
  rays.across = h * right.normalized();
  rays.upward = (h * camera.height / camera.width) * right.normalized().cross(rays.forward);
  return rays;
}

}  // namespace interglow::rendering
