// SPDX-License-Identifier: GPL-3.0-or-later
// Motions into themselves of bodies whose symmetries are known.
#include "fitting/slippage.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "fit_scenes.h"

namespace interglow::fitting {
namespace {

using Eigen::Vector3d;

Vector3d around(double radius, int i, int of, double z) {
  const double angle = 2.0 * std::numbers::pi * i / of;
  return {radius * std::cos(angle), radius * std::sin(angle), z};
}

scene::Scene scene_of(const mesh::PatchMesh& mesh) {
  scene::Scene scene = test::single_plane({.around = 1, .along = 1, .bands = 2, .side_px = 4});
  scene.objects[0].patches = mesh;
  return scene;
}

/// A wheel of triangles: a polygon of `sides` in the plane z = 3 mm.
mesh::PatchMesh disc(int sides) {
  mesh::PatchMesh mesh;
  mesh.points.push_back({0, 0, 3});
  for (int i = 0; i < sides; ++i) mesh.points.push_back(around(30.0, i, sides, 3.0));
  for (int i = 0; i < sides; ++i) mesh.faces.push_back({0, 1 + i, 1 + (i + 1) % sides, -1});
  return mesh;
}

TEST(Slippage, ARoundDiscTurnsAboutItsNormalAndASquareDoesNot) {
  const Slippage round = slippage(scene_of(disc(32)), Vector3d(5, -4, 0));
  ASSERT_EQ(round.slips.size(), 1U);
  EXPECT_LT(round.slips[0].turn.normalized().cross(Vector3d::UnitZ()).norm(), 1e-6);
  // The centre stays where it is.
  const Vector3d centre = round.slips[0].turn.cross(Vector3d(0, 0, 3) - Vector3d(5, -4, 0)) + round.slips[0].shift;
  EXPECT_LT(centre.norm(), 1e-6);
  EXPECT_EQ(slippage(scene_of(disc(4)), Vector3d::Zero()).slips.size(), 0U);
}

TEST(Slippage, AnOpenTubeTurnsAboutItsAxisAlone) {
  // Without normals of its own: means over facets of 15 degrees are those of the cylinder.
  mesh::PatchMesh mesh;
  constexpr int kSides = 24;
  for (int i = 0; i < kSides; ++i) {
    mesh.points.push_back(around(10.0, i, kSides, 0.0));
    mesh.points.push_back(around(10.0, i, kSides, 40.0));
  }
  for (int i = 0; i < kSides; ++i) {
    const int next = (i + 1) % kSides;
    mesh.faces.push_back({2 * i, 2 * next, 2 * next + 1, 2 * i + 1});
  }
  const Slippage tube = slippage(scene_of(mesh), Vector3d(0, 0, 20));
  ASSERT_EQ(tube.slips.size(), 1U);  // the borders hold it along the axis
  EXPECT_EQ(tube.body, "a body of revolution about the axis (0.00, 0.00, 1.00)");
}

TEST(Slippage, HalfCylindersAndAnArchOnAPlaneDoNotSlip) {
  EXPECT_TRUE(slippage(test::half_cylinders({.around = 12, .along = 6}), Vector3d::Zero()).slips.empty());
  EXPECT_TRUE(slippage(test::arch_on_plane({.around = 12, .along = 6}), Vector3d::Zero()).slips.empty());
}

}  // namespace
}  // namespace interglow::fitting
