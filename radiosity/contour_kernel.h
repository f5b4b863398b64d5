// SPDX-License-Identifier: GPL-3.0-or-later
/// The double contour integral of the form factor, pair of edges by pair of edges.
///
///   A1 F12 = (1 / 2π) Σ_ij (u_i·v_j) ∫_i ∫_j ln|x - y| ds dt
///
/// Edges that stand apart take Gauss points on both. Else the inner integral is elementary, and what is left to the
/// outer one is singular only at the corners of the other polygon, because the kink along an inner edge is split off in
/// closed form; its panels are cut towards those corners, so the cost grows with the logarithm of the gap. Edges that
/// meet, cross or run parallel are done in closed form altogether. Every rule has a proven bound of what it leaves out,
/// and no more points than the wanted error asks for. See docs/form-factors.md.
#pragma once

#include "radiosity/horizon_clip.h"

namespace interglow::radiosity::detail {

struct ContourResult {
  long double exchange_area = 0;  ///< A1 F12 in the units of the corners
  long double truncation = 0;     ///< bound on what the rules leave out
  long double rounding = 0;       ///< estimate of the rounding errors
};

/// Both polygons must lie in front of each other's plane, with corners of size about 1. `tolerance` is absolute, in A1
/// F12.
template <class Real>
ContourResult contour_exchange_area(const ClippedPolygon<Real>& a, const ClippedPolygon<Real>& b, Real tolerance);

extern template ContourResult contour_exchange_area(const ClippedPolygon<double>&, const ClippedPolygon<double>&,
                                                    double);
extern template ContourResult contour_exchange_area(const ClippedPolygon<long double>&,
                                                    const ClippedPolygon<long double>&, long double);

/// Gauss-Legendre rule of `n` points on [-1, 1], computed once in extended precision. 1 <= n <= 24.
struct GaussRule {
  int points = 0;
  std::array<long double, 24> node{}, weight{};
};
const GaussRule& gauss_legendre(int n);

}  // namespace interglow::radiosity::detail
