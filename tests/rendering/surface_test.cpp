// SPDX-License-Identifier: GPL-3.0-or-later
#include "rendering/surface.h"

#include <gtest/gtest.h>

#include "shapes.h"

namespace interglow::rendering {
namespace {

using Eigen::Vector3d;

scene::Scene one_object(const mesh::PatchMesh& mesh) {
  scene::Scene scene;
  scene.objects.resize(1);
  scene.objects[0].patches = mesh;
  return scene;
}

TEST(Surface, LocatesPointsOfAQuad) {
  const scene::Scene scene = one_object(test::quad({0, 0, 0}, {3, 0, 0}, {4, 2, 0}, {1, 2, 0}));
  const radiosity::Elements elements = radiosity::make_elements(scene);
  const Surface surface(scene, elements);
  for (const Vector3d& p :
       {Vector3d(0.5, 0.5, 0), Vector3d(3.0, 0.4, 0), Vector3d(2.0, 1.0, 0), Vector3d(1.2, 1.9, 0)}) {
    EXPECT_LT((surface.point(0, false, surface.locate(0, p)).position - p).norm(), 1e-14) << p.transpose();
  }
  // Outside: the nearest in barycentric coordinates stays within the face.
  EXPECT_GE(surface.locate(0, {-0.1, -0.1, 0}).weights.minCoeff(), 0.0);
}

TEST(Surface, BackLooksTheOtherWay) {
  const scene::Scene scene = one_object(test::smooth_sphere(5.0, 1));
  const radiosity::Elements elements = radiosity::make_elements(scene);
  const Surface surface(scene, elements);
  EXPECT_LT((surface.point(3, false, {}).normal + surface.point(3, true, {}).normal).norm(), 1e-15);
}

TEST(Surface, SmoothPointsLieBetweenFacetAndTangentPlanes) {
  // On a sphere of radius 1 the facet's middle lies at height h < 1; the lift must raise it, and by no more than to the
  // tangent planes at its corners, which meet above the middle at height 1 / h.
  const scene::Scene scene = one_object(test::smooth_sphere(1.0, 3));
  const radiosity::Elements elements = radiosity::make_elements(scene);
  const Surface surface(scene, elements);
  for (int face = 0; face < surface.face_count(); face += 37) {
    const Vector3d middle = (surface.corner(face, 0) + surface.corner(face, 1) + surface.corner(face, 2)) / 3.0;
    const SurfacePoint point = surface.point(face, false, {});
    EXPECT_GT(point.position.norm(), middle.norm());
    EXPECT_LE(point.position.norm(), 1.0 / middle.norm() + 1e-12);
    EXPECT_GT(point.normal.dot(point.position.normalized()), 1.0 - 1e-6);
    // A corner is a point of the surface already.
    EXPECT_LT((surface.point(face, false, {0, Vector3d::UnitY()}).position - surface.corner(face, 1)).norm(), 1e-15);
  }
}

}  // namespace
}  // namespace interglow::rendering
