// SPDX-License-Identifier: GPL-3.0-or-later
// What holds for any two patches, on 1e5 random pairs of all the kinds that break form-factor programs.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <random>
#include <string>

#include "radiosity/form_factor.h"
#include "tests/radiosity/form_factor_shapes.h"

namespace interglow::radiosity {
namespace {

using Eigen::Vector3d;
using test::quad;
using test::triangle;

struct Pair {
  Polygon first, second;
  std::string kind;
};

class RandomPairs {
 public:
  explicit RandomPairs(std::uint64_t seed) : random_(seed) {}

  Pair next(int index) {
    const Vector3d u = vector().normalized(), v = u.cross(vector()).normalized(), n = u.cross(v);
    const Vector3d origin = vector();
    const auto at = [&](double x, double y, double z) -> Vector3d { return origin + x * u + y * v + z * n; };
    const auto any_triangle = [&] { return triangle(vector(), vector(), vector()); };
    const Polygon square = quad(at(0, 0, 0), at(1, 0, 0), at(1, 1, 0), at(0, 1, 0));
    switch (index % 14) {
      case 0:
        return {any_triangle(), any_triangle(), "random triangles, most cut by the other's plane"};
      case 1: {
        const double angle = std::numbers::pi / 180 * (index % 3 == 0 ? 0.1 : index % 3 == 1 ? 179.9 : 180 * unit());
        return {square,
                quad(at(0, 0, 0), at(0, 1, 0), at(std::cos(angle), 1, std::sin(angle)),
                     at(std::cos(angle), 0, std::sin(angle))),
                "shared edge"};
      }
      case 2:
        return {triangle(origin, vector(), vector()), triangle(origin, vector(), vector()), "shared corner"};
      case 3:
        return {square, quad(at(0.5, 0.25, 0), at(2, 0.25, 0), at(2, 2, 0), at(0.5, 2, 0)), "coplanar"};
      case 4:
        return {square, square, "the same twice"};
      case 5:
        return {square, quad(at(0, 0, 0), at(0, 1, 0), at(1, 1, 0), at(1, 0, 0)), "coincident, opposite"};
      case 6: {
        const double gap = std::pow(10.0, -12 * unit());
        return {square, quad(at(0, 0, gap), at(0, 1, gap), at(1, 1, gap), at(1, 0, gap)), "small gap"};
      }
      case 7:
        return {triangle(at(0, 0, 0), at(1, 0, 0), at(unit(), 1e-5, 0)), any_triangle(), "aspect 1e5"};
      case 8: {
        const Vector3d tiny = at(unit(), unit(), unit());
        return {square, triangle(tiny, tiny + 1e-4 * vector(), tiny + 1e-4 * vector()), "areas 1e8 apart"};
      }
      case 9:
        return {square, triangle(at(1, 0, 0), at(1, 0, 0), vector()), "repeated corner, no area"};
      case 10:
        return {quad(at(0, 0, 0), at(1, 0, 0), at(1, 0, 0), at(0, 1, 0)), any_triangle(),
                "quad with a repeated corner"};
      case 11:
        return {triangle(at(0, 0, 0), at(1, 0, 0), at(2, 0, 0)), square, "collinear corners"};
      case 12: {
        const double tilt = std::pow(10.0, -8 * unit()), turn = std::pow(10.0, -6 * unit()),
                     gap = std::pow(10.0, -9 * unit());
        const auto above = [&](double x, double y) {
          const double s = x * std::cos(turn) - y * std::sin(turn) + 0.2, t = x * std::sin(turn) + y * std::cos(turn);
          return at(s, t, gap + (s + 1) * tilt);
        };
        return {square, triangle(above(0, 0), above(0, 1), above(1, 0)), "nearly parallel edges close together"};
      }
      default:
        return {square, triangle(at(0.5, 0, 0), at(unit(), 0.3, unit()), at(0.2, unit(), unit())), "corner on an edge"};
    }
  }

