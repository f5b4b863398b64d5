// SPDX-License-Identifier: GPL-3.0-or-later
// Bounds of what the rules leave out, included once for each instruction set (batch_kernel_source.h).
#pragma once

#include "radiosity/batch_edges.h"
#include "radiosity/batch_shapes.h"

namespace interglow::radiosity::batch {
namespace {

/// Reach of a patch along a direction: of its corners and of the middles of its edges.
struct Extent {
  Real low, high, middle_low, middle_high;
  /// @param at_centre  the centre's
  Extent(const Shape& of, Vector direction, Real at_centre, Vector centre, Mask parallelogram) {
    const Real u = dot(direction, of.e1), v = dot(direction, of.e2);
    const Real along_u = 0.5 * magnitude(u), along_v = 0.5 * magnitude(v);
    const Real corner = along_u + along_v, middle = max(along_u, along_v);
    low = at_centre - corner, high = at_centre + corner;
    middle_low = at_centre - middle, middle_high = at_centre + middle;
    if (!any(~parallelogram)) return;
    const Real uv = dot(direction, of.e3);
    const Real a = at_centre + dot(direction, of.origin - centre), b = a + u, c = a + v, d = b + v + uv;
    const Real ab = a + b, bd = b + d, dc = d + c, ca = c + a;
    low = parallelogram ? low : min(min(a, b), min(c, d));
    high = parallelogram ? high : max(max(a, b), max(c, d));
    middle_low = parallelogram ? middle_low : 0.5 * min(min(ab, bd), min(dc, ca));
    middle_high = parallelogram ? middle_high : 0.5 * max(max(ab, bd), max(dc, ca));
  }
};

/// How two patches of any shape stand to each other, from all but the last line of their records.
struct Placement {
  Real reach;   ///< no point is farther from the other's
  Mask hidden;  ///< behind each other's planes or in one plane
  /// Corners on the other's plane within rounding need no clipping: what is wrong by it is no more than that.
  Mask in_front;
  Extent over_b, over_a, along_a, along_b;  ///< heights of a over b's plane; along the line of centres
  Real gap;  ///< the least distance, by the heights over either plane and along the line of centres

