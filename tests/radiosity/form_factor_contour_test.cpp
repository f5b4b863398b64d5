// SPDX-License-Identifier: GPL-3.0-or-later
// The contour integral at every wanted error: no error above its estimate, no estimate above what was asked for.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <string>
#include <utility>

#include "radiosity/contour_kernel.h"
#include "radiosity/form_factor.h"
#include "tests/radiosity/form_factor_shapes.h"

namespace interglow::radiosity {
namespace {

using Eigen::Vector3d;
using test::quad;
using test::triangle;

constexpr double kTolerances[] = {1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13, 1e-14};

double area(const Polygon& polygon) {
  Vector3d twice = Vector3d::Zero();
  for (int i = 1; i + 1 < polygon.corners; ++i)
    twice += (polygon.corner[i] - polygon.corner[0]).cross(polygon.corner[i + 1] - polygon.corner[0]);
  return twice.norm() / 2;
}

Polygon moved(Polygon polygon, const Vector3d& by) {
  for (int i = 0; i < polygon.corners; ++i) polygon.corner[i] += by;
  return polygon;
}

struct Pair {
  Polygon first, second;
  std::string kind;
};

class RandomPairs {
 public:
  explicit RandomPairs(std::uint64_t seed) : random_(seed) {}

  Pair next(int index) {
    const Vector3d u = direction(), v = u.cross(direction()).normalized(), n = u.cross(v), origin = vector();
    const auto at = [&](double x, double y, double z) -> Vector3d { return origin + x * u + y * v + z * n; };
    const Polygon square = quad(at(0, 0, 0), at(1, 0, 0), at(1, 1, 0), at(0, 1, 0));
    const Polygon one = shape(index / 10), other = shape(index / 30);
    const Vector3d to_corner = one.corner[index % 3] - other.corner[0];
    switch (index % 10) {
      case 0:
        return {one, moved(other, to_corner), "shared corner"};
      case 1:
        return {one, moved(other, to_corner + std::pow(10.0, between(-10, -1)) * direction()),
                "corners close together"};
      case 2: {
        const double angle = between(0.01, 3.13);
        const auto lifted = [&](double x, double y) { return at(x, y * std::cos(angle), y * std::sin(angle)); };
        if (index % 20 < 10)
          return {triangle(at(0, 0, 0), at(1, 0, 0), at(between(-1, 2), between(0.2, 2), 0)),
                  triangle(at(1, 0, 0), at(0, 0, 0), lifted(between(-1, 2), between(0.2, 2))),
                  "triangles with one edge"};
        return {square, quad(at(1, 0, 0), at(0, 0, 0), lifted(0, between(0.1, 2)), lifted(1, 2)),
                "quads with one edge"};
      }
      case 3:
        return {one, moved(other, between(1.5, 6) * direction()), "apart"};
      case 4:
        return {one, moved(other, between(0, 1.5) * direction()), "cut by each other's plane"};
      case 5: {
        const double x = between(-0.5, 1.5), y = between(-0.5, 1.5), angle = between(0, 6.3), length = between(0.1, 1);
        const double x1 = x + length * std::cos(angle), y1 = y + length * std::sin(angle), height = between(0.1, 2);
        return {square, quad(at(x, y, 0), at(x1, y1, 0), at(x1, y1, height), at(x, y, height)), "standing on it"};
      }
      case 6: {
        const double x = between(-1, 1), y = between(-1, 1), gap = std::pow(10.0, between(-8, 0));
        return {square, quad(at(x, y, gap), at(x, y + 1, gap), at(x + 1, y + 1, gap), at(x + 1, y, gap)),
                "face to face"};
      }
      case 7: {
        const double tilt = std::pow(10.0, between(-8, 0)), turn = std::pow(10.0, between(-6, 0)),
                     gap = std::pow(10.0, between(-9, 0));
        const auto above = [&](double x, double y) {
          const double s = x * std::cos(turn) - y * std::sin(turn) + 0.2, t = x * std::sin(turn) + y * std::cos(turn);
          return at(s, t, gap + (s + 1) * tilt);
        };
        return {square, triangle(above(0, 0), above(0, 1), above(1, 0)), "nearly parallel edges close together"};
      }
      case 8: {
        Polygon tiny = shape(index / 30);
        const double size = std::pow(10.0, between(-4, -1));
        for (int i = 0; i < tiny.corners; ++i) tiny.corner[i] *= size;
        return {square, moved(tiny, at(unit(), unit(), size * between(0, 3))), "tiny beside large"};
      }
      default: {  // an edge of the one ends within an edge of the other
        const double a = between(0.1, 0.9), b = a + between(0.1, 2);
        return {square, quad(at(a, 0, 0), at(a, 0, 1), at(b, 0, 1), at(b, 0, 0)), "edges that overlap in part"};
      }
    }
  }

