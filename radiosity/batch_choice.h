// SPDX-License-Identifier: GPL-3.0-or-later
// The choice of a rule for each pair, included once for each instruction set (batch_kernel_source.h).
#pragma once

#include "radiosity/batch_bounds.h"

namespace interglow::radiosity::batch {
namespace {

/// Squared sine between the line of centres and the normal of the patch whose plane its other end is `height` above:
/// what directions of the patch's plane count along the line.
inline Real across(Real height, const CentreLine& line) {
  return max(1.0 - square_of(height) * line.inverse_square, splat(0));
}

/// The mean of powers of the distance for product rules.
inline MeanPower line_power(const CentreLine& line, Real distance, Real gap, const Lines& a, const Lines& b) {
  const Real variance = a.variance * across(line.height_b, line) + b.variance * across(line.height_a, line);
  return {distance, gap, variance, max(a.offset, b.offset)};
}

/// @param high_a  at least the largest height of a over b's plane
inline Real product_rounding(Real high_a, Real high_b, Real area, Real inverse_gap) {
  return area * (1 / kPi) * square_of(inverse_gap * inverse_gap) * kEpsilon *
         (40.0 * (high_a + high_b) + 64.0 * high_a * high_b * (1.0 + inverse_gap));
}

/// Centres with moments, or up to 4 points per direction, where balls tell that patches face each other and how far
/// apart they are; kUnsettled where that does not do.
void choose_products(const PatchRecord* const* first, const PatchRecord* const* second, int count, double tolerance,
                     const ProductRule* product_rules, std::int32_t* choices, double* bounds) {
  for (int start = 0; start < count; start += kLanes) {
    const int lanes_used = count - start < kLanes ? count - start : kLanes;
    const Lanes first_lanes(first + start, lanes_used), second_lanes(second + start, lanes_used);
    const Centre a(first_lanes), b(second_lanes);
    const Spread spread_a(a.spread), spread_b(b.spread);
    const Lines lines_a(first_lanes), lines_b(second_lanes);
    CentreLine line(a, b);
    line.divide(a, b, 1.0 / max(line.square, splat(1e-280)));
    const Real area = a.area * b.area, limit = tolerance * min(a.area, b.area);
    const Mask facing = PlaneSides(line, a, b, spread_a, spread_b).in_front & (area > 0);
    const Real distance = square_root(line.square),
               radii = square_root(2.0 * (spread_a.ball_square + spread_b.ball_square));
    const Real moments_left = moments_bound(line, distance, radii, area, lines_a, lines_b);
    const Mask moments = facing & (moments_left <= limit), asked = facing & ~moments & (radii < distance);
    Real choice = splat(kUnsettled), bound = splat(0);
    if (any(asked)) {
      // A patch does not reach out of its plane: only by 2 kOpen, (x + δ)² <= 1.01 x² + 101 δ².
      const Real reach_square = 2.02 * (spread_a.ball_square * across(line.height_b, line) +
                                        spread_b.ball_square * across(line.height_a, line)) +
                                2 * 101 * 4 * kOpen * kOpen;
      const MeanPower mean = line_power(line, distance, distance - square_root(reach_square), lines_a, lines_b);
      const Real rounding = product_rounding(2.0 * line.height_a, 2.0 * line.height_b, area, mean.inverse_gap);
      choose_product(area * (1 / kPi), mean, lines_a, lines_b, limit - rounding, asked, 4, product_rules, choice,
                     bound);
      bound += rounding;
    }
    choice = moments ? splat(kMoments) : choice;
    bound = moments ? moments_left : bound;
    store(choices + start, choice, lanes_used);
    store(bounds + start, bound, lanes_used);
  }
}

/// Pairs by their whole records.
struct WholePair {
  Centre a, b;
  Sizes sizes_a, sizes_b;
  Shape shape_a, shape_b;
  Lines lines_a, lines_b;
  CentreLine line;
  Real distance, radii;
  Mask parallelograms;  ///< both are
  Placement at;

  WholePair(const Lanes& first, const Lanes& second)
      : a(first),
        b(second),
        sizes_a(first),
        sizes_b(second),
        shape_a(first),
        shape_b(second),
        lines_a(first),
        lines_b(second),
        line(divided(a, b)),
        distance(square_root(line.square)),
        radii(sizes_a.radius + sizes_b.radius),
        parallelograms(sizes_a.parallelogram & sizes_b.parallelogram),
        at(line, distance, radii, a, b, shape_a, shape_b, sizes_a.parallelogram, sizes_b.parallelogram) {}