  Placement(const CentreLine& line, Real distance, Real radii, const Centre& a, const Centre& b, const Shape& shape_a,
            const Shape& shape_b, Mask regular_a, Mask regular_b)
      : reach(distance + radii),
        over_b(shape_a, b.normal, line.height_a, a.centre, regular_a),
        over_a(shape_b, a.normal, line.height_b, b.centre, regular_b),
        along_a(shape_a, (distance * line.inverse_square) * line.between, splat(0), a.centre, regular_a),
        along_b(shape_b, (distance * line.inverse_square) * line.between, distance, b.centre, regular_b) {
    const Real open_a = kSideRounding + shape_a.deviation + shape_a.lever * reach,
               open_b = kSideRounding + shape_b.deviation + shape_b.lever * reach;
    hidden = (over_b.high < -open_b) | (over_a.high < -open_a) |
             ((over_b.high <= open_b) & (over_b.low >= -open_b) & (over_a.high <= open_a) & (over_a.low >= -open_a) &
              (dot(a.normal, b.normal) > 0)) |
             (a.area * b.area <= 0);
    in_front = (over_b.low >= -open_b) & (over_a.low >= -open_a) & (over_b.high > open_b) & (over_a.high > open_a);
    gap = max(along_b.low - along_a.high, max(over_a.low, over_b.low));
  }
};

constexpr double kEdgeRoundings = 1.0;  ///< of the squared distances that may gather in their mean logarithm

/// Σ_{k >= 2m} of |k-th Taylor coefficient| times the rule's error of x^k, over q^m, of coefficients (k + 1) q^(k/2)
/// (`growing`) or q^(k/2): orders 2m ... 2m + 6 by their errors, then errors of at most 1/(k + 1).
/// @param tail  1 / (1 - q) or more
inline Real taylor_error(const EdgeRule& rule, bool growing, Real q, Real tail) {
  const int k = 4 * rule.half;
  Real sum = growing ? tail : tail * (1.0 / (k + 2 * kErrors + 1));
  for (int j = kErrors - 1; j >= 0; --j) sum = sum * q + rule.error[j] * (growing ? k + 2 * j + 1 : 1);
  return sum;
}

/// Bounds the mean of r^-p over the points of two patches, or the middles of lines on one of them, by the power at two
/// distances: mean r^-p <= (1 - weight) centre^-p + weight gap^-p. A move along the line of centres by τ of its length
/// r leaves at least (1 + τ) r and gap = (1 - T) r, and what is left of the power above 1 - pτ, over τ², is largest at
/// -T.
struct MeanPower {
  Real inverse_centre, inverse_gap, weight;
  MeanPower() = default;
  /// @param gap  at most the least distance of the points
  /// @param variance  at least the mean squared move along the line of centres
  /// @param offset  at least the mean move
  MeanPower(Real distance, Real gap, Real variance, Real offset) {
    const Real reach = max(distance - gap, 1e-7 * distance), least = distance - reach;
    const Real inverse_both = 1.0 / (distance * reach), inverse = reach * inverse_both;
    weight = min(variance * square_of(distance * inverse_both), splat(1));
    inverse_gap = 1.0 / max(least, 1e-10 * distance);
    inverse_centre = min(inverse + offset * (inverse * inverse), inverse_gap);
  }
};

/// The bound of the rules on edges, edge by edge: of a pair of edges that are not at right angles, for those do not
/// count, D is the least distance of either's middle from the other, over its half length.
struct NearEdges {
  Real coupling[4][4], all;   ///< |e·f| / 2π, and its sum
  Real inverse_square[4][4];  ///< ρ^-2
  Mask enough;                ///< whether some number of points is enough
  Real roundings;             ///< coupling times the mean of the largest squared distance of points over theirs, summed
  NearEdges(const Outline& a, const Outline& b, Real negligible) {
    Real most = splat(0);
    roundings = splat(0);
    all = splat(0);
    const Vector origins = a.origin - b.origin;
    Real a_squared[4], b_squared[4], a_inverse[4], b_inverse[4];
    for (int i = 0; i < 4; ++i) {
      a_squared[i] = max(dot(a.half[i], a.half[i]), splat(1e-200));
      b_squared[i] = max(dot(b.half[i], b.half[i]), splat(1e-200));
      a_inverse[i] = 1.0 / a_squared[i];
      b_inverse[i] = 1.0 / b_squared[i];
    }
    const auto clamped = [](Real t) { return max(min(t, splat(1)), splat(-1)); };
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j) {
        const Real cosine = magnitude(dot(a.half[i], b.half[j]));
        const Mask counts = cosine > negligible;
        coupling[i][j] = (2 / kPi) * cosine;
        all += coupling[i][j];
        inverse_square[i][j] = splat(0);
        if (!any(counts)) continue;
        const Vector w = origins + (a.middle[i] - b.middle[j]);
        const Vector from_a = w - clamped(dot(w, b.half[j]) * b_inverse[j]) * b.half[j];
        const Vector from_b = w + clamped(-dot(w, a.half[i]) * a_inverse[i]) * a.half[i];
        const Real square_a = max(dot(from_a, from_a), splat(1e-200)),
                   square_b = max(dot(from_b, from_b), splat(1e-200));
        const Real inverse_both = 1.0 / (square_a * square_b);
        const Real x = max(a_squared[i] * square_b, b_squared[j] * square_a) * inverse_both;
        const Real inverse = x / square_of(1.0 + square_root(max(1.0 - x, splat(0))));
        inverse_square[i][j] = counts ? inverse : splat(0);
        most = counts ? max(most, x) : most;
        // (|w| + |a| + |b|)² <= 3/2 |w|² + 6 (|a|² + |b|²).
        const Real farthest = 1.5 * dot(w, w) + 6.0 * (a_squared[i] + b_squared[j]);
        const Real nearest = max(max(square_a - a_squared[i], square_b - b_squared[j]), splat(1e-200));
        roundings += counts ? coupling[i][j] * farthest / nearest : splat(0);
      }
    enough = most < 0.99;
  }
};

/// What bounds the rules of m points on every edge, both patches taken for the one that is worse off
/// (docs/form-factors.md):
///   near  coupling (1 + 1/(4m² - 1)) / m 2 ρ^-2m / (1 - ρ^-2), whichever edges these are,
///   far   for parallelograms, whose opposite edges cancel, turned 2 q^m E / D² in the mean, else swept q^m E' / D and
///         the error of errors,
/// with D the distance of the middles of a patch's edges from the other patch, q the square of the longest half edge
/// over D, ρ the ellipse that this leaves free of singularities, and E, E' of `taylor_error`.
struct EdgeBounds {
  Real coupling, turned;  ///< Σ |e·f| / 2π over all edges; the same over sides, times the other sides' lengths
  Real swept;             ///< perimeter times the other's area / 2π, of both
  Mask parallelograms;    ///< both are
  Real half_edge_square;  ///< of the longest
  MeanPower mean;         ///< `inverse_gap` 1 / D
};

/// Points on an edge beyond which the contour integral takes less time, for pairs that ask for more are so rare that
/// vectors are hardly filled.
struct MostPoints {
  int parallelograms, others;
  static MostPoints worth_while(double tolerance) {
    return {tolerance >= 1e-6    ? 12
            : tolerance >= 1e-10 ? 16
                                 : kMaxEdgePoints,
            tolerance >= 1e-5    ? 8
            : tolerance >= 1e-8  ? 12
            : tolerance >= 1e-12 ? 16
                                 : kMaxEdgePoints};
  }
};

constexpr MostPoints kLoosePoints{12, 4};  ///< up to which it does not pay to sharpen the bound

/// Least number m of points on every edge that meets `limit`, as kEdges + m, and the bound; kContour where none does.
/// @param near_edges  where known, in place of `coupling` and ρ
inline void choose_edges(const EdgeBounds& of, const NearEdges* near_edges, MostPoints most, Real limit, Mask asked,
                         const EdgeRule* edge_rules, Real& choice, Real& bound) {
  const double none = 1e300, nearest = 0.99, nearest_far = 0.66;
  const Real q_true = of.half_edge_square * square_of(of.mean.inverse_gap), q = min(q_true, splat(nearest));
  const auto inverse_rho_square = [](Real x) { return x / square_of(1.0 + square_root(1.0 - x)); };
  Real near[4][4], step_near[4][4];
  const int edges = near_edges == nullptr ? 1 : 4;
  if (near_edges == nullptr) {
    const Real inverse = inverse_rho_square(q);
    near[0][0] = q_true < nearest ? 2.0 * of.coupling / (1.0 - inverse) : splat(none);
    step_near[0][0] = inverse * inverse;
  } else {
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j) {
        const Real inverse = near_edges->inverse_square[i][j];
        near[i][j] = near_edges->enough ? 2.0 * near_edges->coupling[i][j] / (1.0 - inverse) : splat(none);
        step_near[i][j] = inverse * inverse;
      }
  }
  const Real q_far = min(q_true, splat(nearest_far)), tail = 1.0 / (1.0 - q_far);
  const Real q_centre = min(of.half_edge_square * square_of(of.mean.inverse_centre), q_far);
  const Mask far_holds = q_true < nearest_far;
  Real far = of.parallelograms ? 2.0 * of.mean.weight * of.turned * square_of(of.mean.inverse_gap)
                               : of.swept * of.mean.inverse_gap;
  far = far_holds ? far : splat(none);
  Real centre =
      of.parallelograms ? 2.0 * (1.0 - of.mean.weight) * of.turned * square_of(of.mean.inverse_centre) : splat(0);
  const bool any_other = any(~of.parallelograms);
  Real squared = splat(0), step_both = splat(0);
  if (any_other) {
    const Real both = 2.0 * square_root(q), both_4 = (both * both) * (both * both);
    step_both = both_4 * both_4;
    squared = both < 0.9 ? of.coupling / (1.0 - min(both, splat(0.9))) : splat(none);
  }
  choice = splat(kContour);
  bound = splat(0);
  const Mask near_holds = near_edges == nullptr ? Mask(q_true < nearest) : near_edges->enough;
  Mask open = asked & (near_holds | far_holds);
  for (int half = 1; half <= kMaxEdgePoints / 2; ++half) {
    const int m = 2 * half;
    open = open & (of.parallelograms ? Mask{} - (m <= most.parallelograms) : Mask{} - (m <= most.others));
    if (!any(open)) break;
    Real near_left = splat(0);
    for (int i = 0; i < edges; ++i)
      for (int j = 0; j < edges; ++j) {
        near[i][j] *= step_near[i][j];
        near_left += near[i][j];
      }
    far *= q_far * q_far;
    centre *= q_centre * q_centre;
    squared *= step_both;
    if (half > 6 && half % 2 != 0) continue;
    Real far_left = (far + centre) * taylor_error(edge_rules[half], true, q_far, tail);
    if (any_other) {
      const Real swept_left = far * taylor_error(edge_rules[half], false, q_far, tail) +
                              squared * (1.0 / (4.0 * m * (2 * m + 1) * (2 * m + 1)));
      far_left = of.parallelograms ? far_left : swept_left;
    }
    const Real left = min((1 + 1.0 / (4.0 * m * m - 1)) / m * near_left, far_left);
    const Mask take = open & (left <= limit);
    choice = take ? splat(double{kEdges} + m) : choice;
    bound = take ? left : bound;
    open = open & ~take;
  }
}

