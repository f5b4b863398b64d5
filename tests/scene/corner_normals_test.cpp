// SPDX-License-Identifier: GPL-3.0-or-later
#include "scene/corner_normals.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace interglow::scene {
namespace {

/// A strip of the unit cylinder about z, `count` quads over a right angle.
mesh::PatchMesh quarter_cylinder(int count) {
  mesh::PatchMesh mesh;
  for (int i = 0; i <= count; ++i) {
    const double angle = 0.5 * std::numbers::pi * i / count;
    for (const double z : {0.0, 1.0}) mesh.points.emplace_back(std::cos(angle), std::sin(angle), z);
  }
  for (int i = 0; i < count; ++i) mesh.faces.push_back({2 * i, 2 * i + 2, 2 * i + 3, 2 * i + 1});
  return mesh;
}

TEST(CornerNormals, AreRadialInsideACylinder) {
  const mesh::PatchMesh mesh = quarter_cylinder(8);
  const auto normals = corner_normals(mesh, 40.0);
  // By symmetry the two faces at an inner line average to the radius exactly.
  for (std::size_t f = 0; f + 1 < mesh.faces.size(); ++f) {
    const Eigen::Vector3d point = mesh.points[static_cast<std::size_t>(mesh.faces[f][1])];
    EXPECT_LT((normals[f][1] - Eigen::Vector3d(point.x(), point.y(), 0.0)).norm(), 1e-14) << "face " << f;
  }
  // At a border the face's own normal is all there is: half a face's turn away from the radius.
  EXPECT_NEAR(std::acos(normals[0][0].x()), std::numbers::pi / 32, 1e-12);
}

TEST(CornerNormals, KeepCreasesSharperThanTheAngle) {
  const mesh::PatchMesh mesh = quarter_cylinder(2);  // faces meet at 45 degrees
  const auto sharp = corner_normals(mesh, 44.0);
  const auto smooth = corner_normals(mesh, 46.0);
  const Eigen::Vector3d first_face = mesh::vector_area(mesh, mesh.faces[0]).normalized();
  EXPECT_LT((sharp[0][1] - first_face).norm(), 1e-15);
  EXPECT_NEAR(std::acos(smooth[0][1].dot(first_face)), std::numbers::pi / 8, 1e-12);
}

TEST(CornerNormals, DoNotDependOnHowFacesAreCut) {
  const mesh::PatchMesh quads = quarter_cylinder(4);
  mesh::PatchMesh triangles = quads;
  triangles.faces.clear();
  for (const mesh::Face& face : quads.faces) {
    triangles.faces.push_back({face[0], face[1], face[2], -1});
    triangles.faces.push_back({face[0], face[2], face[3], -1});
  }
  const auto of_quads = corner_normals(quads, 40.0);
  const auto of_triangles = corner_normals(triangles, 40.0);
  for (std::size_t f = 0; f < quads.faces.size(); ++f) {
    EXPECT_LT((of_quads[f][1] - of_triangles[2 * f][1]).norm(), 1e-14) << "face " << f;
    EXPECT_LT((of_quads[f][2] - of_triangles[2 * f][2]).norm(), 1e-14) << "face " << f;
  }
}

}  // namespace
}  // namespace interglow::scene
