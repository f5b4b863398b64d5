// SPDX-License-Identifier: GPL-3.0-or-later
// Gauss points on the edges of two parallelograms, included once for each instruction set (batch_kernel_source.h).
#pragma once

#include "radiosity/batch_shapes.h"

namespace interglow::radiosity::batch {
namespace {

/// Squared distances of points on two edges, ±s and ±t the shares of their half lengths.
struct EdgePair {
  Real middles, along_first, along_second;  ///< |w|², 2 w·a, 2 w·b; w from the second's middle to the first's

  /// What a pair of points ±s on the first edge contributes.
  struct Points {
    Real at_plus_s, at_minus_s, turn_plus_s, turn_minus_s;
  };

  EdgePair(Vector w, Vector a, Vector b)
      : middles(dot(w, w)), along_first(2.0 * dot(w, a)), along_second(2.0 * dot(w, b)) {}
  /// @param first_squared  s² |a|²
  /// @param both  2 s a·b
  Points at(double s, Real first_squared, Real both) const {
    const Real middle = middles + first_squared;
    return {middle + s * along_first, middle - s * along_first, along_second + both, along_second - both};
  }
};

/// The product of four squared distances.
inline Real product(const EdgePair::Points& at, double t, Real second_squared) {
  const Real plus = at.at_plus_s + second_squared, minus = at.at_minus_s + second_squared;
  return ((plus - t * at.turn_plus_s) * (plus + t * at.turn_plus_s)) *
         ((minus - t * at.turn_minus_s) * (minus + t * at.turn_minus_s));
}

/// Σ over the rule of the logarithms of squared distances, times its weights, where `same` edges count positive and
/// `opposite` ones negative: of edge pairs that share directions and lengths, one logarithm for 16 distances.
inline Real edge_group(const EdgePair (&same)[2], const EdgePair (&opposite)[2], Real a_squared, Real b_squared,
                       Real a_b, const EdgeRule& rule) {
  Real sum = splat(0);
  for (int i = 0; i < rule.half; ++i) {
    const double s = rule.node[i];
    const Real first_squared = (s * s) * a_squared, both = (2 * s) * a_b;
    const EdgePair::Points same_at[2] = {same[0].at(s, first_squared, both), same[1].at(s, first_squared, both)},
                           opposite_at[2] = {opposite[0].at(s, first_squared, both),
                                             opposite[1].at(s, first_squared, both)};
    Real inner = splat(0);
    for (int j = 0; j < rule.half; ++j) {
      const double t = rule.node[j];
      const Real second_squared = (t * t) * b_squared;
      inner += rule.weight[j] *
               log_ratio(product(same_at[0], t, second_squared) * product(same_at[1], t, second_squared),
                         product(opposite_at[0], t, second_squared) * product(opposite_at[1], t, second_squared));
    }
    sum += rule.weight[i] * inner;
  }
  return sum;
}

/// Parallelograms by the contour integral. Not inlined: the same instructions, and so the same bits, for all callers.
__attribute__((noinline)) Real edges_of_parallelograms(const Lanes& first_lanes, const Lanes& second_lanes,
                                                       const EdgeRule& rule) {
  const Sides a(first_lanes), b(second_lanes);
  Real a_origin[3], b_origin[3];
  first_lanes.load(offsetof(PatchRecord, origin), a_origin);
  second_lanes.load(offsetof(PatchRecord, origin), b_origin);
  // Corners that lie close together are subtracted first, which rounds relative to their distance.
  const Vector corners = Vector{a_origin[0], a_origin[1], a_origin[2]} - Vector{b_origin[0], b_origin[1], b_origin[2]};
  const Vector side_a[2] = {0.5 * a.e1, 0.5 * a.e2};
  const Vector side_b[2] = {0.5 * b.e1, 0.5 * b.e2};
  const Vector middles = corners + ((side_a[0] + side_a[1]) - (side_b[0] + side_b[1]));
  Real sum = splat(0);
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 2; ++j) {
      const Vector edge_a = side_a[i], across_a = side_a[1 - i], edge_b = side_b[j], across_b = side_b[1 - j];
      const Real a_b = dot(edge_a, edge_b);
      if (!any(a_b != splat(0))) continue;
      // Counter-clockwise, the first side's edge runs along it at -across, the second's at +across.
      const Vector apart = across_a - across_b, together = across_a + across_b;
      const EdgePair same[2] = {{middles + apart, edge_a, edge_b}, {middles - apart, edge_a, edge_b}};
      const EdgePair opposite[2] = {{middles + together, edge_a, edge_b}, {middles - together, edge_a, edge_b}};
      const Real value = a_b * edge_group(same, opposite, dot(edge_a, edge_a), dot(edge_b, edge_b), a_b, rule);
      sum = i == j ? sum + value : sum - value;
    }
  // e·f = 4 a·b; 1/2 for the squares.
  sum *= 1 / kPi;
  return sum;
}

}  // namespace
}  // namespace interglow::radiosity::batch
