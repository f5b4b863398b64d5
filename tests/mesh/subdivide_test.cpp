// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/subdivide.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "diagnostics/error.h"

namespace interglow::mesh {
namespace {

using Eigen::Vector3d;

PatchMesh tetrahedron() {
  PatchMesh mesh;
  mesh.points = {{0, 0, 0}, {3, 0, 0}, {0, 4, 0}, {1, 1, 5}};
  mesh.faces = {{0, 2, 1, -1}, {0, 1, 3, -1}, {1, 2, 3, -1}, {2, 0, 3, -1}};
  mesh.closed = true;
  return mesh;
}

TEST(Subdivide, TrianglesBecomeCongruentOnesOfTheSameArea) {
  const PatchMesh mesh = tetrahedron();
  PatchMesh one = mesh;
  one.faces.resize(1);  // edges 3, 4, 5
  const PatchMesh parts = subdivide(one, 1.0);
  ASSERT_EQ(parts.faces.size(), 25U);
  EXPECT_NEAR(total_area(parts), 6.0, 1e-12);
  const Vector3d whole = vector_area(one, one.faces[0]);
  for (const Face& face : parts.faces) EXPECT_LT((vector_area(parts, face) - whole / 25.0).norm(), 1e-14);
}

TEST(Subdivide, NeighboursThatAreDividedAlikeShareTheirPoints) {
  // Edges of equal length: all faces are divided alike, so a closed surface stays closed.
  PatchMesh mesh;
  mesh.points = {{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}};
  mesh.faces = {{0, 1, 2, -1}, {0, 2, 3, -1}, {0, 3, 1, -1}, {1, 3, 2, -1}};
  mesh.closed = true;
  const PatchMesh parts = subdivide(mesh, 0.5);
  EXPECT_EQ(parts.faces.size(), 4U * 36U);  // edges of 2 √2 in six parts
  EXPECT_TRUE(is_closed(parts));
}

TEST(Subdivide, QuadsAreDividedByEachSide) {
  PatchMesh mesh;
  mesh.points = {{0, 0, 0}, {4, 0, 0}, {4, 1, 0}, {0, 1, 0}};
  mesh.faces = {{0, 1, 2, 3}};
  mesh.corner_normals = {{Vector3d(0, 0, 1), Vector3d(0, 0, 1), Vector3d(0.6, 0, 0.8), Vector3d(0.6, 0, 0.8)}};
  const PatchMesh parts = subdivide(mesh, 1.0);
  ASSERT_EQ(parts.faces.size(), 4U);
  EXPECT_EQ(parts.points.size(), 10U);
  for (const Face& face : parts.faces) EXPECT_NEAR(vector_area(parts, face).z(), 1.0, 1e-15);
  ASSERT_EQ(parts.corner_normals.size(), 4U);
  for (const auto& normals : parts.corner_normals) {
    for (const Vector3d& normal : normals) EXPECT_NEAR(normal.norm(), 1.0, 1e-15);
  }
  EXPECT_LT((subdivide(mesh, 0.5).corner_normals[0][3] - Vector3d(0.3, 0, 0.9).normalized()).norm(), 1e-15)
      << "half-way up the side";
}

TEST(Subdivide, EdgesAreNoLongerThanAsked) {
  for (const double edge : {10.0, 2.0, 0.37}) {
    const PatchMesh parts = subdivide(tetrahedron(), edge);
    EXPECT_NEAR(total_area(parts), total_area(tetrahedron()), 1e-10);
    for (const Face& face : parts.faces) {
      for (int k = 0; k < 3; ++k) {
        const Vector3d along = parts.points[static_cast<std::size_t>(face[static_cast<std::size_t>(k)])] -
                               parts.points[static_cast<std::size_t>(face[static_cast<std::size_t>((k + 1) % 3)])];
        EXPECT_LE(along.norm(), edge * (1 + 1e-8));
      }
    }
  }
}

TEST(Subdivide, RefusesLengthsThatMakeNoSense) {
  EXPECT_THROW(subdivide(tetrahedron(), 0.0), InvalidParams);
  try {
    subdivide(tetrahedron(), 1e-5);
    FAIL() << "accepted";
  } catch (const InvalidParams& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("edge_length_mm = 1e-05"));
  }
}

}  // namespace
}  // namespace interglow::mesh