/// Of the product rules of 2 ... `most` points per direction the least whose bound meets `limit`, as kProduct + m, and
/// the bound; kUnsettled where none does. A patch is met along straight lines of half length s r, about whose middles
/// the kernel has the Taylor coefficients (k + 1) / (π r^(k + 2)); a quad's density rises by at most a share `skew` to
/// either end. The bound is the sum over both families of lines of both patches of
///   coefficient mean Σ_{k >= 2m} ((k + 1) s^k + skew k s^(k - 1)) e_k / r².
inline void choose_product(Real coefficient, const MeanPower& mean, const Lines& a, const Lines& b, Real limit,
                           Mask asked, int most, const ProductRule* rules, Real& choice, Real& bound) {
  const Real half = max(max(max(a.half_u, a.half_v), max(b.half_u, b.half_v)), splat(1e-100)), share = 1.0 / half;
  const Real far = half * mean.inverse_centre, near = half * mean.inverse_gap;
  const Real far_square = far * far, near_square = near * near, scale = coefficient * square_of(share);
  Real of_far = (1.0 - mean.weight) * scale * (far_square * far_square),
       of_near = mean.weight * scale * (near_square * near_square);
  const double most_near = 0.7;
  choice = splat(kUnsettled);
  bound = splat(0);
  Mask open = asked & (near < most_near);
  const Real end = 1.0 / square_of(1.0 - min(near, splat(most_near)));
  const Real skew = max(a.density_skew, b.density_skew);
  const bool any_skew = any(skew > 0);
  // Of s^(2m) and of s^(2m - 2), for s^(2m - 1), over the longest's.
  const Real sides[4] = {square_of(share * a.half_u), square_of(share * a.half_v), square_of(share * b.half_u),
                         square_of(share * b.half_v)};
  Real powers[4] = {sides[0], sides[1], sides[2], sides[3]};
  Real families = (sides[0] + sides[1]) + (sides[2] + sides[3]);
  for (int m = 2; m <= most && any(open); ++m) {
    of_far *= far_square;
    of_near *= near_square;
    const Real before = families;
    for (int k = 0; k < 4; ++k) powers[k] *= sides[k];
    families = (powers[0] + powers[1]) + (powers[2] + powers[3]);
    Real at_near = end * (2.0 * m + kProductErrors + 1), at_far = at_near;
    for (int j = kProductErrors - 1; j >= 0; --j) {
      const double error = rules[m].error[j] * (2.0 * m + j + 1);
      at_far = at_far * far + error;
      at_near = at_near * near + error;
    }
    Real left = families * (of_far * at_far + of_near * at_near);
    if (any_skew)
      left +=
          skew * before * (of_far * at_far / max(far, splat(1e-100)) + of_near * at_near / max(near, splat(1e-100)));
    const Mask take = open & (left <= limit);
    choice = take ? splat(double{kProduct} + m) : choice;
    bound = take ? left : bound;
    open = open & ~take;
  }
}