  double unit() { return std::uniform_real_distribution<double>(0, 1)(random_); }
  Vector3d vector() {
    std::uniform_real_distribution<double> coordinate(-1, 1);
    const double x = coordinate(random_), y = coordinate(random_), z = coordinate(random_);
    return {x, y, z};
  }

 private:
  std::mt19937_64 random_;
};

double area(const Polygon& polygon) {
  Vector3d twice = Vector3d::Zero();
  for (int i = 1; i + 1 < polygon.corners; ++i)
    twice += (polygon.corner[i] - polygon.corner[0]).cross(polygon.corner[i + 1] - polygon.corner[0]);
  return twice.norm() / 2;
}

TEST(FormFactorProperties, HundredThousandPairsAreFiniteBoundedAndReciprocalToTheBit) {
  RandomPairs pairs(20261122);
  for (int i = 0; i < 100000; ++i) {
    const Pair pair = pairs.next(i);
    const double tolerance = i % 2 == 0 ? 1e-6 : 1e-10;
    const FormFactor one_way = exchange_area(pair.first, pair.second, tolerance);
    const FormFactor other_way = exchange_area(pair.second, pair.first, tolerance);
    const std::string where = pair.kind + ", pair " + std::to_string(i);
    ASSERT_EQ(one_way.value, other_way.value) << where;
    ASSERT_EQ(one_way.error_estimate, other_way.error_estimate) << where;
    ASSERT_TRUE(std::isfinite(one_way.value) && std::isfinite(one_way.error_estimate)) << where;
    ASSERT_GE(one_way.value, 0.0) << where;
    const double least_area = std::min(area(pair.first), area(pair.second));
    ASSERT_LE(one_way.value, least_area * (1 + 1e-12) + 1e-300) << where;  // the two areas are rounded differently
    if (pair.kind == "coplanar" || pair.kind == "the same twice") {
      ASSERT_LE(one_way.value, 1e-14) << where;  // corners rounded by 1e-16 tilt the patches by a few times that
    }
    if (pair.kind == "collinear corners" || pair.kind == "repeated corner, no area") {
      ASSERT_EQ(one_way.value, 0.0) << where;
    }
    if (pair.kind == "coincident, opposite") {
      ASSERT_EQ(one_way.method, FormFactorMethod::kUndefined) << where;
    }
  }
}

/// Moves, and scales, that do not change form factors. The coordinates are rounded anew, by up to 1 ulp of their size,
/// which moves the patches; F changes by that over the least distance that matters: the gap, the thickness, the tiny
/// patch's size (>= 1e-5).
TEST(FormFactorProperties, RigidMotionAndScaleChangeNothingButRounding) {
  RandomPairs pairs(17);
  RandomPairs frames(18);
  for (int i = 0; i < 2800; ++i) {
    const Pair pair = pairs.next(i);
    // Rounding decides these: on which side of the other's plane corners come to lie.
    if (pair.kind == "coplanar" || pair.kind == "the same twice" || pair.kind == "coincident, opposite" ||
        pair.kind == "small gap" || pair.kind == "collinear corners")
      continue;
    const FormFactor given = form_factor(pair.first, pair.second);
    const Vector3d shift = frames.vector();
    const Eigen::AngleAxisd turn(3 * frames.unit(), frames.vector().normalized());
    const auto moved = [&](Polygon polygon) {
      for (int k = 0; k < polygon.corners; ++k) polygon.corner[k] = turn * polygon.corner[k] + shift;
      return polygon;
    };
    // 1e-15 of rounding over a thickness of 1e-5, or under an angle of 1e-8 with a gap of 1e-9.
    const double least = pair.kind == "nearly parallel edges close together" ? 1e-9
                         : pair.kind == "aspect 1e5"                         ? 1e-5
                         : pair.kind == "areas 1e8 apart"                    ? 1e-5
                                                                             : 1e-3;
    EXPECT_NEAR(form_factor(moved(pair.first), moved(pair.second)).value, given.value, 1e-15 / least)
        << pair.kind << ' ' << i;
    for (const double scale : {1e-6, 1e6}) {
      const auto scaled = [&](Polygon polygon) {
        for (int k = 0; k < polygon.corners; ++k) polygon.corner[k] *= scale;
        return polygon;
      };
      EXPECT_NEAR(form_factor(scaled(pair.first), scaled(pair.second)).value, given.value, 1e-15 / least)
          << pair.kind << ' ' << i << " times " << scale;
    }
    const auto doubled = [&](Polygon polygon) {
      for (int k = 0; k < polygon.corners; ++k) polygon.corner[k] *= 0x1p30;
      return polygon;
    };
    EXPECT_EQ(form_factor(doubled(pair.first), doubled(pair.second)).value, given.value) << pair.kind << ' ' << i;
  }
}

TEST(FormFactorProperties, PartsOfEitherPatchAddUpToTheWhole) {
  RandomPairs pairs(19);
  for (int i = 0; i < 2800; ++i) {
    const Pair pair = pairs.next(i);
    if (pair.kind == "coincident, opposite" || pair.first.corners < 3) continue;
    for (const bool swap : {false, true}) {
      const Polygon& whole = swap ? pair.second : pair.first;
      const Polygon& other = swap ? pair.first : pair.second;
      // Cut from the first corner to a point of the opposite edge, which rounds that point off the edge by 1e-16.
      const int last = whole.corners - 1;
      const Vector3d middle = 0.5 * (whole.corner[1] + whole.corner[2]);
      const Polygon part = triangle(whole.corner[0], whole.corner[1], middle);
      const Polygon rest = whole.corners == 3 ? triangle(whole.corner[0], middle, whole.corner[2])
                                              : quad(whole.corner[0], middle, whole.corner[2], whole.corner[last]);
      const double sum = exchange_area(part, other, 0.0).value + exchange_area(rest, other, 0.0).value;
      EXPECT_NEAR(sum, exchange_area(whole, other, 0.0).value, 2e-15)
          << pair.kind << ' ' << i << (swap ? " second" : " first");
    }
  }
}

TEST(FormFactorProperties, StripsWhoseEdgesLieOnOneLineAddUpToTheWhole) {
  // Unit squares at a right angle along a common edge, cut across it at different places: the strips' edges lie on one
  // line up to rounding, overlap or stand apart. Closed form of the whole: Hottel and Sarofim 1967.
  const double whole =
      (2 * std::atan(1.0) - std::sqrt(2.0) * std::atan(std::sqrt(0.5)) + std::log(0.75) / 4) / std::numbers::pi;
  std::mt19937_64 random(23);
  std::uniform_real_distribution<double> signed_unit(-1, 1);
  for (int turn = 0; turn < 100; ++turn) {
    // A floor as scenes have it: one coordinate is exact, so that the lines meet exactly, but anywhere.
    const double angle = std::numbers::pi * signed_unit(random);
    const Vector3d u(std::cos(angle), 0, std::sin(angle)), v(-u.z(), 0, u.x()), n = u.cross(v);
    const double scale = std::pow(10.0, signed_unit(random));
    const Vector3d origin = scale * Vector3d(signed_unit(random), 0, signed_unit(random));
    const int floor_strips = 2 + turn % 5, wall_strips = 3 + turn % 4;
    double sum = 0;
    for (int i = 0; i < floor_strips; ++i) {
      const Vector3d a = origin + double(i) / floor_strips * u, b = origin + double(i + 1) / floor_strips * u;
      for (int j = 0; j < wall_strips; ++j) {
        const Vector3d c = origin + double(j) / wall_strips * u, d = origin + double(j + 1) / wall_strips * u;
        sum += exchange_area(quad(a, b, b + v, a + v), quad(d, c, c + n, d + n), 0.0).value;
      }
    }
    EXPECT_NEAR(sum, whole, 1e-12) << "turn " << turn << ": " << floor_strips << " and " << wall_strips << " strips";
  }
}

}  // namespace
}  // namespace interglow::radiosity
