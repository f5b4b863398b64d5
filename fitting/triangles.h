// SPDX-License-Identifier: GPL-3.0-or-later
/// The surfaces as triangles that are fine enough for outlines and shadows.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "radiosity/elements.h"
#include "rendering/surface.h"

namespace interglow::fitting {

/// Faces as triangles: a quad is two halves, in the order of rendering::Surface's; a half of a round body is cut into
/// smaller ones that stand for the smooth surface.
struct Triangles {
  std::vector<int> face;
  std::vector<int> half;
  std::vector<std::array<Eigen::Vector3d, 3>> weights;  ///< of the corners in the face's half
  std::vector<std::array<Eigen::Vector3d, 3>> corner;   ///< [mm]
  std::vector<std::array<Eigen::Vector3d, 3>> normal;   ///< unit, of the smooth surface at the corners, front side
  std::vector<Eigen::Vector3d> face_normal;             ///< unit, of the triangle itself
  std::vector<std::array<int, 3>> neighbour;            ///< across edges 01, 12, 20, of the same object; -1: none
  radiosity::Faces faces;                               ///< the triangles as faces, for views of them
  std::size_t size() const { return face.size(); }
};

/// Edges farther than the tolerance from the cubic that is at right angles to the normals at both ends are halved, with
/// the new corner above the cubic's middle by a third of its height: outlines then enclose the same area, and fields of
/// view are not shifted by polygons that lie within round bodies.
/// @param tolerance_mm  above 0; infinite: all stays flat, as do objects without smooth normals
/// Cost O(triangles log triangles).
Triangles make_triangles(const scene::Scene& scene, const radiosity::Elements& elements,
                         const rendering::Surface& surface, double tolerance_mm);

}  // namespace interglow::fitting
