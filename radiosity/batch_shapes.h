// SPDX-License-Identifier: GPL-3.0-or-later
// Patches of a vector of pairs: what the choice and the rules are made from, included once for each instruction set
// (batch_kernel_source.h).
#pragma once

#include "radiosity/batch_vectors.h"

namespace interglow::radiosity::batch {
namespace {

/// Three numbers in one: the upper half of a double, and 16 bits each (exponent, 5 bits of mantissa) rounded up.
struct Spread {
  Real second;       ///< mean |x - centre|², to 20 bits
  Real ball_square;  ///< at least the farthest corner's squared distance; huge where `ball` is without end
  Real beyond;       ///< at least what `second` over all directions of the plane alike leaves of the second order: the
                     ///< difference of the principal moments and, of patches without a centre of symmetry, mean
                     ///< |x - centre|³ squared over 15 ball_square second
  Mask symmetric;
  explicit Spread(Real packed) {
    const Bits bits = reinterpret_cast<Bits>(packed);
    constexpr unsigned long long kShort = 0x7fff800000000000ull;
    second = reinterpret_cast<Real>(bits & 0xffffffff00000000ull);
    ball_square = reinterpret_cast<Real>((bits << 31) & kShort);
    beyond = reinterpret_cast<Real>((bits << 47) & kShort);
    symmetric = (bits & 1) == 0;
  }
};

/// The first line of the records.
struct Centre {
  Vector centre, normal;
  Real area, spread;
  explicit Centre(const Lanes& lanes) {
    Real field[8];
    lanes.load(offsetof(PatchRecord, centre), field);
    centre = {field[0], field[1], field[2]};
    normal = {field[3], field[4], field[5]};
    area = field[6], spread = field[7];
  }
};

/// The second line.
struct Sizes {
  Real half_edge, perimeter, sides, skew, radius;
  Mask parallelogram;
  explicit Sizes(const Lanes& lanes) {
    Real field[5];
    lanes.load(offsetof(PatchRecord, half_edge), field);
    half_edge = field[0], perimeter = field[1], sides = field[2];
    parallelogram = field[3] >= 0;
    skew = max(field[3], splat(0));
    radius = field[4];
  }
};

/// The third.
struct Sides {
  Vector e1, e2;
  Real deviation, lever;
  explicit Sides(const Lanes& lanes) {
    Real field[8];
    lanes.load(offsetof(PatchRecord, e1), field);
    e1 = {field[0], field[1], field[2]};
    e2 = {field[3], field[4], field[5]};
    deviation = field[6], lever = field[7];
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

/// x x' + y y' from x + y and x' + y': fused to the same bits if (x, x') and (y, y') change places.
inline Real even_sum(Real x_less_y, Real x_and_y, Real less_of_others, Real others) {
  return 0.5 * (x_and_y * others + x_less_y * less_of_others);
}

/// K = cosθ cosθ' / (π r²) between the centres. Moved by τ within one patch, its term of second order is K times
/// 12 (d·τ)² / r⁴ - 2 τ² / r² - 4 (n'·τ) (d·τ) / (h r²), h the height over the other's plane, d the way from there.
struct CentreLine {
  Vector between;
  Real height_a, height_b, square, inverse_square;  ///< of a's centre over b's plane
  Real exchange;                                    ///< A A' K; the same bits for (a, b) and (b, a)
  CentreLine(const Centre& a, const Centre& b)
      : between(b.centre - a.centre),
        height_a(-dot(b.normal, between)),
        height_b(dot(a.normal, between)),
        square(dot(between, between)) {}

  /// @param inverse  1 / square
  void divide(const Centre& a, const Centre& b, Real inverse) {
    inverse_square = inverse;
    exchange = (a.area * b.area) * (height_a * height_b) * (inverse * inverse) * (1 / kPi);
  }

  /// With second moments alike in all directions of a patch's plane, `second` the mean squared distance: Σ (d·τ)² is
  /// second (r² - h'²) / 2, and Σ (n'·τ)(d·τ) second (h + h' n·n') / 2. The same bits for (a, b) and (b, a).
  Real with_round_moments(const Centre& a, const Centre& b, Real second_a, Real second_b) const {
    const Real product = height_a * height_b, heights = height_a + height_b, both = second_a + second_b;
    const Real crossed =
        even_sum(second_a - second_b, both, (height_b - height_a) * heights, heights * heights - 2.0 * product);
    const Real term = both * product - crossed * (dot(a.normal, b.normal) + 3.0 * (product * inverse_square));
    return (a.area * b.area) * (product + 2.0 * (inverse_square * term)) * (inverse_square * inverse_square) *
           (1 / kPi);
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

/// The fourth: moments, and the lines that product rules run along.
struct Lines {
  Real half_u, half_v, variance, offset, density_skew, third, fourth, second;
  explicit Lines(const Lanes& lanes) {
    Real field[8];
    lanes.load(offsetof(PatchRecord, half_line_u), field);
    half_u = field[0], half_v = field[1], variance = field[2], offset = field[3], density_skew = field[4];
    third = field[5], fourth = field[6], second = field[7];
  }
};

/// The third and the fifth.
struct Shape {
  Real deviation, lever;
  Vector origin, e1, e2, e3;
  explicit Shape(const Lanes& lanes) {
    const Sides sides(lanes);
    e1 = sides.e1, e2 = sides.e2, deviation = sides.deviation, lever = sides.lever;
    Real field[6];
    lanes.load(offsetof(PatchRecord, origin), field);
    origin = {field[0], field[1], field[2]};
    e3 = {field[3], field[4], field[5]};
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
