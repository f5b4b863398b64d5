// SPDX-License-Identifier: GPL-3.0-or-later
// The choice of a rule for each pair, included once for each instruction set (batch_kernel_source.h).
#include "radiosity/batch_shapes.h"

namespace interglow::radiosity::batch {
namespace {

/// Reach of a patch along a direction: of its corners and of the middles of its edges.
struct Extent {
  Real low, high, middle_low, middle_high;
  Extent(const Shape& of, Vector direction, Real at_origin) {
    const Real u = dot(direction, of.e1), v = dot(direction, of.e2), uv = dot(direction, of.e3);
    const Real a = at_origin, b = a + u, c = a + v, d = b + v + uv;
    low = min(min(a, b), min(c, d));
    high = max(max(a, b), max(c, d));
    const Real ab = a + b, bd = b + d, dc = d + c, ca = c + a;
    middle_low = 0.5 * min(min(ab, bd), min(dc, ca));
    middle_high = 0.5 * max(max(ab, bd), max(dc, ca));
  }
};

constexpr double gauss_error(int points) {  // of x^2m by m points on [-1, 1], over the length
  double error = 1.0 / (2 * points + 1);
  for (int k = 1; k <= points; ++k) error *= 4.0 * k * k / (double(points + k) * (points + k));
  return error;
}

constexpr int kLooseHalf = 3;           ///< up to 6 points it does not pay to sharpen the bound
constexpr double kEdgeRoundings = 4.0;  ///< of the squared distances that may gather in their mean logarithm

constexpr auto kGaussError = [] {
  struct Table {
    double at[kMaxEdgePoints / 2 + 1];
    constexpr double operator[](int half) const { return at[half]; }
  } table{};
  for (int half = 1; half <= kMaxEdgePoints / 2; ++half) table.at[half] = gauss_error(2 * half);
  return table;
}();

/// What bounds the rules of m points on every edge, a share of both patches at a time (docs/form-factors.md):
///   near  coupling (1 + 1/(4m² - 1)) / m Σ ρ^-2m / (1 - ρ^-2), whichever edges these are,
///   far   for parallelograms, whose opposite edges cancel, turned Σ q^m ((2m + 1) e + q / (1 - q)) / D²,
///         else Σ swept q^m (e + q / ((2m + 3) (1 - q))) / D and the error of errors,
/// with D the distance of the middles of a patch's edges from the other patch, q the square of the longest half edge
/// over D, ρ the ellipse that this leaves free of singularities, and e = gauss_error(m).
struct EdgeBounds {
  Real coupling, turned;  ///< Σ |e·f| / 2π over all edges; the same over sides, times the other sides' lengths
  Real swept_a, swept_b;  ///< perimeter times the other's area / 2π
  Mask parallelograms;    ///< both are
  Real distance_a, distance_b;
  Real ratio_a, ratio_b;  ///< D over the longest half edge, squared
};

/// Least number n for which 2n points on every edge meet `limit`, as kEdges + n, and the bound; kContour where none
/// does.
inline void choose_edges(const EdgeBounds& of, Real limit, Real& choice, Real& bound) {
  const auto inverse_ellipse = [](Real ratio_squared) {  // ρ^-2
    const Real rho = square_root(max(ratio_squared, splat(1))) + square_root(max(ratio_squared - 1.0, splat(0)));
    return 1.0 / (rho * rho);
  };
  const Real one_a = inverse_ellipse(of.ratio_a), one_b = inverse_ellipse(of.ratio_b);
  const Mask is_near = (of.ratio_a > 1.01) & (of.ratio_b > 1.01);
  const Real near_a = of.coupling / (1.0 - min(one_a, splat(0.999))),
             near_b = of.coupling / (1.0 - min(one_b, splat(0.999)));
  const Real q_a = 1.0 / max(of.ratio_a, splat(1.5)), q_b = 1.0 / max(of.ratio_b, splat(1.5));
  const Mask is_far = (of.ratio_a > 1.5) & (of.ratio_b > 1.5);
  const Real tail_a = q_a / (1.0 - q_a), tail_b = q_b / (1.0 - q_b);
  const Real inverse_a = 1.0 / max(of.distance_a, splat(1e-100)), inverse_b = 1.0 / max(of.distance_b, splat(1e-100));
  const Real turned_a = of.turned * inverse_a * inverse_a, turned_b = of.turned * inverse_b * inverse_b;
  const Real swept_a = of.swept_a * inverse_a, swept_b = of.swept_b * inverse_b;
  const Real both = square_root(q_a) + square_root(q_b);
  const Mask has_swept = both < 0.9;
  const Real both_4 = (both * both) * (both * both), both_scale = of.coupling / (1.0 - min(both, splat(0.9)));
  choice = splat(kContour);
  bound = splat(0);
  Real power_near_a = near_a, power_near_b = near_b, power_a = splat(1), power_b = splat(1), power_both = both_scale;
  const Real step_a = one_a * one_a, step_b = one_b * one_b;
  const double none = 1e300;
  for (int half = 1; half <= kMaxEdgePoints / 2; ++half) {
    const int m = 2 * half;
    power_near_a *= step_a, power_near_b *= step_b;
    power_a *= q_a * q_a, power_b *= q_b * q_b;
    power_both *= both_4 * both_4;
    if (half > 6 && half % 2 != 0) continue;
    const double e = kGaussError[half];
    const Real near = (1 + 1.0 / (4.0 * m * m - 1)) / m * (power_near_a + power_near_b);
    const Real far_turned =
        turned_a * power_a * ((2 * m + 1) * e + tail_a) + turned_b * power_b * ((2 * m + 1) * e + tail_b);
    const Real far_swept = swept_a * power_a * (e + tail_a * (1.0 / (2 * m + 3))) +
                           swept_b * power_b * (e + tail_b * (1.0 / (2 * m + 3))) +
                           power_both * (1.0 / (4.0 * m * (2 * m + 1) * (2 * m + 1)));
    const Real far = is_far ? (of.parallelograms ? far_turned : (has_swept ? far_swept : splat(none))) : splat(none);
    const Real left = min(is_near ? near : splat(none), far);
    const Mask take = (left <= limit) & (choice == splat(kContour));
    choice = take ? splat(kEdges + half) : choice;
    bound = take ? left : bound;
    if (!any(choice == splat(kContour))) break;
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

/// The pairs that the moments do not settle. @pre `a`, `b`, `line` of the lanes
void classify_shapes(const Lanes& first_lanes, const Lanes& second_lanes, const Centre& a, const Centre& b,
                     const CentreLine& line, Real limit, Real open_a, Real open_b, Real& choice, Real& bound) {
  const Shape shape_a(first_lanes), shape_b(second_lanes);
  const Real distance = square_root(line.square);
  const Extent over_b(shape_a, b.normal, dot(b.normal, shape_a.origin - b.centre)),
      over_a(shape_b, a.normal, dot(a.normal, shape_b.origin - a.centre));
  const Mask hidden = (over_b.high < -open_b) | (over_a.high < -open_a) |
                      ((over_b.high <= open_b) & (over_b.low >= -open_b) & (over_a.high <= open_a) &
                       (over_a.low >= -open_a) & (dot(a.normal, b.normal) > 0));
  // Corners on the other's plane within rounding need no clipping: what is wrong by it is no more than that.
  const Mask in_front =
      (over_b.low >= -open_b) & (over_a.low >= -open_a) & (over_b.high > open_b) & (over_a.high > open_a);
  // Distances of points by the heights over either plane and along the line of centres; the largest holds.
  const Vector way = (1.0 / max(distance, splat(1e-100))) * line.between;
  const Extent along_a(shape_a, way, dot(way, shape_a.origin - a.centre)),
      along_b(shape_b, way, dot(way, shape_b.origin - a.centre));
  const Real ball = distance - a.radius - b.radius;
  const Real gap = max(max(along_b.low - along_a.high, ball), max(over_a.low, over_b.low));
  EdgeBounds bounds;
  bounds.distance_a = max(max(along_b.low - along_a.middle_high, gap), max(over_a.low, over_b.middle_low));
  bounds.distance_b = max(max(along_b.middle_low - along_a.high, gap), max(over_b.low, over_a.middle_low));
  bounds.ratio_a = square_of(max(bounds.distance_a, splat(0)) / a.half_edge);
  bounds.ratio_b = square_of(max(bounds.distance_b, splat(0)) / b.half_edge);
  bounds.parallelograms = a.parallelogram + b.parallelogram == splat(2);
  const Real c11 = magnitude(dot(shape_a.e1, shape_b.e1)), c12 = magnitude(dot(shape_a.e1, shape_b.e2)),
             c21 = magnitude(dot(shape_a.e2, shape_b.e1)), c22 = magnitude(dot(shape_a.e2, shape_b.e2));
  bounds.coupling =
      bounds.parallelograms ? (2 / kPi) * ((c11 + c12) + (c21 + c22)) : 1 / (2 * kPi) * (a.perimeter * b.perimeter);
  bounds.turned = 1 / (2 * kPi) *
                  ((c11 * shape_a.length2 * shape_b.length2 + c12 * shape_a.length2 * shape_b.length1) +
                   (c21 * shape_a.length1 * shape_b.length2 + c22 * shape_a.length1 * shape_b.length1));
  bounds.swept_a = 1 / (2 * kPi) * (a.perimeter * b.area);
  bounds.swept_b = 1 / (2 * kPi) * (b.perimeter * a.area);
  // Of a squared distance: roundings of the sum of the moduli of its terms, which `reach` bounds.
  const Real reach = distance + a.radius + b.radius;
  const auto rounding_at = [&](Real least) {
    return kEdgeRoundings * kEpsilon * bounds.coupling * square_of(reach / max(least, 1e-10 * reach)) + a.skew + b.skew;
  };
  Real least = max(gap, max(bounds.distance_a - a.half_edge, bounds.distance_b - b.half_edge));
  Real rounding = rounding_at(least);
  choose_edges(bounds, limit - rounding, choice, bound);
  if (any(in_front & ~hidden & (choice > splat(kEdges + kLooseHalf)))) {
    // The true distances cost as much as some points on the edges.
    const Outline outline_a(shape_a), outline_b(shape_b);
    const EdgeDistances distances(outline_a, outline_b, 1e-6 * limit);
    bounds.ratio_a = max(bounds.ratio_a, distances.ratio_a);
    bounds.ratio_b = max(bounds.ratio_b, distances.ratio_b);
    const Real largest_share = square_root(1.0 / max(min(bounds.ratio_a, bounds.ratio_b), splat(1)));
    least = max(least, square_root(distances.least) * (1.0 - largest_share));
    const Real sharper_rounding = rounding_at(least);
    Real sharper, sharper_bound;
    choose_edges(bounds, limit - sharper_rounding, sharper, sharper_bound);
    const Mask take = choice > splat(kEdges + kLooseHalf);
    choice = take ? sharper : choice;
    bound = take ? sharper_bound : bound;
    rounding = take ? sharper_rounding : rounding;
  }
  bound += rounding;
  // The height of the visible parts bounds what a clamped rule can miss where one plane cuts the other patch.
  const Real inverse_gap = 1.0 / (gap * gap);
  const Real crossing =
      max(over_b.high, splat(0)) * max(over_a.high, splat(0)) * inverse_gap * inverse_gap * a.area * b.area * (1 / kPi);
  const Mask cut = ~in_front & (gap > 0) & (crossing <= limit);
  choice = in_front ? choice : (cut ? splat(kCut) : splat(kContour));
  bound = cut ? crossing : bound;
  choice = hidden ? splat(kNothing) : choice;
}

void classify(const PatchRecord* const* first, const PatchRecord* const* second, int count, double tolerance,
              std::int32_t* choice, double* bound, double* exchange) {
  for (int start = 0; start < count; start += kLanes) {
    const int lanes_used = count - start < kLanes ? count - start : kLanes;
    const Lanes first_lanes(first + start, lanes_used), second_lanes(second + start, lanes_used);
    const Centre a(first_lanes), b(second_lanes);
    const CentreLine line(a, b);
    const Real distance = square_root(line.square), radii = a.radius + b.radius;
    const Real open_a = kSideRounding + a.deviation + a.lever * (distance + radii),
               open_b = kSideRounding + b.deviation + b.lever * (distance + radii);
    const Real area = a.area * b.area, limit = tolerance * min(a.area, b.area);
    const Mask hidden = (line.height_a + a.radius < -open_b) | (line.height_b + b.radius < -open_a) | (area <= 0);
    const Mask clear = (line.height_a - a.radius > open_b) & (line.height_b - b.radius > open_a) & (distance > radii);
    // |k-th Taylor coefficient of the kernel| <= (k + 1) / (π r^(k + 2)): what begins with order k = 2, 4 and moves by
    // at most R leaves (k + 1) mean|δ|^k / (π r^k (r - R)²), δ the move of one patch less that of the other.
    const Real gap = distance - radii;
    const Real tail = area * (1 / kPi) * line.inverse_square / (gap * gap);
    const Real rounding =
        area * (1 / kPi) * kEpsilon * line.inverse_square * line.inverse_square *
        (8.0 * (line.height_a + line.height_b) + 32.0 * line.height_a * line.height_b * (1.0 + 1.0 / distance));
    const Real by_centres = 3.0 * (a.second + b.second) * tail + rounding;
    const Real by_moments =
        5.0 * ((a.fourth + b.fourth) + 6.0 * (a.second * b.second)) * tail * line.inverse_square +
        4 / kPi * area * (a.third + b.third) * line.inverse_square * line.inverse_square / distance + rounding;
    const Mask centres = clear & (by_centres <= limit);
    const Mask settled = hidden | (clear & (min(by_centres, by_moments) <= limit));
    Real value = line.exchange;
    if (any(~centres & ~hidden)) value = centres ? value : line.with_moments(a, b);
    Real left = centres ? by_centres : by_moments;
    Real chosen = hidden ? splat(kNothing) : splat(kMoments);
    if (any(~settled)) {
      Real shape_choice, shape_bound;
      classify_shapes(first_lanes, second_lanes, a, b, line, limit, open_a, open_b, shape_choice, shape_bound);
      chosen = settled ? chosen : shape_choice;
      left = settled ? left : shape_bound;
    }
    for (int lane = 0; lane < lanes_used; ++lane) {
      choice[start + lane] = static_cast<std::int32_t>(chosen[lane]);
      bound[start + lane] = left[lane];
      exchange[start + lane] = value[lane];
    }
  }
}

}  // namespace
}  // namespace interglow::radiosity::batch