 private:
  static CentreLine divided(const Centre& a, const Centre& b) {
    CentreLine line(a, b);
    line.divide(a, b, 1.0 / max(line.square, splat(1e-280)));
    return line;
  }
};

/// r^-2 along an edge whose middle is D away is in the mean at most 1 / (D² - h²), h half of its length. What of that is
/// divided by.
inline Real mean_square(Real distance, Real half_edge_square) {
  return distance > 0 ? distance * distance - half_edge_square : splat(0);
}

/// Points on the edges of patches that face each other, as a choice, and the bound; kContour where none are enough.
inline void choose_points_on_edges(const WholePair& of, MostPoints most, Real limit, Mask asked,
                                   const EdgeRule* edge_rules, Real& choice, Real& bound) {
  const Placement& at = of.at;
  const Sizes &sizes_a = of.sizes_a, &sizes_b = of.sizes_b;
  const Shape &shape_a = of.shape_a, &shape_b = of.shape_b;
  const Real distance_a =
                 max(max(at.along_b.low - at.along_a.middle_high, at.gap), max(at.over_a.low, at.over_b.middle_low)),
             distance_b =
                 max(max(at.along_b.middle_low - at.along_a.high, at.gap), max(at.over_b.low, at.over_a.middle_low));
  EdgeBounds bounds;
  bounds.parallelograms = of.parallelograms;
  bounds.mean = line_power(of.line, of.distance, min(distance_a, distance_b), of.lines_a, of.lines_b);
  bounds.half_edge_square = square_of(max(sizes_a.half_edge, sizes_b.half_edge));
  const Real cosines = (magnitude(dot(shape_a.e1, shape_b.e1)) + magnitude(dot(shape_a.e1, shape_b.e2))) +
                       (magnitude(dot(shape_a.e2, shape_b.e1)) + magnitude(dot(shape_a.e2, shape_b.e2)));
  bounds.coupling = of.parallelograms ? (2 / kPi) * cosines : 1 / (2 * kPi) * (sizes_a.perimeter * sizes_b.perimeter);
  bounds.turned =
      (2 / kPi) * min((0.5 + 0.25 * square_of(dot(of.a.normal, of.b.normal))) * (sizes_a.sides * sizes_b.sides),
                      cosines * (sizes_a.half_edge * sizes_b.half_edge));
  bounds.swept = 1 / (2 * kPi) * (sizes_a.perimeter * of.b.area + sizes_b.perimeter * of.a.area);
  // Of a squared distance: roundings of the sum of the moduli of its terms, which `reach` bounds.
  const Real reach_square = square_of(at.reach), of_shapes = sizes_a.skew + sizes_b.skew;
  const Real nearest = max(at.gap * magnitude(at.gap), max(mean_square(distance_a, square_of(sizes_a.half_edge)),
                                                           mean_square(distance_b, square_of(sizes_b.half_edge))));
  Real rounding =
      kEdgeRoundings * kEpsilon * bounds.coupling * (reach_square / max(nearest, 1e-20 * reach_square)) + of_shapes;
  choose_edges(bounds, nullptr, kLoosePoints, limit - rounding, asked, edge_rules, choice, bound);
  const Mask loose = asked & (choice == splat(kContour));
  if (any(loose)) {
    // The true distances cost as much as some points on the edges.
    const NearEdges near_edges(Outline{shape_a}, Outline{shape_b}, 1e-6 * limit);
    bounds.coupling = min(bounds.coupling, near_edges.all);
    const Real sharper_rounding = min(rounding, kEdgeRoundings * kEpsilon * near_edges.roundings + of_shapes);
    Real sharper, sharper_bound;
    choose_edges(bounds, &near_edges, most, limit - sharper_rounding, loose, edge_rules, sharper, sharper_bound);
    choice = loose ? sharper : choice;
    bound = loose ? sharper_bound : bound;
    rounding = loose ? sharper_rounding : rounding;
  }
  choice = (~of.parallelograms & (choice > splat(kEdges))) ? choice + 1.0 : choice;
  bound += rounding;
}

void classify(const PatchRecord* const* first, const PatchRecord* const* second, int count, double tolerance,
              const EdgeRule* edge_rules, const ProductRule* product_rules, std::int32_t* choices,
              double* bounds_found) {
  for (int start = 0; start < count; start += kLanes) {
    const int lanes_used = count - start < kLanes ? count - start : kLanes;
    const WholePair pair(Lanes(first + start, lanes_used), Lanes(second + start, lanes_used));
    const Placement& at = pair.at;
    const Real area = pair.a.area * pair.b.area, limit = tolerance * min(pair.a.area, pair.b.area);
    const Real moments_left = moments_bound(pair.line, pair.distance, pair.radii, area, pair.lines_a, pair.lines_b);
    const Mask moments = at.in_front & (moments_left <= limit);
    const Mask asked = at.in_front & ~at.hidden & ~moments;
    Real choice = splat(kUnsettled), bound = splat(0);
    const Mask by_products = asked & ~pair.parallelograms & (at.gap > 0);
    if (any(by_products)) {
      const MeanPower mean = line_power(pair.line, pair.distance, at.gap, pair.lines_a, pair.lines_b);
      const Real rounding = product_rounding(at.over_b.high, at.over_a.high, area, mean.inverse_gap);
      choose_product(area * (1 / kPi), mean, pair.lines_a, pair.lines_b, limit - rounding, by_products, 5,
                     product_rules, choice, bound);
      bound += rounding;
    }
    choice = moments ? splat(kMoments) : choice;
    bound = moments ? moments_left : bound;
    // Of 5 points per direction it takes the bounds of edges to tell whether they are cheaper.
    const Mask by_edges = asked & ((choice == splat(kUnsettled)) | (choice == splat(double{kProduct} + 5)));
    if (any(by_edges)) {
      Real points, edge_bound;
      choose_points_on_edges(pair, MostPoints::worth_while(tolerance), limit, by_edges, edge_rules, points, edge_bound);
      const Mask cheaper = by_edges & ((choice == splat(kUnsettled)) |
                                       ((points > splat(double{kEdges})) & (points <= splat(double{kEdges} + 5))));
      choice = cheaper ? points : choice;
      bound = cheaper ? edge_bound : bound;
    }
    // The height of the visible parts bounds what a clamped rule can miss where one plane cuts the other patch.
    const Real inverse_gap = 1.0 / (at.gap * at.gap);
    const Real crossing =
        max(at.over_b.high, splat(0)) * max(at.over_a.high, splat(0)) * inverse_gap * inverse_gap * area * (1 / kPi);
    const Mask cut = ~at.in_front & (at.gap > 0) & (crossing <= limit);
    choice = at.in_front ? choice : (cut ? splat(kCut) : splat(kContour));
    bound = cut ? crossing : bound;
    choice = at.hidden ? splat(kNothing) : choice;
    store(choices + start, choice, lanes_used);
    store(bounds_found + start, bound, lanes_used);
  }
}

/// By the first line and the sides of parallelograms; kUnsettled where that does not do.
void choose(const PatchRecord* const* first, const PatchRecord* const* second, int count, double tolerance,
            const EdgeRule* edge_rules, std::int32_t* choices, double* bounds) {
  for (int start = 0; start < count; start += kLanes) {
    const int lanes_used = count - start < kLanes ? count - start : kLanes;
    const Lanes first_lanes(first + start, lanes_used), second_lanes(second + start, lanes_used);
    const Centre a(first_lanes), b(second_lanes);
    const Sides sides_a(first_lanes), sides_b(second_lanes);
    const Spread spread_a(a.spread), spread_b(b.spread);
    CentreLine line(a, b);
    line.divide(a, b, 1.0 / max(line.square, splat(1e-280)));
    const Real distance = square_root(line.square), limit = tolerance * min(a.area, b.area);
    const FacingPair pair(line, distance, 8.0 + splat(0), a, b, sides_a, sides_b);
    const Mask facing = pair.in_front & (a.area * b.area > 0);
    // All but what `beyond` bounds is left by the true moments.
    const RoundBounds round(line, a.area * b.area, spread_a, spread_b);
    const Mask by_round = facing & round.holds & (round.bound <= limit),
               moments = facing & round.holds & (round.without_beyond <= limit);
    const Real squares_a[2] = {dot(sides_a.e1, sides_a.e1), dot(sides_a.e2, sides_a.e2)},
               squares_b[2] = {dot(sides_b.e1, sides_b.e1), dot(sides_b.e2, sides_b.e2)};
    const Real d11 = magnitude(dot(sides_a.e1, sides_b.e1)), d12 = magnitude(dot(sides_a.e1, sides_b.e2)),
               d21 = magnitude(dot(sides_a.e2, sides_b.e1)), d22 = magnitude(dot(sides_a.e2, sides_b.e2));
    const Real cosines = (d11 + d12) + (d21 + d22);
    // Twice Σ |e·f| |e'| |f'| / 2π, the product of two lengths at most half the sum of their squares.
    const Real turned = (1 / (2 * kPi)) * ((d11 * (squares_a[1] + squares_b[1]) + d12 * (squares_a[1] + squares_b[0])) +
                                           (d21 * (squares_a[0] + squares_b[1]) + d22 * (squares_a[0] + squares_b[0])));
    const Real longest = max(max(squares_a[0], squares_a[1]), max(squares_b[0], squares_b[1]));
    const Real middles = min(pair.distance_a, pair.distance_b);
    const Real nearest = max(pair.gap * magnitude(pair.gap), mean_square(middles, 0.25 * longest));
    // (r + R)² <= 5/4 r² + 5 R².
    const Real reach_square = 1.25 * line.square + 10.0 * (spread_a.ball_square + spread_b.ball_square);
    const Real rounding =
        kEdgeRoundings * kEpsilon * (2 / kPi) * cosines * (reach_square / max(nearest, 1e-20 * line.square)) +
        32 * kEpsilon * longest;
    // A patch does not reach out of its plane; its larger principal moment is at most (second + beyond) / 2.
    const Real variance = 0.5 * ((spread_a.second + spread_a.beyond) * across(line.height_b, line) +
                                 (spread_b.second + spread_b.beyond) * across(line.height_a, line));
    Real choice, bound;
    const MeanPower mean(distance, middles, variance, splat(0));
    choose_far_edges(turned, 0.25 * longest, mean.inverse_gap, &mean, limit - rounding,
                     facing & ~moments & (middles > 0), Mask{}, edge_rules, choice, bound);
    choice = by_round ? splat(kRound) : moments ? splat(kMoments) : choice;
    bound = by_round ? round.bound : moments ? round.without_beyond : bound + rounding;
    store(choices + start, choice, lanes_used);
    store(bounds + start, bound, lanes_used);
  }
}

void settle(const PatchRecord* records, std::uint32_t one, const std::uint32_t* others, int count, double tolerance,
            double square_unit, const EdgeRule* edge_rules, Result* results, OpenPairs& open) {
  const Lanes one_lanes(records + one);
  const Centre a(one_lanes);
  const Spread spread_a(a.spread);
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
    const PlaneSides sides(line, a, b, spread_a, spread_b);
    Mask settled = far & sides.in_front;
    Real value = line.with_round_moments(a, b, spread_a.second, spread_b.second), bound = round.bound;
    Bits method = Bits{} + kFarMethod;
    if (any(~settled)) {
      const Mask hidden = sides.hidden | (area <= 0);
      value = hidden ? splat(0) : value;
      bound = hidden ? splat(0) : bound;
      method = hidden ? Bits{} + kZeroMethod : method;
      settled = settled | hidden;
      if (any(far & ~settled)) {  // as along the edges of a room
        const Real crossed = bound + sides.crossing_bound(line, area);
        const Mask may_cross = far & ~settled & (crossed <= limit);
        bound = may_cross ? crossed : bound;
        settled = settled | may_cross;
      }
      const Mask parallelograms = spread_a.symmetric & spread_b.symmetric;
      Real choice = parallelograms ? splat(kParallelograms) : splat(kOthers), edge_bound = splat(0);
      if (any(parallelograms & ~settled)) {
        const FarEdges far_edges(line, spread_a, spread_b, limit);
        Mask in_front = sides.in_front;
        const Mask at_plane = (far | far_edges.holds) & parallelograms & ~in_front & ~settled;
        if (any(at_plane)) {
          const Real distance = square_root(line.square);
          const FacingPair pair(line, distance, 1.5 * distance, a, b, Sides(one_lanes), Sides(other_lanes));
          in_front = in_front | (at_plane & pair.in_front);
          settled = settled | (far & in_front);
        }
        // What the true moments leave is told by `choose`.
        const Mask asked = far_edges.holds & in_front & ~settled & (round.without_beyond > limit);
        if (any(asked)) {
          Real points;
          far_edges.choose(line, a, b, spread_a, spread_b, limit, asked, edge_rules, points, edge_bound);
          choice = points > splat(kUnsettled) ? points : choice;
        }
      }
      // A whole vector that takes the same number of points need not be sorted.
      const double points = choice[0];
      if (points > double{kEdges} && !any(choice != points)) {
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
        double bound_of[kLanes];
        long long settled_of[kLanes];
        std::int32_t choice_of[kLanes];
        store(choice_of, choice, kLanes);
        store(bound_of, edge_bound, kLanes);
        __builtin_memcpy(settled_of, &settled, sizeof(settled));
        for (int lane = 0; lane < lanes_used; ++lane) {
          open.place[open.count] = start + lane;
          open.choice[open.count] = choice_of[lane];
          open.bound[open.count] = bound_of[lane];
          open.count += settled_of[lane] == 0 ? 1 : 0;
        }
        if (!any(settled)) continue;
      }
    }
    value = square_unit * min(max(value, splat(0)), least_area);
    store_rows(results + start, value, square_unit * bound, reinterpret_cast<Real>(method), lanes_used);
  }
}

}  // namespace
}  // namespace interglow::radiosity::batch
