// SPDX-License-Identifier: GPL-3.0-or-later
#include "rendering/gather.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "mesh/subdivide.h"
#include "shapes.h"

namespace interglow::rendering {
namespace {

using Eigen::Vector3d;
using test::cavity;
using test::level_square;

/// Irradiance at points of a scene whose object k radiates B_k.
struct Bench {
  radiosity::Elements elements;
  radiosity::Visibility visibility;
  Gatherer gatherer;

  Bench(const scene::Scene& scene, const std::vector<double>& object_radiosity, double tolerance)
      : elements(radiosity::make_elements(scene)),
        visibility(elements.faces),
        gatherer(elements, visibility, source(object_radiosity), source(object_radiosity).col(0), tolerance) {}

  radiosity::RowMatrix source(const std::vector<double>& object_radiosity) const {
    radiosity::RowMatrix values(elements.size(), 1);
    for (Eigen::Index e = 0; e < elements.size(); ++e) {
      values(e, 0) = elements.back[static_cast<std::size_t>(e)]
                         ? 0.0
                         : object_radiosity[static_cast<std::size_t>(elements.object[static_cast<std::size_t>(e)])];
    }
    return values;
  }
  double at(const Vector3d& position, const Vector3d& normal, int face = -1) const {
    double value = 0.0;
    gatherer.irradiance({position, normal, face}, &value);
    return value;
  }
};

scene::Scene scene_of(const std::vector<mesh::PatchMesh>& meshes) {
  scene::Scene scene;
  for (const mesh::PatchMesh& mesh : meshes) {
    scene::Object object;
    object.patches = mesh;
    scene.objects.push_back(object);
  }
  return scene;
}

/// Share of the flux of a surface element that reaches a parallel rectangle a x b at distance c, straight above a
/// corner (Howell, configuration factor B-3).
double corner_factor(double a, double b, double c) {
  const double x = a / c;
  const double y = b / c;
  const double rx = std::sqrt(1 + x * x);
  const double ry = std::sqrt(1 + y * y);
  return (x / rx * std::atan(y / rx) + y / ry * std::atan(x / ry)) / (2 * std::numbers::pi);
}

TEST(Gather, ClosedCavityOfUniformRadiosityGivesThatRadiosity) {
  // Σ_j K(x, j) = 1 inside a closed surface, at the middle, near edges and near corners.
  const scene::Scene scene = scene_of({mesh::subdivide(cavity(10.0), 1.0)});
  for (const double tolerance : {1e-2, 1e-3, 1e-4}) {
    const Bench bench(scene, {1.0}, tolerance);
    for (const Vector3d& p : {Vector3d(5, 5, 0), Vector3d(3.3, 7.1, 0), Vector3d(0.001, 4.2, 0),
                              Vector3d(0.002, 0.001, 0), Vector3d(9.9, 9.7, 0)}) {
      EXPECT_NEAR(bench.at(p, Vector3d::UnitZ()), 1.0, tolerance) << p.transpose() << " tolerance " << tolerance;
    }
  }
}

TEST(Gather, ParallelSquareMeetsTheClosedForm) {
  for (const double part : {4.0, 0.5, 0.1}) {
    const scene::Scene scene = scene_of({mesh::subdivide(level_square(2.0, 1.0, false), part)});
    for (const double tolerance : {1e-3, 1e-5}) {
      const Bench bench(scene, {1.0}, tolerance);
      EXPECT_NEAR(bench.at({0, 0, 0}, Vector3d::UnitZ()), 4 * corner_factor(2, 2, 1), tolerance) << part;
      EXPECT_NEAR(bench.at({-2, -2, 0}, Vector3d::UnitZ()), corner_factor(4, 4, 1), tolerance) << part;
      EXPECT_EQ(bench.at({0, 0, 0}, -Vector3d::UnitZ()), 0.0);
      EXPECT_EQ(bench.at({0, 0, 2}, -Vector3d::UnitZ()), 0.0) << "the back of a one-sided square is dark";
    }
  }
}

TEST(Gather, HorizonCutsWhatLiesBehind) {
  // A wall through the horizon: half of a square standing on z = 0 seen from a level element = a square of half the
  // height, for which the perpendicular configuration factor holds (Howell B-4): element at distance c from the wall's
  // lower edge, opposite a corner.
  const double a = 3.0;  // width
  const double b = 2.0;  // height
  const double c = 1.0;
  const double y = b / c;
  const double x = a / c;
  const double expected =
      (std::atan(x) - 1 / std::sqrt(y * y + 1) * std::atan(x / std::sqrt(y * y + 1))) / (2 * std::numbers::pi);
  const mesh::PatchMesh wall = test::quad({c, 0, -b}, {c, 0, b}, {c, a, b}, {c, a, -b});
  for (const double part : {10.0, 0.7}) {
    const Bench bench(scene_of({mesh::subdivide(wall, part)}), {1.0}, 1e-5);
    EXPECT_NEAR(bench.at({0, 0, 0}, Vector3d::UnitZ()), expected, 1e-5) << part;
  }
}

TEST(Gather, BlockerHidesItsShadow) {
  // A square of half-side 1/4 at half the height hides the middle square of half-side 1/2 of the source above.
  const double expected = 4 * (corner_factor(1, 1, 2) - corner_factor(0.5, 0.5, 2));
  for (const double part : {2.0, 0.3, 0.05}) {
    const scene::Scene scene =
        scene_of({mesh::subdivide(level_square(1.0, 2.0, false), part), level_square(0.25, 1.0, true)});
    double last = 1.0;
    for (const double tolerance : {1e-2, 1e-3, 1e-4}) {
      const Bench bench(scene, {1.0, 0.0}, tolerance);
      const double error = std::abs(bench.at({0, 0, 0}, Vector3d::UnitZ()) - expected);
      EXPECT_LT(error, tolerance) << part;
      last = error;
    }
    EXPECT_LT(last, 1e-4);
  }
}

TEST(Gather, ScalesWithTheScene) {
  // Lengths do not matter: the same bits after scaling by a power of two, and the same value within the tolerance (the
  // blocker search rounds to single precision, which may move a ray across an edge) after scaling to nanometres and
  // kilometres.
  const double tolerance = 1e-3;
  double reference = 0.0;
  for (const double scale : {1.0, std::exp2(-20), std::exp2(20), 1e-6, 1e6}) {
    mesh::PatchMesh box = mesh::subdivide(cavity(10.0), 1.0);
    mesh::PatchMesh ball = test::smooth_sphere(2.0, 2);
    for (Vector3d& p : ball.points) p = scale * (p + Vector3d(5, 5, 5));
    for (Vector3d& p : box.points) p *= scale;
    const Bench bench(scene_of({box, ball}), {1.0, 0.3}, tolerance);
    const double value = bench.at(scale * Vector3d(4, 6, 0), Vector3d::UnitZ());
    if (scale == 1.0) reference = value;
    if (std::exp2(std::round(std::log2(scale))) == scale) {
      EXPECT_EQ(value, reference) << scale;
    } else {
      EXPECT_NEAR(value, reference, tolerance) << scale;
    }
  }
}

TEST(Gather, PointWhereSurfacesMeetIsTouched) {
  // Two walls of a groove that share an edge; a point of that edge, and one in the open.
  mesh::PatchMesh groove;
  groove.points = {{0, -1, 0}, {0, 1, 0}, {-1, 1, 1}, {-1, -1, 1}, {1, -1, 1}, {1, 1, 1}};
  groove.faces = {{0, 1, 2, 3}, {0, 4, 5, 1}};
  const Bench bench(scene_of({groove}), {1.0}, 1e-3);
  const Vector3d normal = Vector3d(1, 0, 1).normalized();
  EXPECT_LE(bench.gatherer.gap({Vector3d(0, 0.5, 0), normal, 0}, 1e-3, 1e-3, 1.0 - 1e-6).value_or(1.0), 1e-15);
  EXPECT_FALSE(bench.gatherer.gap({Vector3d(-0.5, 0.5, 0.5), normal, 0}, 1e-3, 1e-3, 1.0 - 1e-6).has_value());
}

TEST(Gather, SurfaceThatEndsBeforeAnotherMeetsIt) {
  // A sheet stands upright, 0.01 above a floor: at its foot the gap is that wide. A roof at the same distance above a
  // point of the floor runs along it, and meets it only from nearer.
  mesh::PatchMesh floor;
  floor.points = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
  floor.faces = {{0, 1, 2, 3}};
  mesh::PatchMesh sheet;
  sheet.points = {{0, -1, 0.01}, {0, 1, 0.01}, {0, 1, 1}, {0, -1, 1}};
  sheet.faces = {{0, 1, 2, 3}};
  const Bench upright(scene_of({floor, sheet}), {1.0, 1.0}, 1e-3);
  const SurfacePoint foot{Vector3d(0, 0.5, 0.01), Vector3d::UnitX(), 1};
  EXPECT_NEAR(upright.gatherer.gap(foot, 0.02, 1e-3, 1.0 - 1e-6).value_or(0.0), 0.01, 1e-15);
  EXPECT_FALSE(upright.gatherer.gap(foot, 0.005, 1e-3, 1.0 - 1e-6).has_value());
  mesh::PatchMesh roof = floor;
  for (Vector3d& point : roof.points) point.z() = 0.01;
  std::swap(roof.faces[0][1], roof.faces[0][3]);
  const Bench flat(scene_of({floor, roof}), {1.0, 1.0}, 1e-3);
  const SurfacePoint below{Vector3d(0.1, 0.2, 0), Vector3d::UnitZ(), 0};
  EXPECT_FALSE(flat.gatherer.gap(below, 0.02, 1e-3, 1.0 - 1e-6).has_value());
  EXPECT_TRUE(flat.gatherer.gap(below, 0.02, 0.011, 1.0 - 1e-6).has_value());
}

}  // namespace
}  // namespace interglow::rendering
