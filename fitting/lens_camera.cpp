// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/lens_camera.h"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "diagnostics/error.h"
#include "rendering/camera_rays.h"

namespace interglow::fitting {

using Eigen::Vector2d;
using Eigen::Vector3d;

std::optional<Vector3d> LensCamera::project(const Vector3d& point) const {
  const Vector3d p = rotation * (point - pivot) + pivot_in_camera;
  // Nearer than a millionth of the distance to the objects is as good as at the camera.
  if (!(p.z() > 1e-6 * std::abs(pivot_in_camera.z()))) return std::nullopt;
  const Vector2d flat = p.head<2>() / p.z();
  const Vector2d place = principal_px + focal_px * (1.0 + distortion * flat.squaredNorm()) * flat;
  return Vector3d(place.x(), place.y(), 1.0 / p.z());
}

double LensCamera::horizontal_fov_deg() const {
  return 2.0 * std::atan(0.5 * width / focal_px) * 180.0 / std::numbers::pi;
}

LensCamera LensCamera::moved(const Eigen::Matrix<double, kParameters, 1>& step) const {
  LensCamera result = *this;
  const Vector3d turn = step.head<3>();
  const double angle = turn.norm();
  if (angle > 0.0) result.rotation = Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix() * rotation;
  result.pivot_in_camera += step.segment<3>(3);
  result.focal_px *= std::exp(step[6]);
  result.principal_px += step.segment<2>(7);
  result.distortion += step[9];
  return result;
}

LensCamera lens_camera(const scene::Camera& camera, const Vector3d& pivot) {
  const rendering::CameraRays rays = rendering::camera_rays(camera);
  LensCamera result;
  result.rotation.row(0) = rays.across.normalized();
  result.rotation.row(1) = -rays.upward.normalized();
  result.rotation.row(2) = rays.forward;
  result.pivot = pivot;
  result.pivot_in_camera = result.rotation * (pivot - camera.position);
  if (!(result.pivot_in_camera.z() > 0.0))
    throw InvalidParams("camera: the middle of the objects is not in front of it. Turn or move the camera.");
  result.focal_px = 0.5 * camera.width / rays.across.norm();
  result.principal_px = {0.5 * camera.width, 0.5 * camera.height};
  result.width = camera.width;
  result.height = camera.height;
  return result;
}

scene::Camera pinhole_camera(const LensCamera& camera, const scene::Camera& like) {
  scene::Camera result = like;
  result.position = camera.position();
  result.target = result.position + camera.pivot_in_camera.z() * camera.rotation.row(2).transpose();
  result.up = -camera.rotation.row(1).transpose();
  result.horizontal_fov_deg = camera.horizontal_fov_deg();
  result.width = camera.width;
  result.height = camera.height;
  return result;
}

double reprojection_rms_px(const LensCamera& a, const LensCamera& b, const std::vector<Vector3d>& points) {
  double sum = 0.0;
  std::size_t count = 0;
  for (const Vector3d& point : points) {
    const auto in_a = a.project(point);
    const auto in_b = b.project(point);
    if (!in_a || !in_b) continue;
    sum += (in_a->head<2>() - in_b->head<2>()).squaredNorm();
    ++count;
  }
  return count > 0 ? std::sqrt(sum / static_cast<double>(count)) : 0.0;
}

}  // namespace interglow::fitting
