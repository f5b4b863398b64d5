// SPDX-License-Identifier: GPL-3.0-or-later
// The choice of a rule for each pair, included once for each instruction set (batch_kernel_source.h).
#pragma once

#include "radiosity/batch_edges.h"
#include "radiosity/batch_shapes.h"

namespace interglow::radiosity::batch {
namespace {

/// Reach of a patch along a direction: of its corners and of the middles of its edges.
struct Extent {
  Real low, high, middle_low, middle_high;
  /// @param at_centre  the centre's
  /// @param general  whether any lane holds no parallelogram
  Extent(const Shape& of, Vector direction, Real at_centre, Vector centre, Mask parallelogram, bool general) {
    const Real u = dot(direction, of.e1), v = dot(direction, of.e2);
    const Real along_u = 0.5 * magnitude(u), along_v = 0.5 * magnitude(v);
    const Real corner = along_u + along_v, middle = max(along_u, along_v);
    low = at_centre - corner, high = at_centre + corner;
    middle_low = at_centre - middle, middle_high = at_centre + middle;
    if (!general) return;
    const Real uv = dot(direction, of.e3);
    const Real a = at_centre + dot(direction, of.origin - centre), b = a + u, c = a + v, d = b + v + uv;
    const Real ab = a + b, bd = b + d, dc = d + c, ca = c + a;
    low = parallelogram ? low : min(min(a, b), min(c, d));
    high = parallelogram ? high : max(max(a, b), max(c, d));
    middle_low = parallelogram ? middle_low : 0.5 * min(min(ab, bd), min(dc, ca));
    middle_high = parallelogram ? middle_high : 0.5 * max(max(ab, bd), max(dc, ca));
  }
};

constexpr int kLoosePoints = 12;        ///< up to as many it does not pay to sharpen the bound
constexpr double kEdgeRoundings = 4.0;  ///< of the squared distances that may gather in their mean logarithm

/// Σ_{k >= 2m} of |k-th Taylor coefficient| times the rule's error of x^k, over q^m, of coefficients (k + 1) q^(k/2)
/// (`growing`) or q^(k/2): orders 2m ... 2m + 6 by their errors, then errors of at most 1/(k + 1).
/// @param tail  1 / (1 - q) or more
inline Real taylor_error(const EdgeRule& rule, bool growing, Real q, Real tail) {
  const int k = 4 * rule.half;
  Real sum = growing ? tail : tail * (1.0 / (k + 2 * kErrors + 1));
  for (int j = kErrors - 1; j >= 0; --j) sum = sum * q + rule.error[j] * (growing ? k + 2 * j + 1 : 1);
  return sum;
}

/// What bounds the rules of m points on every edge, both patches taken for the one that is worse off
/// (docs/form-factors.md):
///   near  coupling (1 + 1/(4m² - 1)) / m 2 ρ^-2m / (1 - ρ^-2), whichever edges these are,
///   far   for parallelograms, whose opposite edges cancel, turned 2 q^m E / D², else swept q^m E' / D and the error
///         of errors,
/// with D the distance of the middles of a patch's edges from the other patch, q the square of the longest half edge
/// over D, ρ the ellipse that this leaves free of singularities, and E, E' of `taylor_error`.
struct EdgeBounds {
  Real coupling, turned;  ///< Σ |e·f| / 2π over all edges; the same over sides, times the other sides' lengths
  Real swept;             ///< perimeter times the other's area / 2π, of both
  Mask parallelograms;    ///< both are
  Real distance;          ///< D
  Real ratio;             ///< D over the longest half edge, squared
  Real near_ratio;        ///< the same, or of the edges alone
};

/// Least number m of points on every edge that meets `limit`, as kEdges + m, and the bound; kContour where none does.
inline void choose_edges(const EdgeBounds& of, Real limit, Mask asked, const EdgeRule* edge_rules, Real& choice,
                         Real& bound) {
  const double none = 1e300;
  const Real near_ratio = max(of.near_ratio, splat(1.01));
  const Real squared_rho = 2.0 * near_ratio - 1.0 + 2.0 * square_root(near_ratio * (near_ratio - 1.0));
  const Real inverse = 1.0 / (squared_rho * (squared_rho - 1.0));
  const Real step_near = square_of((squared_rho - 1.0) * inverse);
  Real near = of.near_ratio > 1.01 ? 2.0 * of.coupling * (squared_rho * squared_rho) * inverse : splat(none);
  const Real ratio = max(of.ratio, splat(1.5)), inverse_ratios = 1.0 / (ratio * (ratio - 1.0));
  const Real q = (ratio - 1.0) * inverse_ratios, tail = (ratio * ratio) * inverse_ratios, step_far = q * q;
  const Real closeness = 1.0 / max(of.distance, splat(1e-100));
  Real far = of.parallelograms ? 2.0 * of.turned * closeness * closeness : of.swept * closeness;
  far = of.ratio > 1.5 ? far : splat(none);
  const bool any_other = any(~of.parallelograms);
  Real squared = splat(0), step_both = splat(0);
  if (any_other) {
    const Real both = 2.0 * square_root(q), both_4 = (both * both) * (both * both);
    step_both = both_4 * both_4;
    squared = both < 0.9 ? of.coupling / (1.0 - min(both, splat(0.9))) : splat(none);
  }
  choice = splat(kContour);
  bound = splat(0);
  Mask open = asked;
  for (int half = 1; half <= kMaxEdgePoints / 2; ++half) {
    const int m = 2 * half;
    near *= step_near;
    far *= step_far;
    squared *= step_both;
    if (half > 6 && half % 2 != 0) continue;
    Real far_left = far * taylor_error(edge_rules[half], true, q, tail);
    if (any_other) {
      const Real swept_left = far * taylor_error(edge_rules[half], false, q, tail) +
                              squared * (1.0 / (4.0 * m * (2 * m + 1) * (2 * m + 1)));
      far_left = of.parallelograms ? far_left : swept_left;
    }
    const Real left = min((1 + 1.0 / (4.0 * m * m - 1)) / m * near, far_left);
    const Mask take = open & (left <= limit);
    choice = take ? splat(double{kEdges} + m) : choice;
    bound = take ? left : bound;
    open = open & ~take;
    if (!any(open)) break;
  }
}

/// Of the product rules of 2 ... 5 points per direction the least whose bound 4 coefficient Σ_{k >= 2m} ((k + 1) s^k +
/// skew k s^(k - 1)) e_k meets `limit`, as kProduct + m, and the bound; kContour where none does. A patch is met along
/// straight lines of at most twice `half_edge`, about whose middles the kernel has the Taylor coefficients (k + 1) / (π
/// gap^(k + 2)); a quad's density rises by at most `skew` of its middle value to either end.
inline void choose_product(Real coefficient, Real s, Real skew, Real limit, const ProductRule* rules, Real& choice,
                           Real& bound) {
  choice = splat(kContour);
  bound = splat(0);
  Mask open = s < 0.5;
  const Real inverse = 1.0 / max(s, splat(1e-100)), end = 1.0 / square_of(1.0 - min(s, splat(0.5)));
  const Real over = 1.0 + skew * inverse, square = s * s;
  Real power = 4.0 * coefficient * square * over;
  for (int m = 2; m <= 5 && any(open); ++m) {
    power *= square;
    Real sum = end * (2.0 * m + kProductErrors + 1);
    for (int j = kProductErrors - 1; j >= 0; --j) sum = sum * s + rules[m].error[j] * (2.0 * m + j + 1);
    const Real left = power * sum;
    const Mask take = open & (left <= limit);
    choice = take ? splat(double{kProduct} + m) : choice;
    bound = take ? left : bound;
    open = open & ~take;
  }
}

/// Whether a product rule takes less time than an edge rule of patches of any shape.
inline Mask product_is_cheaper(Real product, Real edges) {
  const Real points = product - double{kProduct};
  return (product > splat(kContour)) &
         ((points <= 3) | (edges == splat(kContour)) | (edges > 2.0 * points - 5.0 + double{kEdges}));
}

/// Least squared distances of the middles of edges from the other patch's edges over the squared half edges: of edges
/// that are not at right angles, for those do not count; the least squared distance, and Σ |e·f|.
struct EdgeDistances {
  Real ratio_a, ratio_b, least, cosines;
  EdgeDistances(const Outline& a, const Outline& b, Real negligible) {
    ratio_a = ratio_b = least = splat(1e100);
    cosines = splat(0);
    const Vector origins = a.origin - b.origin;
    Real a_squared[4], b_squared[4];
    for (int i = 0; i < 4; ++i) {
      a_squared[i] = max(dot(a.half[i], a.half[i]), splat(1e-200));
      b_squared[i] = max(dot(b.half[i], b.half[i]), splat(1e-200));
    }
    const auto clamped = [](Real t) { return max(min(t, splat(1)), splat(-1)); };
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j) {
        const Real cosine = magnitude(dot(a.half[i], b.half[j]));
        cosines += 4.0 * cosine;
        const Mask counts = cosine > negligible;
        if (!any(counts)) continue;
        const Vector w = origins + (a.middle[i] - b.middle[j]);
        const Vector from_a = w - clamped(dot(w, b.half[j]) / b_squared[j]) * b.half[j];
        const Vector from_b = w + clamped(-dot(w, a.half[i]) / a_squared[i]) * a.half[i];
        const Real square_a = dot(from_a, from_a), square_b = dot(from_b, from_b);
        ratio_a = counts ? min(ratio_a, square_a / a_squared[i]) : ratio_a;
        ratio_b = counts ? min(ratio_b, square_b / b_squared[j]) : ratio_b;
        least = counts ? min(least, min(square_a, square_b)) : least;
      }
  }
};

/// Bounds of the rules without points on edges. |k-th Taylor coefficient of the kernel| <= (k + 1) / (π r^(k + 2)):
/// what begins with order k = 2, 4 and moves by at most R leaves (k + 1) mean|δ|^k / (π r^(k+2)) times 1 / (1 - x)²,
/// x = R / r, or (1 - (k - 1) / (k + 1) x²) / (1 - x²)² where odd orders vanish; δ the move of one patch less that of
/// the other.
struct CentreBounds {
  Real by_centres, by_moments;
  CentreBounds(const CentreLine& line, Real distance, Real radii, Real area, Real second, Real fourth, Real third,
               Mask symmetric) {
    const Real inverse = line.inverse_square, inverse_fourth = inverse * inverse;
    const Real far = square_of(radii) * inverse;
    const Real series = square_of(1.0 / (symmetric ? 1.0 - far : 1.0 - radii * (distance * inverse)));
    const Real in_second = symmetric ? 1.0 - (1.0 / 3) * far : splat(1),
               in_fourth = symmetric ? 1.0 - 0.6 * far : splat(1);
    const Real tail = area * (1 / kPi) * inverse_fourth * series;
    const Real rounding =
        area * (1 / kPi) * kEpsilon * inverse_fourth *
        (8.0 * (line.height_a + line.height_b) + 32.0 * line.height_a * line.height_b * (1.0 + distance * inverse));
    by_centres = 3.0 * second * in_second * tail + rounding;
    by_moments = 5.0 * fourth * in_fourth * tail * inverse +
                 4 / kPi * area * third * inverse_fourth * distance * inverse + rounding;
  }
};

void classify(const PatchRecord* const* first, const PatchRecord* const* second, int count, double tolerance,
              const EdgeRule* edge_rules, const ProductRule* product_rules, std::int32_t* choices,
              double* bounds_found) {
  for (int start = 0; start < count; start += kLanes) {
    const int lanes_used = count - start < kLanes ? count - start : kLanes;
    const Lanes first_lanes(first + start, lanes_used), second_lanes(second + start, lanes_used);
    const Centre a(first_lanes), b(second_lanes);
    const Sizes sizes_a(first_lanes), sizes_b(second_lanes);
    const Shape shape_a(first_lanes), shape_b(second_lanes);
    CentreLine line(a, b);
    line.divide(a, b, 1.0 / max(line.square, splat(1e-280)));
    const Real distance = square_root(line.square), radii = shape_a.radius + shape_b.radius;
    const Real area = a.area * b.area, limit = tolerance * min(a.area, b.area);
    const Real reach = distance + radii;
    const Real open_a = kSideRounding + shape_a.deviation + shape_a.lever * reach,
               open_b = kSideRounding + shape_b.deviation + shape_b.lever * reach;
    const Mask regular_a = sizes_a.parallelogram, regular_b = sizes_b.parallelogram;
    const bool general_a = any(~regular_a), general_b = any(~regular_b);
    const Extent over_b(shape_a, b.normal, line.height_a, a.centre, regular_a, general_a),
        over_a(shape_b, a.normal, line.height_b, b.centre, regular_b, general_b);
    const Mask hidden = (over_b.high < -open_b) | (over_a.high < -open_a) |
                        ((over_b.high <= open_b) & (over_b.low >= -open_b) & (over_a.high <= open_a) &
                         (over_a.low >= -open_a) & (dot(a.normal, b.normal) > 0)) |
                        (area <= 0);
    // Corners on the other's plane within rounding need no clipping: what is wrong by it is no more than that.
    const Mask in_front =
        (over_b.low >= -open_b) & (over_a.low >= -open_a) & (over_b.high > open_b) & (over_a.high > open_a);
    // Distances of points by the heights over either plane and along the line of centres; the largest holds.
    const Vector way = (distance * line.inverse_square) * line.between;
    const Extent along_a(shape_a, way, splat(0), a.centre, regular_a, general_a),
        along_b(shape_b, way, distance, b.centre, regular_b, general_b);
    const Real gap = max(along_b.low - along_a.high, max(over_a.low, over_b.low));
    const CentreBounds centre_bounds(line, distance, radii, area, sizes_a.second + sizes_b.second,
                                     (sizes_a.fourth + sizes_b.fourth) + 6.0 * (sizes_a.second * sizes_b.second),
                                     shape_a.third + shape_b.third, regular_a & regular_b);
    const Mask apart = in_front & (distance > radii);
    const Mask centres = apart & (centre_bounds.by_centres <= limit),
               moments = apart & (centre_bounds.by_moments <= limit) & ~centres;
    const Mask asked = in_front & ~hidden & ~centres & ~moments;
    Real choice = centres ? splat(kCentres) : splat(kMoments);
    Real bound = centres ? centre_bounds.by_centres : centre_bounds.by_moments;
    if (any(asked)) {
      const Real distance_a = max(max(along_b.low - along_a.middle_high, gap), max(over_a.low, over_b.middle_low)),
                 distance_b = max(max(along_b.middle_low - along_a.high, gap), max(over_b.low, over_a.middle_low));
      EdgeBounds bounds;
      bounds.distance = max(min(distance_a, distance_b), splat(0));
      bounds.ratio =
          square_of(max(min(distance_a * shape_a.inverse_half_edge, distance_b * shape_b.inverse_half_edge), splat(0)));
      bounds.near_ratio = bounds.ratio;
      bounds.parallelograms = regular_a & regular_b;
      const Real cosines = (magnitude(dot(shape_a.e1, shape_b.e1)) + magnitude(dot(shape_a.e1, shape_b.e2))) +
                           (magnitude(dot(shape_a.e2, shape_b.e1)) + magnitude(dot(shape_a.e2, shape_b.e2)));
      bounds.coupling =
          bounds.parallelograms ? (2 / kPi) * cosines : 1 / (2 * kPi) * (sizes_a.perimeter * sizes_b.perimeter);
      bounds.turned =
          (2 / kPi) * min((0.5 + 0.25 * square_of(dot(a.normal, b.normal))) * (sizes_a.sides * sizes_b.sides),
                          cosines * (sizes_a.half_edge * sizes_b.half_edge));
      bounds.swept = 1 / (2 * kPi) * (sizes_a.perimeter * b.area + sizes_b.perimeter * a.area);
      // Of a squared distance: roundings of the sum of the moduli of its terms, which `reach` bounds.
      const auto rounding_at = [&](Real least) {
        return kEdgeRoundings * kEpsilon * bounds.coupling * square_of(reach / max(least, 1e-10 * reach)) +
               sizes_a.skew + sizes_b.skew;
      };
      Real least = max(gap, max(distance_a - sizes_a.half_edge, distance_b - sizes_b.half_edge));
      Real rounding = rounding_at(least);
      Real by_edges, edge_bound;
      choose_edges(bounds, limit - rounding, asked, edge_rules, by_edges, edge_bound);
      // kContour where no number of points is enough.
      const Mask loose = asked & ((by_edges == splat(kContour)) | (by_edges > splat(double{kEdges} + kLoosePoints)));
      if (any(loose)) {
        // The true distances cost as much as some points on the edges.
        const EdgeDistances distances(Outline{shape_a}, Outline{shape_b}, 1e-6 * limit);
        bounds.near_ratio = max(bounds.ratio, min(distances.ratio_a, distances.ratio_b));
        bounds.coupling = min(bounds.coupling, 1 / (2 * kPi) * distances.cosines);
        const Real share = square_root(1.0 / max(bounds.near_ratio, splat(1)));
        least = max(least, square_root(distances.least) * (1.0 - share));
        const Real sharper_rounding = rounding_at(least);
        Real sharper, sharper_bound;
        choose_edges(bounds, limit - sharper_rounding, loose, edge_rules, sharper, sharper_bound);
        by_edges = loose ? sharper : by_edges;
        edge_bound = loose ? sharper_bound : edge_bound;
        rounding = loose ? sharper_rounding : rounding;
      }
      by_edges = (~bounds.parallelograms & (by_edges > splat(kEdges))) ? by_edges + 1.0 : by_edges;
      choice = asked ? by_edges : choice;
      bound = asked ? edge_bound + rounding : bound;
      const Mask general = asked & ~bounds.parallelograms & (gap > 0);
      if (any(general)) {
        const Real inverse_gap = 1.0 / max(gap, splat(1e-100)), coefficient = area * (1 / kPi) * square_of(inverse_gap);
        const Real s = max(sizes_a.half_edge, sizes_b.half_edge) * inverse_gap;
        const Real product_rounding =
            coefficient * square_of(inverse_gap) * kEpsilon *
            (40.0 * (over_b.high + over_a.high) + 64.0 * over_b.high * over_a.high * (1.0 + inverse_gap));
        Real by_product, product_bound;
        choose_product(coefficient, s, max(density_skew(first_lanes), density_skew(second_lanes)),
                       limit - product_rounding, product_rules, by_product, product_bound);
        const Mask cheaper = general & product_is_cheaper(by_product, by_edges);
        choice = cheaper ? by_product : choice;
        bound = cheaper ? product_bound + product_rounding : bound;
      }
    }
    // The height of the visible parts bounds what a clamped rule can miss where one plane cuts the other patch.
    const Real inverse_gap = 1.0 / (gap * gap);
    const Real crossing =
        max(over_b.high, splat(0)) * max(over_a.high, splat(0)) * inverse_gap * inverse_gap * area * (1 / kPi);
    const Mask cut = ~in_front & (gap > 0) & (crossing <= limit);
    choice = in_front ? choice : (cut ? splat(kCut) : splat(kContour));
    bound = cut ? crossing : bound;
    choice = hidden ? splat(kNothing) : choice;
    store(choices + start, choice, lanes_used);
    store(bounds_found + start, bound, lanes_used);
  }
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

/// Of m = 2, 4, 6, 8 points on every edge of two parallelograms the least whose bound coefficient q^m E / D² meets
/// `limit`, as kEdges + m, and the bound; else kUnsettled.
/// @param few  where 2 points may be taken: nearer by, so few pairs of a vector would that it does not pay to sort them
inline void choose_far_edges(Real coefficient, Real half_edge_square, Real inverse, Real limit, Mask asked, Mask few,
                             const EdgeRule* edge_rules, Real& choice, Real& bound) {
  const Real q = half_edge_square * square_of(inverse), step = q * q;
  choice = splat(kUnsettled);
  bound = splat(0);
  const double most = 0.25;
  Mask open = asked & (inverse > 0) & (q < most);
  Real power = coefficient * square_of(inverse);
  for (int half = 1; half <= 4 && any(open); ++half) {
    power *= step;
    const Real left = power * taylor_error(edge_rules[half], true, q, splat(1 / (1 - most)));
    Mask take = open & (left <= limit);
    if (half == 1) take = take & few;
    choice = take ? splat(double{kEdges} + 2 * half) : choice;
    bound = take ? left : bound;
    open = open & ~take;
  }
}

/// By the first line and the sides, where both are parallelograms; kUnsettled for all others.
void choose(const PatchRecord* const* first, const PatchRecord* const* second, int count, double tolerance,
            const EdgeRule* edge_rules, std::int32_t* choices, double* bounds) {
  for (int start = 0; start < count; start += kLanes) {
    const int lanes_used = count - start < kLanes ? count - start : kLanes;
    const Lanes first_lanes(first + start, lanes_used), second_lanes(second + start, lanes_used);
    const Centre a(first_lanes), b(second_lanes);
    const Sides sides_a(first_lanes), sides_b(second_lanes);
    const Spread spread_a(a.spread), spread_b(b.spread);
    if (!any(spread_a.symmetric & spread_b.symmetric)) {
      store(choices + start, splat(kUnsettled), lanes_used);
      continue;
    }
    CentreLine line(a, b);
    line.divide(a, b, 1.0 / max(line.square, splat(1e-280)));
    const Real distance = square_root(line.square), limit = tolerance * min(a.area, b.area);
    const FacingPair pair(line, distance, 8.0 + splat(0), a, b, sides_a, sides_b);
    const Mask facing = spread_a.symmetric & spread_b.symmetric & pair.in_front & (a.area * b.area > 0);
    // All but what `beyond` bounds is left by the true moments.
    const RoundBounds round(line, a.area * b.area, spread_a, spread_b);
    const Mask moments = facing & round.holds & (round.without_beyond <= limit);
    const Real squares_a[2] = {dot(sides_a.e1, sides_a.e1), dot(sides_a.e2, sides_a.e2)},
               squares_b[2] = {dot(sides_b.e1, sides_b.e1), dot(sides_b.e2, sides_b.e2)};
    const Real d11 = magnitude(dot(sides_a.e1, sides_b.e1)), d12 = magnitude(dot(sides_a.e1, sides_b.e2)),
               d21 = magnitude(dot(sides_a.e2, sides_b.e1)), d22 = magnitude(dot(sides_a.e2, sides_b.e2));
    const Real cosines = (d11 + d12) + (d21 + d22);
    // Twice Σ |e·f| |e'| |f'| / 2π, the product of two lengths at most half the sum of their squares.
    const Real turned = (1 / (2 * kPi)) * ((d11 * (squares_a[1] + squares_b[1]) + d12 * (squares_a[1] + squares_b[0])) +
                                           (d21 * (squares_a[0] + squares_b[1]) + d22 * (squares_a[0] + squares_b[0])));
    const Real longest = max(max(squares_a[0], squares_a[1]), max(squares_b[0], squares_b[1]));
    // One division for two. (r + R)² <= 5/4 r² + 5 R².
    const Real middles = max(min(pair.distance_a, pair.distance_b), splat(1e-100)),
               gap = max(pair.gap, 1e-10 * distance);
    const Real inverse_both = 1.0 / (middles * gap);
    const Real reach_square = 1.25 * line.square + 10.0 * (spread_a.ball_square + spread_b.ball_square);
    const Real rounding =
        kEdgeRoundings * kEpsilon * (2 / kPi) * cosines * reach_square * square_of(middles * inverse_both) +
        32 * kEpsilon * longest;
    Real choice, bound;
    choose_far_edges(turned, 0.25 * longest, gap * inverse_both, limit - rounding, facing & ~moments, Mask{},
                     edge_rules, choice, bound);
    choice = moments ? splat(kMoments) : choice;
    bound = moments ? round.without_beyond : bound + rounding;
    store(choices + start, choice, lanes_used);
    store(bounds + start, bound, lanes_used);
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
    // Σ |e·f| <= 12 (m + m'); the farthest points four times as far as the nearest. Taken for parallelograms: 32 ε h².
    rounding = kEpsilon * ((kEdgeRoundings * (2 / kPi) * 12 * 16) * (a.second + b.second) + 128.0 * half_edge_square);
    holds = a.symmetric & b.symmetric & (reach_square * line.inverse_square <= 0.25) &
            (2.0 * (a.ball_square + b.ball_square) * line.inverse_square <= 0.36) & (rounding < limit);
  }
  void choose(const CentreLine& line, const Centre& a, const Centre& b, const Spread& spread_a, const Spread& spread_b,
              Real limit, Mask asked, const EdgeRule* edge_rules, Real& choice, Real& bound) const {
    const Real distance = square_root(line.square) - square_root(reach_square);
    const Real turned = (4 / kPi) * (0.5 + 0.25 * square_of(dot(a.normal, b.normal))) *
                        ((a.area + 9.0 * spread_a.beyond) * (b.area + 9.0 * spread_b.beyond));
    choose_far_edges(turned, half_edge_square, 1.0 / distance, limit - rounding, asked,
                     reach_square * line.inverse_square <= 0.06, edge_rules, choice, bound);
    bound += rounding;
  }
};

void settle(const PatchRecord* records, std::uint32_t one, const std::uint32_t* others, int count, double tolerance,
            double square_unit, const EdgeRule* edge_rules, Result* results, OpenPairs& open) {
  const Lanes one_lanes(records + one);
  const Centre a(one_lanes);
  const Spread spread_a(a.spread);
  open.count = 0;
  for (int start = 0; start < count; start += kLanes) {
    const int lanes_used = count - start < kLanes ? count - start : kLanes;
    const Lanes other_lanes(records, others + start, lanes_used);
    const Centre b(other_lanes);
    const Spread spread_b(b.spread);
    CentreLine line(a, b);
    line.divide(a, b, 1.0 / line.square);
    const Real area = a.area * b.area, least_area = min(a.area, b.area), limit = tolerance * least_area;
    const RoundBounds round(line, area, spread_a, spread_b);
    const Mask far = round.holds & (round.bound <= limit) & (area > 0);
    const Real square_a = line.height_a * line.height_a, square_b = line.height_b * line.height_b;
    Mask in_front = (line.height_a > 0) & (line.height_b > 0) & (square_a > spread_a.ball_square) &
                    (square_b > spread_b.ball_square);
    Mask settled = far & in_front;
    Real value = line.with_round_moments(a, b, spread_a.second, spread_b.second), bound = round.bound;
    Bits method = Bits{} + kFarMethod;
    if (any(~settled)) {
      const Mask hidden = ((line.height_a < 0) & (square_a > spread_a.ball_square)) |
                          ((line.height_b < 0) & (square_b > spread_b.ball_square)) | (area <= 0);
      value = hidden ? splat(0) : value;
      bound = hidden ? splat(0) : bound;
      method = hidden ? Bits{} + kZeroMethod : method;
      settled = settled | hidden;
      const FarEdges far_edges(line, spread_a, spread_b, limit);
      const Mask at_plane = (far | far_edges.holds) & spread_a.symmetric & spread_b.symmetric & ~in_front & ~settled;
      if (any(at_plane)) {  // as along the edges of a room
        const Real distance = square_root(line.square);
        const FacingPair pair(line, distance, 1.5 * distance, a, b, Sides(one_lanes), Sides(other_lanes));
        in_front = in_front | (at_plane & pair.in_front);
        settled = settled | (far & in_front);
      }
      Real choice = splat(kUnsettled), edge_bound = splat(0);
      // What the true moments leave is told by `choose`.
      const Mask asked = far_edges.holds & in_front & ~settled & (round.without_beyond > limit);
      if (any(asked)) far_edges.choose(line, a, b, spread_a, spread_b, limit, asked, edge_rules, choice, edge_bound);
      const double points = choice[0];
      if (points > double{kEdges} && !any(choice != points)) {  // need not be sorted
        // The lower index comes first, whichever way the pair is asked for: the same bits for (i, j) and (j, i).
        const PatchRecord *first[kLanes], *second[kLanes];
        for (int lane = 0; lane < kLanes; ++lane) {
          const PatchRecord *other = other_lanes.record[lane], *this_one = records + one;
          first[lane] = other < this_one ? other : this_one;
          second[lane] = other < this_one ? this_one : other;
        }
        value = edges_of_parallelograms(Lanes(first, kLanes), Lanes(second, kLanes),
                                        edge_rules[(static_cast<int>(points) - kEdges) / 2]);
        bound = edge_bound;
        method = Bits{} + kEdgeMethod;
      } else {
        store(open.choice + open.count, choice, lanes_used);
        store(open.bound + open.count, edge_bound, lanes_used);
        if (!any(settled)) {
          for (int lane = 0; lane < lanes_used; ++lane) open.place[open.count + lane] = start + lane;
          open.count += lanes_used;
          continue;
        }
        for (int lane = 0; lane < lanes_used; ++lane) {
          open.place[open.count] = start + lane;
          open.choice[open.count] = static_cast<std::int32_t>(choice[lane]);
          open.bound[open.count] = edge_bound[lane];
          open.count += settled[lane] == 0 ? 1 : 0;
        }
      }
    }
    value = square_unit * min(max(value, splat(0)), least_area);
    store_rows(results + start, value, square_unit * bound, reinterpret_cast<Real>(method), lanes_used);
  }
}

}  // namespace
}  // namespace interglow::radiosity::batch
