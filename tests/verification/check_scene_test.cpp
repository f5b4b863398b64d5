// SPDX-License-Identifier: GPL-3.0-or-later
#include "verification/check_scene.h"

#include <gtest/gtest.h>

namespace interglow::verification {
namespace {

/// A unit cube of quads, its top of two triangles.
mesh::PatchMesh cube() {
  mesh::PatchMesh mesh;
  for (int i = 0; i < 8; ++i) mesh.points.emplace_back(i & 1, (i >> 1) & 1, i >> 2);
  mesh.faces = {{0, 2, 3, 1}, {4, 5, 7, -1}, {4, 7, 6, -1}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  mesh.closed = true;
  return mesh;
}

TEST(CheckScene, HalvedPatchesAreTheSameClosedSurface) {
  const mesh::PatchMesh coarse = cube();
  ASSERT_TRUE(mesh::is_closed(coarse));
  const mesh::PatchMesh fine = halved(coarse);
  EXPECT_EQ(fine.faces.size(), 4 * coarse.faces.size());
  EXPECT_TRUE(mesh::is_closed(fine));
  EXPECT_NEAR(mesh::total_area(fine), 6.0, 1e-12);
  for (std::size_t f = 0; f < fine.faces.size(); ++f) {
    const Eigen::Vector3d part = mesh::vector_area(fine, fine.faces[f]);
    const Eigen::Vector3d whole = mesh::vector_area(coarse, coarse.faces[f / 4]);
    EXPECT_LE((4.0 * part - whole).norm(), 1e-12) << "face " << f;
  }
}

TEST(CheckScene, KeepsTheViewAndDropsSmoothNormals) {
  scene::Scene scene;
  scene.objects.push_back({.name = "cube", .patches = cube()});
  scene.objects[0].patches.corner_normals.resize(7);
  scene.camera.width = 600;
  scene.camera.height = 400;
  const scene::Scene flat = check_scene(scene, 96);
  EXPECT_EQ(flat.camera.width, 96);
  EXPECT_EQ(flat.camera.height, 64);
  EXPECT_TRUE(flat.objects[0].patches.corner_normals.empty());
  EXPECT_EQ(check_scene(scene, 1000).camera.width, 600) << "a picture is never enlarged";
}

}  // namespace
}  // namespace interglow::verification
