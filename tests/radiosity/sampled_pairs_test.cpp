// SPDX-License-Identifier: GPL-3.0-or-later
// Entries of scenes with many blockers against an independent count: lines between random points of both patches, drawn
// and tested against every triangle here.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>
#include <vector>

#include "radiosity/element_tree.h"
#include "radiosity/form_factor.h"
#include "radiosity/row_error.h"
#include "radiosity/transport_assembly.h"
#include "tests/radiosity/scenes.h"

namespace interglow::radiosity {
namespace {

using Eigen::Vector3d;
using testing::object;

struct Triangle {
  Vector3d a, u, v;
  int face;
};

std::vector<Triangle> triangles_of(const Elements& elements, int first_object) {
  std::vector<Triangle> triangles;
  const Faces& faces = elements.faces;
  for (std::size_t f = 0; f < faces.corners.size(); ++f) {
    if (faces.object[f] < first_object) continue;
    const auto point = [&](std::size_t k) { return faces.points[static_cast<std::size_t>(faces.corners[f][k])]; };
    for (std::size_t k = 2; k < (faces.corners[f][3] < 0 ? 3U : 4U); ++k)
      triangles.push_back({point(0), point(k - 1) - point(0), point(k) - point(0), static_cast<int>(f)});
  }
  return triangles;
}

/// Möller and Trumbore (1997).
bool crosses(const Triangle& triangle, const Vector3d& from, const Vector3d& line) {
  const Vector3d p = line.cross(triangle.v);
  const double volume = triangle.u.dot(p);
  if (volume == 0.0) return false;
  const Vector3d start = from - triangle.a;
  const double u = start.dot(p) / volume;
  if (!(u >= 0.0 && u <= 1.0)) return false;
  const Vector3d q = start.cross(triangle.u);
  const double v = line.dot(q) / volume;
  if (!(v >= 0.0 && u + v <= 1.0)) return false;
  const double t = triangle.v.dot(q) / volume;
  return t > 0.0 && t < 1.0;
}

/// A uniform point of a triangle or parallelogram.
Vector3d point_of(const Polygon& polygon, std::mt19937_64& random) {
  std::uniform_real_distribution<double> uniform;
  double u = uniform(random);
  double v = uniform(random);
  const bool triangle = polygon.corners == 3;
  if (triangle && u + v > 1.0) {
    u = 1.0 - u;
    v = 1.0 - v;
  }
  return polygon.corner[0] + u * (polygon.corner[1] - polygon.corner[0]) +
         v * (polygon.corner[triangle ? 2 : 3] - polygon.corner[0]);
}

struct Count {
  double value;      ///< form factor
  double deviation;  ///< standard deviation
};

/// The unoccluded factor (form_factor, tested elsewhere) times the share of `lines` random lines that arrives, between
/// `from` and the part `to` of element j.
Count count(const Elements& elements, const std::vector<Triangle>& blockers, int i, int j, const Polygon& from,
            const Polygon& to, int lines) {
  std::mt19937_64 random(static_cast<std::uint64_t>(i) * 1000003U + static_cast<std::uint64_t>(j));
  const Vector3d normal_i = elements.normal.row(i).transpose();
  const Vector3d normal_j = elements.normal.row(j).transpose();
  double whole = 0.0;
  double seen = 0.0;
  double squares = 0.0;
  double seen_squares = 0.0;
  for (int k = 0; k < lines; ++k) {
    const Vector3d p = point_of(from, random);
    const Vector3d line = point_of(to, random) - p;
    const double weight = normal_i.dot(line) * -normal_j.dot(line) / (line.squaredNorm() * line.squaredNorm());
    if (!(normal_i.dot(line) > 0.0 && weight > 0.0)) continue;
    whole += weight;
    squares += weight * weight;
    const auto blocks = [&](const Triangle& triangle) {
      return triangle.face != elements.face[static_cast<std::size_t>(i)] &&
             triangle.face != elements.face[static_cast<std::size_t>(j)] && crosses(triangle, p, line);
    };
    if (std::any_of(blockers.begin(), blockers.end(), blocks)) continue;
    seen += weight;
    seen_squares += weight * weight;
  }
  const double share = seen / whole;
  // One line more of either kind, so that lines that agree are not taken as sure.
  const double variance = share * share * (squares - seen_squares) + (1.0 - share) * (1.0 - share) * seen_squares;
  const double unoccluded = form_factor(from, to).value;
  return {unoccluded * share, unoccluded * std::sqrt(variance + squares / lines) / whole};
}

Count count(const Elements& elements, const std::vector<Triangle>& blockers, int i, int j, int lines) {
  return count(elements, blockers, i, j, polygon_of(elements, i), polygon_of(elements, j), lines);
}

double unoccluded(const Elements& elements, int i, int j) {
  return form_factor(polygon_of(elements, i), polygon_of(elements, j), 1e-12).value;
}

/// A normal deviate exceeds this with a probability of 1e-6: a hundred comparisons raise a false alarm in one of 1e4
/// cases.
constexpr double kDeviations = 4.9;

/// Of a random sample of the pairs that face one another: each entry is compared with the count, within the row's
/// estimate; and their sum, so that a common bias shows that single entries hide.
void compare_sample(const Elements& elements, const std::vector<Triangle>& blockers, double tolerance, int pairs,
                    int lines, double least_factor) {
  const Assembly assembly = assemble(elements, {.tolerance = tolerance}, {});
  EXPECT_LE(assembly.error_estimate.maxCoeff(), tolerance);
  std::mt19937_64 random(5);
  std::uniform_int_distribution<int> any(0, static_cast<int>(elements.size()) - 1);
  const double deviations = deviations_of_all(elements.size());
  double sum = 0.0;
  double variance = 0.0;
  int partly = 0;
  for (int found = 0; found < pairs;) {
    const int i = any(random);
    const int j = any(random);
    if (i == j) continue;
    const double whole = unoccluded(elements, i, j);
    if (whole < least_factor) continue;
    const double factor = assembly.exchange.at(i, j) / elements.area_mm2[i];
    EXPECT_LE(factor, whole + 1e-6) << i << ", " << j;
    // Two in three are partly hidden.
    if (found % 3 != 0 && !(factor > 0.0 && factor < 0.999 * whole)) continue;
    ++found;
    partly += factor > 0.0 && factor < 0.999 * whole ? 1 : 0;
    const Count counted = count(elements, blockers, i, j, lines);
    const double estimate = assembly.error_estimate[i];
    EXPECT_LE(std::abs(factor - counted.value), estimate + kDeviations * counted.deviation)
        << i << ", " << j << ": " << factor << ", counted " << counted.value << " +- " << counted.deviation << " of "
        << whole << ", estimate " << estimate;
    sum += factor - counted.value;
    variance += std::pow(estimate / deviations, 2) + std::pow(counted.deviation, 2);
  }
  EXPECT_GE(partly, pairs / 2);
  EXPECT_LE(std::abs(sum), kDeviations * std::sqrt(variance)) << std::sqrt(variance);
}

TEST(SampledPairs, EntriesOfALumpySolidInABoxAreThoseOfAnIndependentCount) {
  const Elements elements = make_elements(testing::lumpy_solid_in_box(4, 4));
  // The box encloses all lines and hides none.
  compare_sample(elements, triangles_of(elements, 1), 2e-3, 16, 40000, 1e-4);
}

/// A floor and a ceiling of n x n squares; on every inner corner of the floor three triangles stand upright, which
/// share that corner with four squares.
scene::Scene hall_with_fins(int n) {
  scene::Scene scene;
  mesh::PatchMesh floor, ceiling, fins;
  testing::add_grid(floor, {0, 0, 0}, {double(n), 0, 0}, {0, double(n), 0}, n, n);
  testing::add_grid(ceiling, {0, 0, 1.5}, {0, double(n), 0}, {double(n), 0, 0}, n, n);
  for (int k = 0; k < 3 * (n - 1) * (n - 1); ++k) {
    const int first = static_cast<int>(fins.points.size());
    const Vector3d foot(1 + k / 3 % (n - 1), 1 + k / 3 / (n - 1), 0);
    const double turn = 0.7 * k;
    const Vector3d across(0.4 * std::cos(turn), 0.4 * std::sin(turn), 0.9);
    fins.points.insert(fins.points.end(), {foot, foot + across, foot + across.cwiseProduct(Vector3d(-1, -1, 1))});
    fins.faces.push_back({first, first + 1, first + 2, -1});
  }
  floor.closed = ceiling.closed = fins.closed = true;  // their backs do not matter here
  scene.objects = {object("floor", floor), object("ceiling", ceiling), object("fins", fins)};
  return scene;
}

TEST(SampledPairs, BlockersThatShareACornerWithAPatchHideWhatTheyHide) {
  const Elements elements = make_elements(hall_with_fins(6));
  ASSERT_GT(elements.faces.size(), 72 + 64);
  compare_sample(elements, triangles_of(elements, 2), 1e-2, 16, 40000, 1e-3);
}

// A fiftieth of a wall rises above the plane of a patch, so that the first lines carry nothing; slats hide about half
// of it.
TEST(SampledPairs, WhatRisesALittleAboveAPlaneIsFound) {
  scene::Scene scene;
  mesh::PatchMesh patch, wall, slats;
  testing::add_grid(patch, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 1, 1);
  const double rise = 0.02;
  testing::add_grid(wall, {1.1, 0, rise - 1.0}, {0, 0, 1}, {0, 1, 0}, 1, 1);
  constexpr int kSlats = 80;
  for (int k = 0; k < kSlats; ++k) {
    // Heights differ, so that no two slats make one convex body.
    testing::add_grid(slats, {1.05 + 0.001 * (k % 3), (k + 0.2) / kSlats, -0.1}, {0, 0.5 / kSlats, 0},
                      {0, 0, 0.2 + 0.001 * (k % 7)}, 1, 1);
  }
  patch.closed = wall.closed = slats.closed = true;  // their backs do not matter here
  scene.objects = {object("patch", patch), object("wall", wall), object("slats", slats)};
  const Elements elements = make_elements(scene);
  const int i = elements.front_element[0];
  const int j = elements.front_element[1];
  const Assembly assembly = assemble(elements, {.tolerance = 2e-4}, {});
  Polygon above = polygon_of(elements, j);
  for (int k = 0; k < 4; ++k) {
    double& z = above.corner[static_cast<std::size_t>(k)].z();
    z = std::max(z, 0.0);
  }
  const Count counted = count(elements, triangles_of(elements, 2), i, j, polygon_of(elements, i), above, 40000);
  const double factor = assembly.exchange.at(i, j) / elements.area_mm2[i];
  EXPECT_LE(std::abs(factor - counted.value), assembly.error_estimate[i] + kDeviations * counted.deviation)
      << factor << ", counted " << counted.value << " +- " << counted.deviation;
  EXPECT_LE(assembly.error_estimate[i], 0.7 * counted.value);  // neither 0 nor twice the value would pass
  EXPECT_LT(factor, form_factor(polygon_of(elements, i), polygon_of(elements, j)).value);
}

// The black inside of a solid with a hole is hidden from most of the box, and clusters are dropped where no line
// arrives. The box closes with it, so that what a drop loses shows.
TEST(SampledPairs, RowsThatSeeABlackInsideThroughAHoleCloseWithinTheirEstimates) {
  scene::Scene scene;
  scene.objects.push_back(object("box", testing::cube(100.0, 6, true, Vector3d(50, 50, 50))));
  mesh::PatchMesh solid = testing::lumpy_solid(8);
  std::erase_if(solid.faces, [&](const mesh::Face& face) {
    const Vector3d centre =
        (solid.points[static_cast<std::size_t>(face[0])] + solid.points[static_cast<std::size_t>(face[1])] +
         solid.points[static_cast<std::size_t>(face[2])]) /
        3.0;
    return (centre - Vector3d(50, 50, 45)).normalized().dot(Vector3d(0.6, 0.0, 0.8)) > 0.98;
  });
  solid.closed = false;
  scene.objects.push_back(object("shell", std::move(solid)));
  for (scene::Object& each : scene.objects) each.material = 0;
  scene.materials = {{"grey", {Eigen::VectorXd::Constant(1, 0.5), {}}}};
  const Elements elements = make_elements(scene);
  const double tolerance = 1e-2;
  const Assembly assembly = assemble(elements, {.tolerance = tolerance}, {});
  const RowMatrix sums = assembly.exchange.multiply(RowMatrix::Ones(elements.size(), 1));
  for (Eigen::Index e = 0; e < elements.size(); ++e) {
    if (elements.material[static_cast<std::size_t>(e)] < 0) continue;  // black sides exchange nothing with one another
    EXPECT_LE(std::abs(sums(e, 0) / elements.area_mm2[e] - 1.0), assembly.error_estimate[e]) << e;
    EXPECT_LE(assembly.error_estimate[e], tolerance) << e;
  }
}

// Survey, first round and the rounds that follow.
TEST(SampledPairs, HaveTheSameBitsForAnyNumberOfThreads) {
  const Elements elements = make_elements(testing::lumpy_solid_in_box(4, 4));
  const auto run = [&](std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return assemble(elements, {.tolerance = 5e-3}, {});
  };
  const Assembly one = run(1);
  const Assembly two = run(2);
  const RowMatrix x = RowMatrix::Random(elements.size(), 3);
  EXPECT_TRUE(one.exchange.multiply(x) == two.exchange.multiply(x));
  EXPECT_TRUE(one.error_estimate == two.error_estimate);
}

}  // namespace
}  // namespace interglow::radiosity
