// SPDX-License-Identifier: GPL-3.0-or-later
#include "rendering/surface.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace interglow::rendering {

using Eigen::Vector3d;

Surface::Surface(const scene::Scene& scene, const radiosity::Elements& elements) : elements_(&elements) {
  int first = 0;
  for (const scene::Object& object : scene.objects) {
    corner_normals_.push_back(object.patches.corner_normals.empty() ? nullptr : &object.patches.corner_normals);
    first_face_.push_back(first);
    first += static_cast<int>(object.patches.faces.size());
  }
  smallest_face_mm_ = std::numeric_limits<double>::infinity();
  for (int face = 0; face < face_count(); ++face) {
    const int count = mesh::corner_count(faces().corners[static_cast<std::size_t>(face)]);
    double size = 0.0;
    for (int i = 0; i < count; ++i) {
      for (int j = 0; j < i; ++j) size = std::max(size, (corner(face, i) - corner(face, j)).norm());
    }
    face_size_mm_.push_back(size);
    smallest_face_mm_ = std::min(smallest_face_mm_, size);
  }
}

Vector3d Surface::face_normal(int face) const {
  return elements_->normal.row(elements_->front_element[static_cast<std::size_t>(face)]);
}

Vector3d Surface::meet(int face, const Vector3d& origin, const Vector3d& direction) const {
  const Vector3d normal = face_normal(face);
  const double slope = normal.dot(direction);
  if (std::abs(slope) < 1e-12 * direction.norm()) return corner(face, 0);  // no better than rounding
  return origin + normal.dot(corner(face, 0) - origin) / slope * direction;
}

FacePoint Surface::locate(int face, const Vector3d& position) const {
  const Vector3d normal = face_normal(face);
  FacePoint best;
  double best_least = 0.0;
  for (int half = 0; half < triangles(face); ++half) {
    const auto [a, b, c] = corners(half);
    const Vector3d& pa = corner(face, a);
    const Vector3d& pb = corner(face, b);
    const Vector3d& pc = corner(face, c);
    Vector3d w(normal.dot((pb - position).cross(pc - position)), normal.dot((pc - position).cross(pa - position)),
               normal.dot((pa - position).cross(pb - position)));
    w /= normal.dot((pb - pa).cross(pc - pa));
    const double least = w.minCoeff();
    if (half == 0 || least > best_least) {
      best_least = least;
      best.half = half;
      best.weights = w;
    }
  }
  best.weights = best.weights.cwiseMax(0.0);
  best.weights /= best.weights.sum();
  return best;
}

SurfacePoint Surface::point(int face, bool back, const FacePoint& at) const {
  const auto [a, b, c] = corners(at.half);
  const std::array<int, 3> corner_of{a, b, c};
  SurfacePoint result;
  result.face = face;
  result.position = at.weights[0] * corner(face, a) + at.weights[1] * corner(face, b) + at.weights[2] * corner(face, c);
  const auto o = static_cast<std::size_t>(object(face));
  const double side = back ? -1.0 : 1.0;
  if (!corner_normals_[o]) {
    result.normal = side * face_normal(face);
    return result;
  }
  const auto& normals = (*corner_normals_[o])[static_cast<std::size_t>(face - first_face_[o])];
  Vector3d lift = Vector3d::Zero();
  Vector3d normal = Vector3d::Zero();
  for (int k = 0; k < 3; ++k) {
    const int which = corner_of[static_cast<std::size_t>(k)];
    const Vector3d n = side * normals[static_cast<std::size_t>(which)];
    normal += at.weights[k] * n;
    lift += at.weights[k] * std::max(0.0, n.dot(corner(face, which) - result.position)) * n;
  }
  result.position += lift;
  result.normal = normal.normalized();
  return result;
}

}  // namespace interglow::rendering
