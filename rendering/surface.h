// SPDX-License-Identifier: GPL-3.0-or-later
/// Points and normals of the surfaces that the faces stand for.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "radiosity/elements.h"
#include "rendering/gather.h"
#include "scene/scene.h"

namespace interglow::rendering {

/// A point of a face: one of its triangles (a quad has two: corners 0 1 2 and 0 2 3) and barycentric coordinates in it.
struct FacePoint {
  int half = 0;
  Eigen::Vector3d weights{1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0};
};

/// Faces with the smooth surface behind them.
class Surface {
 public:
  /// Keeps references to both.
  Surface(const scene::Scene& scene, const radiosity::Elements& elements);

  const radiosity::Faces& faces() const { return elements_->faces; }
  int face_count() const { return static_cast<int>(faces().corners.size()); }
  int object(int face) const { return faces().object[static_cast<std::size_t>(face)]; }
  bool smooth(int face) const { return corner_normals_[static_cast<std::size_t>(object(face))] != nullptr; }
  /// Unit normal of the face itself, front side.
  Eigen::Vector3d face_normal(int face) const;
  int triangles(int face) const { return mesh::corner_count(faces().corners[static_cast<std::size_t>(face)]) - 2; }
  /// Longest edge or diagonal of a face [mm], and the shortest of these in the scene.
  double face_size_mm(int face) const { return face_size_mm_[static_cast<std::size_t>(face)]; }
  double smallest_face_mm() const { return smallest_face_mm_; }
  /// Corners of the triangles 0 and 1 of a face.
  static std::array<int, 3> corners(int half) {
    return half == 0 ? std::array<int, 3>{0, 1, 2} : std::array<int, 3>{0, 2, 3};
  }
  const Eigen::Vector3d& corner(int face, int k) const {
    return faces()
        .points[static_cast<std::size_t>(faces().corners[static_cast<std::size_t>(face)][static_cast<std::size_t>(k)])];
  }

  /// Where the half-line from `origin` meets the plane of the face; its first corner if it runs along the plane.
  Eigen::Vector3d meet(int face, const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const;
  /// Coordinates of a point of the face, clamped into it.
  FacePoint locate(int face, const Eigen::Vector3d& position) const;

  /// The point of the surface: on a flat object the point of the face and its normal; on a smooth one the interpolated
  /// normal, and the point lifted to the tangent planes at the corners where these stand above it, so that a convex
  /// surface does not shade itself in its facets [hanika2021].
  SurfacePoint point(int face, bool back, const FacePoint& at) const;

 private:
  const radiosity::Elements* elements_;
  std::vector<const std::vector<std::array<Eigen::Vector3d, 4>>*> corner_normals_;  ///< one an object; null: flat
  std::vector<int> first_face_;                                                     ///< of each object
  std::vector<double> face_size_mm_;
  double smallest_face_mm_ = 0.0;
};

}  // namespace interglow::rendering