/// Bound of the centres with moments. |k-th Taylor coefficient of the kernel| <= (k + 1) / (π r^(k + 2)): what begins
/// with order k = 4 and moves by at most R leaves (k + 1) mean|δ|^k / (π r^(k+2)) times (1 - 0.8 x) / (1 - x)², x = R /
/// r, or (1 - 0.6 x²) / (1 - x²)² where odd orders vanish; δ the move of one patch less that of the other.
inline Real moments_bound(const CentreLine& line, Real distance, Real radii, Real area, const Lines& a,
                          const Lines& b) {
  const Real inverse = line.inverse_square, odd = distance * inverse;
  const Real third = a.third + b.third, fourth = (a.fourth + b.fourth) + 6.0 * (a.second * b.second);
  const Mask symmetric = third <= 0;
  const Real x = symmetric ? square_of(radii) * inverse : radii * odd;
  const Real series = (1.0 - (symmetric ? splat(0.6) : splat(0.8)) * x) * square_of(1.0 / (1.0 - x));
  const Real rounding =
      kEpsilon * (8.0 * (line.height_a + line.height_b) + 32.0 * line.height_a * line.height_b * (1.0 + odd));
  const Real bound =
      area * (1 / kPi) * (inverse * inverse) * (5.0 * fourth * inverse * series + 4.0 * third * odd + rounding);
  return x < 1.0 ? bound : splat(1e300);
}