  double unit() { return std::uniform_real_distribution<double>(0, 1)(random_); }
  double between(double low, double high) { return low + (high - low) * unit(); }
  Vector3d vector() {
    const double x = between(-1, 1), y = between(-1, 1), z = between(-1, 1);
    return {x, y, z};
  }
  Vector3d direction() {
    for (;;) {
      const Vector3d v = vector();
      if (v.squaredNorm() <= 1 && v.squaredNorm() > 0.01) return v.normalized();
    }
  }
  /// A triangle, a parallelogram or another quad of about unit size.
  Polygon shape(int kind) {
    const Vector3d u = direction(), v = u.cross(direction()).normalized();
    const double stretch = between(0.5, 1.5), skew = between(-0.4, 0.4), lean = between(-0.3, 0.3);
    const auto at = [&](double s, double t) -> Vector3d { return s * u + t * (stretch * v + skew * u); };
    if (kind % 3 == 0) return triangle(at(-0.8, -0.6), at(0.8, -0.6), at(lean, 0.9));
    if (kind % 3 == 1) return quad(at(-0.5, -0.5), at(0.5, -0.5), at(0.5, 0.5), at(-0.5, 0.5));
    return quad(at(-0.5, -0.5), at(0.5, -0.5), at(0.4 + lean / 5, 0.6), at(-0.4, 0.5));
  }

