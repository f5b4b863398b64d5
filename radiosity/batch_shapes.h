// SPDX-License-Identifier: GPL-3.0-or-later
// Patches of a vector of pairs: what the choice and the rules are made from, included once for each instruction set
// (batch_kernel_source.h).
#include "radiosity/batch_vectors.h"

namespace interglow::radiosity::batch {
namespace {

/// What a pair of patches is asked first: one line of the record, and the moments.
struct Centre {
  Vector centre, normal;
  Real area, radius, deviation, lever, second, third, fourth, half_edge, perimeter, skew, parallelogram;
  Vector moment1, moment2;
  explicit Centre(const Lanes& lanes) {
    Real field[24];
    lanes.load(offsetof(PatchRecord, centre), field);
    centre = {field[0], field[1], field[2]};
    normal = {field[3], field[4], field[5]};
    area = field[6], radius = field[7], deviation = field[8], lever = field[9];
    second = field[10], third = field[11], fourth = field[12];
    parallelogram = 1.0 - field[13] - field[14];
    half_edge = field[15];
    moment1 = {field[16], field[17], field[18]};
    moment2 = {field[19], field[20], field[21]};
    perimeter = field[22], skew = field[23];
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
        square(dot(between, between)),
        inverse_square(1.0 / max(square, splat(1e-280))),
        exchange(a.area * b.area * height_a * height_b * inverse_square * inverse_square * (1 / kPi)) {}

  Real with_moments(const Centre& a, const Centre& b) const {
    // K of second order times h: finite where h is small.
    const auto moved = [this](Vector moment, Vector other_normal, Vector way, Real height) {
      const Real along = dot(way, moment) * inverse_square;
      return height * (12.0 * along * along - 2.0 * dot(moment, moment) * inverse_square) -
             4.0 * along * dot(other_normal, moment);
    };
    const Vector back = splat(-1) * between;
    const Real of_a = moved(a.moment1, b.normal, back, height_a) + moved(a.moment2, b.normal, back, height_a);
    const Real of_b = moved(b.moment1, a.normal, between, height_b) + moved(b.moment2, a.normal, between, height_b);
    return exchange +
           a.area * b.area * (of_a * height_b + of_b * height_a) * inverse_square * inverse_square * (1 / kPi);
  }
};

struct Shape {
  Vector origin, e1, e2, e3;
  Real length1, length2;
  explicit Shape(const Lanes& lanes) {
    Real field[14];
    lanes.load(offsetof(PatchRecord, origin), field);
    origin = {field[0], field[1], field[2]};
    e1 = {field[3], field[4], field[5]};
    e2 = {field[6], field[7], field[8]};
    e3 = {field[9], field[10], field[11]};
    length1 = field[12], length2 = field[13];
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