/// Bounds of the centres with round moments from the first line alone. Of the fourth order and beyond, with R² at most
/// twice the sum of the squared balls and x² = R² / r², at most 1/4,
///   Σ_{k≥4} (k + 1) mean|δ|^k / r^k  <=  5 mean|δ|⁴ / r⁴ S,  mean|δ|⁴ <= m4 + m4' + 6 m2 m2',  m4 <= R1² m2,
/// S = (1 - 0.6 x²) / (1 - x²)² <= 1 + 2.05 x² where odd orders vanish, (1 - 0.8 x) / (1 - x)² <= 1.11 + 5.2 x²
/// elsewhere. Of the third order 4 T / r³ <= T² / (5 R1² m2 r²) + 20 R1² m2 / r⁴: the first in `beyond`.
struct RoundBounds {
  Real bound, without_beyond;
  Mask holds;
  RoundBounds(const CentreLine& line, Real area, const Spread& a, const Spread& b) {
    const Real inverse = line.inverse_square;
    const Real balls = a.ball_square + b.ball_square, far = 2.0 * balls * inverse;
    const Real series = (a.symmetric & b.symmetric) ? 1.0 + 2.05 * far : 1.11 + 5.2 * far;
    const Real own_a = a.symmetric ? a.ball_square : 5.0 * a.ball_square,
               own_b = b.symmetric ? b.ball_square : 5.0 * b.ball_square;
    const Real fourth =
        even_sum(own_a - own_b, own_a + own_b, a.second - b.second, a.second + b.second) + 6.0 * (a.second * b.second);
    const Real rounding = kEpsilon * (40.0 * (line.height_a + line.height_b) + 64.0 * (line.height_a * line.height_b));
    const Real scale = (area * (1 / kPi)) * (inverse * inverse), left = 5.0 * (inverse * series) * fourth + rounding;
    without_beyond = scale * left;
    bound = scale * (3.0 * (a.beyond + b.beyond) + left);
    holds = far <= 0.25;
  }
};

/// 1 / (1 - x)⁴ or more by x², at most 1/4.
inline Real nearness(Real x_square) {
  return x_square <= 0.01 ? splat(1.53) : x_square <= 0.04 ? splat(2.45) : x_square <= 0.09 ? splat(4.2) : splat(16);
}