 private:
  std::mt19937_64 random_;
};

TEST(FormFactorContour, NoErrorIsAboveItsEstimateAndNoEstimateAboveTheTolerance) {
  RandomPairs pairs(20261123);
  for (int i = 0; i < 3000; ++i) {
    const Pair pair = pairs.next(i);
    // Round-off: in extended precision wherever double is not exact to 1e-15 of the smaller area.
    const FormFactor exact = exchange_area(pair.first, pair.second, 0.0);
    const double least_area = std::min(area(pair.first), area(pair.second));
    for (const double tolerance : kTolerances) {
      const FormFactor found = exchange_area(pair.first, pair.second, tolerance * least_area);
      const FormFactor reverse = exchange_area(pair.second, pair.first, tolerance * least_area);
      const auto where = [&] { return ::testing::Message() << pair.kind << ", pair " << i << " at " << tolerance; };
      ASSERT_EQ(found.value, reverse.value) << where();
      ASSERT_EQ(found.error_estimate, reverse.error_estimate) << where();
      ASSERT_LE(std::abs(found.value - exact.value), found.error_estimate + exact.error_estimate) << where();
      // Below 1e-12 the doubles of the corners themselves stand in the way: a tiny patch is as uncertain as the large
      // one.
      if (tolerance >= 1e-12 || pair.kind != "tiny beside large") {
        ASSERT_LE(found.error_estimate, tolerance * least_area) << where();
      }
    }
  }
}

/// Lambert's formula at Gauss points of one patch: one contour integral instead of two, no logarithm.
double by_lambert(const Polygon& patch, const Polygon& other) {
  const detail::GaussRule& rule = detail::gauss_legendre(24);
  const Vector3d normal = (patch.corner[1] - patch.corner[0]).cross(patch.corner[2] - patch.corner[0]).normalized();
  double sum = 0;
  for (int part = 0; part + 2 < patch.corners; ++part) {  // fan of triangles, each the image of a square
    const Vector3d origin = patch.corner[0], a = patch.corner[part + 1], b = patch.corner[part + 2];
    const double twice_area = (a - origin).cross(b - origin).norm();
    for (int i = 0; i < rule.points; ++i)
      for (int j = 0; j < rule.points; ++j) {
        const double s = (1 + double(rule.node[i])) / 2, t = (1 + double(rule.node[j])) / 2;
        const Vector3d point = origin + s * ((1 - t) * (a - origin) + t * (b - origin));
        sum += double(rule.weight[i] * rule.weight[j]) / 4 * s * twice_area * point_form_factor(point, normal, other);
      }
  }
  return sum;
}

TEST(FormFactorContour, AgreesWithLambertsFormulaWherePatchesStandApart) {
  RandomPairs pairs(5);
  int compared = 0;
  for (int i = 0; compared < 60; ++i) {
    const Polygon one = pairs.shape(i), other = moved(pairs.shape(i / 3), pairs.between(2.5, 6) * pairs.direction());
    const auto faces = [](const Polygon& from, const Polygon& to) {
      const Vector3d n = (from.corner[1] - from.corner[0]).cross(from.corner[2] - from.corner[0]).normalized();
      double least = 1;
      for (int k = 0; k < to.corners; ++k) least = std::min(least, n.dot(to.corner[k] - from.corner[0]));
      return least > 0.1;  // no horizon cuts the integrand
    };
    if (!faces(one, other) || !faces(other, one)) continue;
    ++compared;
    const double expected = by_lambert(one, other);
    for (const double tolerance : kTolerances) {
      const FormFactor found = exchange_area(one, other, tolerance);
      // 24 points are exact to rounding at 1.5 sizes of gap and more; a sum of 576 to 1,152 terms, each to 1e-15.
      EXPECT_LE(std::abs(found.value - expected), found.error_estimate + 2e-15)
          << "pair " << i << " at " << tolerance << ": " << found.value << ", expected " << expected;
    }
  }
}

/// Unit squares face to face (Howell, Catalog of configuration factors, C-11), from 1 - F ~ gap to F ~ 1 / (π gap²).
TEST(FormFactorContour, FacingSquaresHaveTheirClosedForm) {
  for (const double gap : {0.03, 0.1, 0.3, 1.0, 3.0}) {
    const double x = 1 / gap, root = std::sqrt(1 + x * x);
    const double expected =
        2 / (std::numbers::pi * x * x) *
        (std::log((1 + x * x) / std::sqrt(1 + 2 * x * x)) + 2 * x * root * std::atan(x / root) - 2 * x * std::atan(x));
    const Polygon lower = quad({0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0});
    const Polygon upper = quad({0, 0, gap}, {0, 1, gap}, {1, 1, gap}, {1, 0, gap});
    for (const double tolerance : kTolerances) {
      const FormFactor found = form_factor(lower, upper, tolerance);
      // The closed form loses x² of its digits where the gap is large.
      EXPECT_LE(std::abs(found.value - expected), found.error_estimate + 4e-16 * (1 + gap * gap))
          << gap << ' ' << tolerance;
    }
  }
}

/// Rectangles 1 x h and 1 x w that share an edge at a right angle (Hottel and Sarofim 1967; Howell, C-14).
TEST(FormFactorContour, RectanglesAtARightAngleHaveTheirClosedForm) {
  for (const double w : {0.2, 1.0, 3.0})
    for (const double h : {0.2, 1.0, 3.0}) {
      const double hh = h * h, ww = w * w, both = hh + ww;
      const double expected =
          (w * std::atan(1 / w) + h * std::atan(1 / h) - std::sqrt(both) * std::atan(1 / std::sqrt(both)) +
           0.25 * (std::log((1 + ww) * (1 + hh) / (1 + both)) + ww * std::log(ww * (1 + both) / ((1 + ww) * both)) +
                   hh * std::log(hh * (1 + both) / ((1 + hh) * both)))) /
          std::numbers::pi;  // A1 F12 of the floor of area w
      const Polygon floor = quad({0, 0, 0}, {1, 0, 0}, {1, w, 0}, {0, w, 0});
      const Polygon wall = quad({0, 0, 0}, {0, 0, h}, {1, 0, h}, {1, 0, 0});
      for (const double tolerance : kTolerances) {
        const FormFactor found = exchange_area(floor, wall, tolerance);
        // A handful of terms up to 3, each rounded.
        EXPECT_LE(std::abs(found.value - expected), found.error_estimate + 4e-15) << w << ' ' << h << ' ' << tolerance;
      }
    }
}

}  // namespace
}  // namespace interglow::radiosity
