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

constexpr double gauss_error(int points) {  // of x^2m by m points on [-1, 1], over the length
  double error = 1.0 / (2 * points + 1);
  for (int k = 1; k <= points; ++k) error *= 4.0 * k * k / (double(points + k) * (points + k));
  return error;
}

constexpr int kLoosePoints = 12;        ///< up to as many it does not pay to sharpen the bound
constexpr double kHopefulShare = 0.3;   ///< of a far bound, that sharper distances and directions may leave
constexpr double kEdgeRoundings = 4.0;  ///< of the squared distances that may gather in their mean logarithm

constexpr auto kGaussError = [] {
  struct Table {
    double at[kMaxEdgePoints / 2 + 1];
    constexpr double operator[](int half) const { return at[half]; }
  } errors{};
  for (int half = 1; half <= kMaxEdgePoints / 2; ++half) errors.at[half] = gauss_error(2 * half);
  return errors;
}();

/// What bounds the rules of m points on every edge, both patches taken for the one that is worse off
/// (docs/form-factors.md):
///   near  coupling (1 + 1/(4m² - 1)) / m 2 ρ^-2m / (1 - ρ^-2), whichever edges these are,
///   far   for parallelograms, whose opposite edges cancel, turned 2 q^m ((2m + 1) e + q / (1 - q)) / D²,
///         else swept q^m (e + q / ((2m + 3) (1 - q))) / D and the error of errors,
/// with D the distance of the middles of a patch's edges from the other patch, q the square of the longest half edge
/// over D, ρ the ellipse that this leaves free of singularities, and e = gauss_error(m).
struct EdgeBounds {
  Real coupling, turned;  ///< Σ |e·f| / 2π over all edges; the same over sides, times the other sides' lengths
  Real swept;             ///< perimeter times the other's area / 2π, of both
  Mask parallelograms;    ///< both are
  Real distance;          ///< D
  Real ratio;             ///< D over the longest half edge, squared
  Real near_ratio;        ///< the same, or of the edges alone
};