/// Whether patches lie in front of the other's plane, behind it or neither, from the first line alone. A patch reaches
/// over the other's plane by at most ± R of its centre's height h, R the ball's radius times the sine between the
/// planes.
struct PlaneSides {
  Mask hidden, in_front;
  Real reach_a_square, reach_b_square, far;
  PlaneSides(const CentreLine& line, const Centre& a, const Centre& b, const Spread& spread_a, const Spread& spread_b) {
    // (x + δ)² <= 1.01 x² + 101 δ², δ = 2 kOpen.
    const Real cosine = dot(a.normal, b.normal), tilt = max(1.01 - 1.01 * (cosine * cosine), splat(0)) + 1e-12;
    reach_a_square = tilt * spread_a.ball_square + 101 * 4 * kOpen * kOpen;
    reach_b_square = tilt * spread_b.ball_square + 101 * 4 * kOpen * kOpen;
    const Real square_a = line.height_a * line.height_a, square_b = line.height_b * line.height_b;
    const Mask certain_a = square_a > reach_a_square, certain_b = square_b > reach_b_square;
    in_front = certain_a & certain_b & (line.height_a > 0) & (line.height_b > 0);
    hidden = (certain_a & (line.height_a < 0)) | (certain_b & (line.height_b < 0));
    far = 2.0 * (spread_a.ball_square + spread_b.ball_square) * line.inverse_square;
  }

  /// What is wrong where heights below a plane are not counted as 0: the mean of what is below is at most (R - h) / 2,
  /// so
  ///   A A' / (π (r - R - R')⁴) ((R - h)⁺ / 2 (|h'| + R') + (R' - h')⁺ / 2 (|h| + R)).
  /// @pre (R + R')² <= `far` r² <= r² / 4, not hidden
  Real crossing_bound(const CentreLine& line, Real area) const {
    const Real reach_a = square_root(reach_a_square), reach_b = square_root(reach_b_square);
    const Real below_a = max(reach_a - line.height_a, splat(0)), below_b = max(reach_b - line.height_b, splat(0));
    const Real other_a = magnitude(line.height_b) + reach_b, other_b = magnitude(line.height_a) + reach_a;
    const Real crossed = even_sum(below_a - below_b, below_a + below_b, other_a - other_b, other_a + other_b);
    return (0.5 / kPi) * area * square_of(line.inverse_square) * nearness(far) * crossed;
  }
};

/// Half of a parallelogram's reach along a direction: of its corners, and of the middles of its edges.
struct Reach {
  Real corner, middle;
  Reach(const Sides& of, Vector direction) {
    const Real u = 0.5 * magnitude(dot(direction, of.e1)), v = 0.5 * magnitude(dot(direction, of.e2));
    corner = u + v, middle = max(u, v);
  }
};

/// A pair of parallelograms: whether each lies in front of the other's plane, and D of docs/form-factors.md.
struct FacingPair {
  Mask in_front;
  Real gap, distance_a, distance_b;  ///< of all points; of the middles of a's edges from b; of b's from a
  FacingPair(const CentreLine& line, Real distance, Real reach, const Centre& a, const Centre& b, const Sides& sides_a,
             const Sides& sides_b) {
    const Real open_a = kSideRounding + sides_a.deviation + sides_a.lever * reach,
               open_b = kSideRounding + sides_b.deviation + sides_b.lever * reach;
    const Reach over_b(sides_a, b.normal), over_a(sides_b, a.normal);
    const Real low_a = line.height_a - over_b.corner, low_b = line.height_b - over_a.corner;
    const Mask rises_a = line.height_a + over_b.corner > open_b, rises_b = line.height_b + over_a.corner > open_a;
    in_front = (low_a >= -open_b) & (low_b >= -open_a) & rises_a & rises_b;
    const Vector way = (distance * line.inverse_square) * line.between;
    const Reach along_a(sides_a, way), along_b(sides_b, way);
    gap = max(distance - (along_a.corner + along_b.corner), max(low_a, low_b));
    distance_a = max(max(distance - (along_a.middle + along_b.corner), gap), line.height_a - over_b.middle);
    distance_b = max(max(distance - (along_a.corner + along_b.middle), gap), line.height_b - over_a.middle);
  }
};

