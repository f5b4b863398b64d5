// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/blockers.h"

#include <gtest/gtest.h>

#include "radiosity/element_tree.h"
#include "tests/radiosity/scenes.h"

namespace interglow::radiosity {
namespace {

using Eigen::Vector3d;
using testing::cube;
using testing::object;

Blockers blockers_of(mesh::PatchMesh patches) {
  scene::Scene scene;
  scene.objects.push_back(object("one", std::move(patches)));
  const Elements elements = make_elements(scene);
  return make_blockers(elements, ElementTree(elements).flat());
}

// The points of its faces are computed face by face and differ by rounding where faces meet.
TEST(Blockers, ATurnedCubeIsOneBodyOfSixFaces) {
  for (const double turn : {0.1, 0.3, 0.7, 1.1, 1.9, 2.3}) {
    for (const int n : {1, 4, 10}) {
      const Blockers blockers = blockers_of(cube(30.0, n, false, Vector3d(31, 35, 25), turn));
      ASSERT_EQ(blockers.body.size(), 1u) << turn << " " << n;
      EXPECT_TRUE(blockers.body[0].solid);
      EXPECT_EQ(blockers.body[0].face.size(), 6u);
      EXPECT_EQ(blockers.body[0].edge.size(), 12u);
    }
  }
}

// Each face by itself blocks nothing of a scene that lies on one side of it.
TEST(Blockers, ABoxSeenFromWithinHidesNothing) {
  EXPECT_TRUE(blockers_of(cube(30.0, 3, true, Vector3d(31, 35, 25), 0.7)).body.empty());
}

TEST(Blockers, PointsFartherApartThanRoundingStayApart) {
  mesh::PatchMesh patches = cube(1.0, 1, false);
  for (Vector3d& p : patches.points) p.z() *= 1e-9;  // a wafer whose two sides are not to become one
  const Blockers blockers = blockers_of(patches);
  ASSERT_EQ(blockers.body.size(), 1u);
  EXPECT_EQ(blockers.body[0].vertex.size(), 8u);
}

}  // namespace
}  // namespace interglow::radiosity