/// Least number m of points on every edge that meets `limit`, as kEdges + m, and the bound; kContour where none does.
inline void choose_edges(const EdgeBounds& of, Real limit, Mask asked, Real& choice, Real& bound) {
  const double none = 1e300;
  const Real near_ratio = max(of.near_ratio, splat(1.01));
  const Real squared_rho = 2.0 * near_ratio - 1.0 + 2.0 * square_root(near_ratio * (near_ratio - 1.0));
  const Real inverse = 1.0 / (squared_rho * (squared_rho - 1.0));
  const Real step_near = square_of((squared_rho - 1.0) * inverse);
  Real near = of.near_ratio > 1.01 ? 2.0 * of.coupling * (squared_rho * squared_rho) * inverse : splat(none);
  const Real ratio = max(of.ratio, splat(1.5)), inverse_ratios = 1.0 / (ratio * (ratio - 1.0));
  const Real q = (ratio - 1.0) * inverse_ratios, tail = ratio * inverse_ratios, step_far = q * q;
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
    const double e = kGaussError[half];
    Real far_left = far * ((2 * m + 1) * e + tail);
    if (any_other) {
      const Real swept_left =
          far * (e + tail * (1.0 / (2 * m + 3))) + squared * (1.0 / (4.0 * m * (2 * m + 1) * (2 * m + 1)));
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

/// Least squared distances of the middles of edges from the other patch's edges over the squared half edges: of edges
/// that are not at right angles, for those do not count; and the least squared distance.
struct EdgeDistances {
  Real ratio_a, ratio_b, least;
  EdgeDistances(const Outline& a, const Outline& b, Real negligible) {
    ratio_a = ratio_b = least = splat(1e100);
    const Vector origins = a.origin - b.origin;
    Real a_squared[4], b_squared[4];
    for (int i = 0; i < 4; ++i) {
      a_squared[i] = max(dot(a.half[i], a.half[i]), splat(1e-200));
      b_squared[i] = max(dot(b.half[i], b.half[i]), splat(1e-200));
    }
    const auto clamped = [](Real t) { return max(min(t, splat(1)), splat(-1)); };
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j) {
        const Mask counts = magnitude(dot(a.half[i], b.half[j])) > negligible;
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
/// what begins with order k = 2, 4 and moves by at most R leaves (k + 1) mean|δ|^k / (π r^k (r - R)²), δ the move of
/// one patch less that of the other.
struct CentreBounds {
  Real by_centres, by_moments;
  CentreBounds(const CentreLine& line, Real distance, Real inverse_gap, Real area, Real second, Real fourth,
               Real third) {
    const Real inverse = line.inverse_square, inverse_fourth = inverse * inverse;
    const Real tail = area * (1 / kPi) * inverse * square_of(inverse_gap);
    const Real rounding =
        area * (1 / kPi) * kEpsilon * inverse_fourth *
        (8.0 * (line.height_a + line.height_b) + 32.0 * line.height_a * line.height_b * (1.0 + distance * inverse));
    by_centres = 3.0 * second * tail + rounding;
    by_moments =
        5.0 * fourth * tail * inverse + 4 / kPi * area * third * inverse_fourth * distance * inverse + rounding;
  }
};

void classify(const PatchRecord* const* first, const PatchRecord* const* second, int count, double tolerance,
              std::int32_t* choices, double* bounds_found) {
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
    const Mask regular_a = sizes_a.parallelogram > 0, regular_b = sizes_b.parallelogram > 0;
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
    const CentreBounds centre_bounds(line, distance, 1.0 / (distance - radii), area, sizes_a.second + sizes_b.second,
                                     (sizes_a.fourth + sizes_b.fourth) + 6.0 * (sizes_a.second * sizes_b.second),
                                     shape_a.third + shape_b.third);
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
      choose_edges(bounds, limit - rounding, asked, by_edges, edge_bound);
      // kContour where no number of points is enough.
      const Mask loose = asked & ((by_edges == splat(kContour)) | (by_edges > splat(double{kEdges} + kLoosePoints)));
      if (any(loose)) {
        // The true distances cost as much as some points on the edges.
        const EdgeDistances distances(Outline{shape_a}, Outline{shape_b}, 1e-6 * limit);
        bounds.near_ratio = max(bounds.ratio, min(distances.ratio_a, distances.ratio_b));
        const Real share = square_root(1.0 / max(bounds.near_ratio, splat(1)));
        least = max(least, square_root(distances.least) * (1.0 - share));
        const Real sharper_rounding = rounding_at(least);
        Real sharper, sharper_bound;
        choose_edges(bounds, limit - sharper_rounding, loose, sharper, sharper_bound);
        by_edges = loose ? sharper : by_edges;
        edge_bound = loose ? sharper_bound : edge_bound;
        rounding = loose ? sharper_rounding : rounding;
      }
      by_edges = ~bounds.parallelograms & (by_edges > splat(kEdges)) ? by_edges + 1.0 : by_edges;
      choice = asked ? by_edges : choice;
      bound = asked ? edge_bound + rounding : bound;
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

/// Of m = 2, 4, 6 points on every edge of two parallelograms the least whose bound coefficient q^m ((2m + 1) e + q / (1
/// - q)) / D² meets `limit` with D = `least`, as kEdges + m, and the bound. kUnsettled where none does, and where fewer
/// points might do with D up to `most`.
/// @param inverse_least, inverse_most  of these distances
inline void choose_far_edges(Real coefficient, Real half_edge, Real inverse_least, Real inverse_most, Real limit,
                             Real& choice, Real& bound) {
  const Real q = square_of(half_edge * inverse_least), hopeful_q = square_of(half_edge * inverse_most);
  const Real tail = (4.0 / 3) * q;  // of q / (1 - q), for q < 1/4
  choice = splat(kUnsettled);
  bound = splat(0);
  Mask open = (inverse_least > 0) & (q < 0.25);
  Real power = coefficient * square_of(inverse_least),
       hopeful_power = kHopefulShare * coefficient * square_of(inverse_most);
  for (int half = 1; half <= 3; ++half) {
    const double e = (4 * half + 1) * kGaussError[half];
    power *= q * q;
    hopeful_power *= hopeful_q * hopeful_q;
    const Real left = power * (e + tail);
    const Mask take = open & (left <= limit);
    choice = take ? splat(double{kEdges} + 2 * half) : choice;
    bound = take ? left : bound;
    open = open & ~take;
    if (half == 2) open = open & (hopeful_power * e > limit);
  }
}

void settle(const PatchRecord* const* first, const PatchRecord* const* second, int count, double tolerance,
            const EdgeRule* edge_rules, std::int32_t* choices, double* bounds, double* exchange) {
  for (int start = 0; start < count; start += kLanes) {
    const int lanes_used = count - start < kLanes ? count - start : kLanes;
    const Lanes first_lanes(first + start, lanes_used), second_lanes(second + start, lanes_used);
    const Centre a(first_lanes), b(second_lanes);
    CentreLine line(a, b);
    const Real distance = square_root(line.square), radii = a.ball + b.ball, gap = distance - radii;
    const Real inverse_both = 1.0 / (line.square * gap), inverse_gap = line.square * inverse_both;
    line.divide(a, b, gap * inverse_both);
    const Real area = a.area * b.area, least_area = min(a.area, b.area), limit = tolerance * least_area;
    const Mask hidden = (line.height_a + a.ball < -kOpen) | (line.height_b + b.ball < -kOpen) | (area <= 0);
    const Mask clear = (line.height_a - a.ball > kOpen) & (line.height_b - b.ball > kOpen) & (distance > radii);
    // No convex patch has a larger mean |x - centre|² than a disk. 160 / r³ for the heights, at most r, that round.
    const Real inverse_fourth = line.inverse_square * line.inverse_square;
    Real bound = (1 / kPi) * area *
                 (1.5 * (square_of(a.ball) + square_of(b.ball)) * line.inverse_square * square_of(inverse_gap) +
                  160 * kEpsilon * distance * inverse_fourth);
    Real value = line.exchange;
    Real choice = hidden ? splat(kNothing) : (clear & (bound <= limit) ? splat(kSettled) : splat(kUnsettled));
    const Mask open = clear & (choice == splat(kUnsettled));
    if (any(open)) {
      const Sizes sizes_a(first_lanes), sizes_b(second_lanes);
      const Mask parallelograms = sizes_a.parallelogram + sizes_b.parallelogram == splat(2);
      const CentreBounds sharper(line, distance, inverse_gap, area, sizes_a.second + sizes_b.second,
                                 (sizes_a.fourth + sizes_b.fourth) + 6.0 * (sizes_a.second * sizes_b.second), splat(0));
      const Mask centres = open & (sharper.by_centres <= limit);
      const Mask moments = open & parallelograms & (sharper.by_moments <= limit) & ~centres;
      const Mask asked = open & parallelograms & ~centres & ~moments;
      if (any(asked)) {
        const Real rounding = kEdgeRoundings * kEpsilon / (2 * kPi) * (sizes_a.perimeter * sizes_b.perimeter) *
                                  square_of((distance + radii) * inverse_gap) +
                              sizes_a.skew + sizes_b.skew;
        Real by_edges, edge_bound;
        const Real turned =
            (2 / kPi) * (0.5 + 0.25 * square_of(dot(a.normal, b.normal))) * (sizes_a.sides * sizes_b.sides);
        choose_far_edges(2.0 * turned, max(sizes_a.half_edge, sizes_b.half_edge),
                         1.0 / (distance - max(sizes_a.middle_radius + b.ball, sizes_b.middle_radius + a.ball)),
                         distance * line.inverse_square, limit - rounding, by_edges, edge_bound);
        choice = asked ? by_edges : choice;
        bound = asked ? edge_bound + rounding : bound;
      }
      if (any(moments)) {
        value = moments ? line.with_moments(a, b, Moments(first_lanes), Moments(second_lanes)) : value;
        choice = moments ? splat(kSettled) : choice;
        bound = moments ? sharper.by_moments : bound;
      }
      choice = centres ? splat(kSettled) : choice;
      bound = centres ? sharper.by_centres : bound;
    }
    // A vector of pairs that all take the same points need not be sorted.
    const Mask on_edges = choice > splat(kEdges);
    if (!any(~on_edges)) {
      double points = 0;
      for (int lane = 0; lane < kLanes; ++lane) points = choice[lane] > points ? choice[lane] : points;
      if (!any(choice < points)) {
        const EdgeRule& rule = edge_rules[(static_cast<int>(points) - kEdges) / 2];
        value = edges_of_parallelograms(first_lanes, second_lanes, rule);
        choice = splat(kSettledByEdges);
      }
    }
    value = choice <= splat(kSettledByEdges) ? min(max(value, splat(0)), least_area) : least_area;
    store(choices + start, choice, lanes_used);
    store(bounds + start, bound, lanes_used);
    store(exchange + start, value, lanes_used);
  }
}

}  // namespace
}  // namespace interglow::radiosity::batch