/// Of m = 2, 4, 6, 8 points on every edge of two parallelograms the least whose bound, coefficient q^m E / D², meets
/// `limit`, as kEdges + m, and the bound; else kUnsettled.
/// @param mean  where known, in place of 1 / D
/// @param few  where 2 points may be taken: nearer by, so few pairs would that it does not pay to sort them
inline void choose_far_edges(Real coefficient, Real half_edge_square, Real inverse, const MeanPower* mean, Real limit,
                             Mask asked, Mask few, const EdgeRule* edge_rules, Real& choice, Real& bound) {
  const Real q = half_edge_square * square_of(inverse), step = q * q;
  Real power = coefficient * square_of(inverse), centre = splat(0), step_centre = splat(0);
  if (mean != nullptr) {
    const Real centre_square = square_of(mean->inverse_centre);
    step_centre = square_of(half_edge_square * centre_square);
    power *= mean->weight;
    centre = coefficient * (1.0 - mean->weight) * centre_square;
  }
  choice = splat(kUnsettled);
  bound = splat(0);
  const double most = 0.25;
  Mask open = asked & (inverse > 0) & (q < most);
  for (int half = 1; half <= 4 && any(open); ++half) {
    power *= step;
    if (mean != nullptr) centre *= step_centre;
    const Real left =
        (mean != nullptr ? power + centre : power) * taylor_error(edge_rules[half], true, q, splat(1 / (1 - most)));
    Mask take = open & (left <= limit);
    if (half == 1) take = take & few;
    choice = take ? splat(double{kEdges} + 2 * half) : choice;
    bound = take ? left : bound;
    open = open & ~take;
  }
}

/// Points on the edges of parallelograms that stand some 2.5 sizes apart, from the first line alone: with the sides
/// e1, e2, mean |x - centre|² = (|e1|² + |e2|²) / 12 and `beyond` at least the difference of the principal moments,
///   h² <= 3/2 (second + beyond),  |e1·e2| <= 6 beyond,  sides <= area + 9 beyond,
/// D >= r - h - ball', and (h + ball')² <= 2 (h² + ball'²).
struct FarEdges {
  Mask holds;  ///< r - D <= r / 2, R <= 0.6 r, and rounding alone does not exceed the limit
  Real half_edge_square, reach_square, rounding;
  FarEdges(const CentreLine& line, const Spread& a, const Spread& b, Real limit)
      : half_edge_square(1.5 * max(a.second + a.beyond, b.second + b.beyond)),
        reach_square(2.0 * (half_edge_square + max(a.ball_square, b.ball_square))) {
    // Σ |e·f| <= 12 (m + m'); the farthest points ((1 + x) / (1 - x))² as far as the nearest. Taken for parallelograms:
    // 32 ε h².
    const Real x_square = 2.0 * (a.ball_square + b.ball_square) * line.inverse_square;
    const Real ratio = x_square <= 0.01   ? splat(1.5)
                       : x_square <= 0.04 ? splat(2.25)
                       : x_square <= 0.09 ? splat(3.5)
                                          : splat(16);
    rounding =
        kEpsilon * ((kEdgeRoundings * (2 / kPi) * 12) * ratio * (a.second + b.second) + 128.0 * half_edge_square);
    holds = a.symmetric & b.symmetric & (reach_square * line.inverse_square <= 0.25) & (x_square <= 0.36) &
            (rounding < limit);
  }
  void choose(const CentreLine& line, const Centre& a, const Centre& b, const Spread& spread_a, const Spread& spread_b,
              Real limit, Mask asked, const EdgeRule* edge_rules, Real& choice, Real& bound) const {
    const Real distance = square_root(line.square) - square_root(reach_square);
    const Real turned = (4 / kPi) * (0.5 + 0.25 * square_of(dot(a.normal, b.normal))) *
                        ((a.area + 9.0 * spread_a.beyond) * (b.area + 9.0 * spread_b.beyond));
    choose_far_edges(turned, half_edge_square, 1.0 / distance, nullptr, limit - rounding, asked,
                     reach_square * line.inverse_square <= 0.06, edge_rules, choice, bound);
    bound += rounding;
  }
};

}  // namespace
}  // namespace interglow::radiosity::batch
