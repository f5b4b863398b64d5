// SPDX-License-Identifier: GPL-3.0-or-later
// Patches of a vector of pairs: what the choice and the rules are made from, included once for each instruction set
// (batch_kernel_source.h).
#pragma once

#include "radiosity/batch_vectors.h"

namespace interglow::radiosity::batch {
namespace {

/// The first line of the records.
struct Centre {
  Vector centre, normal;
  Real area, ball;
  explicit Centre(const Lanes& lanes) {
    Real field[8];
    lanes.load(offsetof(PatchRecord, centre), field);
    centre = {field[0], field[1], field[2]};
    normal = {field[3], field[4], field[5]};
    area = field[6], ball = field[7];
  }
};

/// The second line.
struct Sizes {
  Real half_edge, middle_radius, perimeter, sides, second, fourth, skew, parallelogram;
  explicit Sizes(const Lanes& lanes) {
    Real field[8];
    lanes.load(offsetof(PatchRecord, half_edge), field);
    half_edge = field[0], middle_radius = field[1], perimeter = field[2], sides = field[3];
    second = field[4], fourth = field[5], skew = field[6], parallelogram = field[7];
  }
};

struct Moments {
  Vector first, second;
  explicit Moments(const Lanes& lanes) {
    Real field[6];
    lanes.load(offsetof(PatchRecord, moment1), field);
    first = {field[0], field[1], field[2]};
    second = {field[3], field[4], field[5]};
  }
};

/// K = cosθ cosθ' / (π r²) between the centres. Moved by τ within one patch, its term of second order is K times
/// 12 (d·τ)² / r⁴ - 2 τ² / r² - 4 (n'·τ) (d·τ) / (h r²), h the height over the other's plane, d the way from there.
struct CentreLine {
  Vector between;
  Real height_a, height_b, square, inverse_square, exchange;  ///< of a's centre over b's plane; A A' K
  CentreLine(const Centre& a, const Centre& b)
      : between(b.centre - a.centre),
        height_a(-dot(b.normal, between)),
        height_b(dot(a.normal, between)),
        square(dot(between, between)) {}

  /// @param inverse  1 / square
  void divide(const Centre& a, const Centre& b, Real inverse) {
    inverse_square = inverse;
    exchange = a.area * b.area * height_a * height_b * inverse * inverse * (1 / kPi);
  }

  Real with_moments(const Centre& a, const Centre& b, const Moments& of_first, const Moments& of_second) const {
    // K of second order times h: finite where h is small.
    const auto moved = [this](Vector moment, Vector other_normal, Vector way, Real height) {
      const Real along = dot(way, moment) * inverse_square;
      return height * (12.0 * along * along - 2.0 * dot(moment, moment) * inverse_square) -
             4.0 * along * dot(other_normal, moment);
    };
    const Vector back = splat(-1) * between;
    const Real of_a =
        moved(of_first.first, b.normal, back, height_a) + moved(of_first.second, b.normal, back, height_a);
    const Real of_b =
        moved(of_second.first, a.normal, between, height_b) + moved(of_second.second, a.normal, between, height_b);
    return exchange +
           a.area * b.area * (of_a * height_b + of_b * height_a) * inverse_square * inverse_square * (1 / kPi);
  }
};

struct Shape {
  Real radius, deviation, lever, third, inverse_half_edge;
  Vector origin, e1, e2, e3;
  explicit Shape(const Lanes& lanes) {
    Real field[5];
    lanes.load(offsetof(PatchRecord, radius), field);
    radius = field[0], deviation = field[1], lever = field[2], third = field[3];
    inverse_half_edge = field[4];
    Real vectors[12];
    lanes.load(offsetof(PatchRecord, origin), vectors);
    origin = {vectors[0], vectors[1], vectors[2]};
    e1 = {vectors[3], vectors[4], vectors[5]};
    e2 = {vectors[6], vectors[7], vectors[8]};
    e3 = {vectors[9], vectors[10], vectors[11]};
  }
};

/// Half edges and their middles seen from the origin; a triangle's fourth edge has no length.
struct Outline {
  Vector half[4], middle[4];
  Vector origin;
  explicit Outline(const Shape& of) : origin(of.origin) {
    const Vector far = of.e1 + of.e2 + of.e3;  // of a triangle e2 = 0: its last edge returns to the origin
    half[0] = 0.5 * of.e1;
    half[1] = 0.5 * (of.e2 + of.e3);
    half[2] = 0.5 * (of.e2 - far);
    half[3] = -0.5 * of.e2;
    middle[0] = half[0];
    middle[1] = of.e1 + half[1];
    middle[2] = 0.5 * (of.e2 + far);
    middle[3] = 0.5 * of.e2;
  }
};

}  // namespace
}  // namespace interglow::radiosity::batch
