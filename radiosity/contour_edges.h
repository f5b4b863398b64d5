// SPDX-License-Identifier: GPL-3.0-or-later
/// Pairs of edges of two polygons, as many at a time as every processor takes: what their distances are made of, and
/// the ellipses that they leave each other free, which say how many Gauss points ln r needs.
#pragma once

#include <algorithm>

#include "radiosity/horizon_clip.h"

namespace interglow::radiosity::detail {

/// As many numbers as one instruction takes everywhere: two doubles.
template <class Real>
struct LanesOf {
  using Type = Real;
  static Type gather(Real first, Real /*second*/) { return first; }
  static Type root(Type x) { return std::sqrt(x); }
  static bool any(bool x) { return x; }
};
template <>
struct LanesOf<double> {
  using Type = double __attribute__((vector_size(16)));
  static Type gather(double first, double second) { return Type{first, second}; }
  static Type root(Type x) { return Type{std::sqrt(x[0]), std::sqrt(x[1])}; }
  template <class Mask>
  static bool any(Mask x) {
    return (x[0] | x[1]) != 0;
  }
};
template <class Real>
using Lanes = typename LanesOf<Real>::Type;
template <class Real>
constexpr int kLanes = sizeof(Lanes<Real>) / sizeof(Real);
constexpr int kMostEdges = 8;
template <class Real>
using PerEdge = std::array<Lanes<Real>, kMostEdges / kLanes<Real>>;

template <class Real>
Real lane_of(const Lanes<Real>& values, int lane) {
  if constexpr (kLanes<Real> == 1) {
    return values;
  } else {
    return values[lane];
  }
}

template <class Type>
Type larger(Type a, Type b) {
  return a > b ? a : b;
}

/// ρ^-2 of the ellipse with foci ±1 on which a quarter of the square of the sum of distances to the foci is `square`.
template <class Real, class Type>
Type decay_of_square(Type square) {
  const Type one = Type{} + 1, outside = larger(square, one);
  return 1 / (2 * outside - 1 + 2 * LanesOf<Real>::root(outside * (outside - 1)));
}

/// From the sum of distances itself.
template <class Real>
Real decay_of(Real sum) {
  const Real half = std::max(sum / 2, Real(1)), rho = half + std::sqrt((half - 1) * (half + 1));
  return 1 / (rho * rho);
}

/// The edges of a polygon as half vectors from their middles. Edge i is lane i / blocks of block i % blocks, so that a
/// block of a quad holds opposite edges.
template <class Real>
struct Outline {
  using Vector = Eigen::Matrix<Real, 3, 1>;

  const ClippedPolygon<Real>& polygon;
  int edges, blocks;
  std::array<PerEdge<Real>, 3> middle, half;
  PerEdge<Real> half_square, inverse;  ///< inverse: of the length, 0 for an edge without length

  explicit Outline(const ClippedPolygon<Real>& of)
      : polygon(of), edges(of.corners), blocks((edges + kLanes<Real> - 1) / kLanes<Real>) {
    for (int i = 0; i < blocks; ++i) {
      Lanes<Real> sum{};
      for (int axis = 0; axis < 3; ++axis) {
        const auto from = LanesOf<Real>::gather(corner(i)[axis], corner(i + blocks)[axis]);
        const auto to = LanesOf<Real>::gather(corner(i + 1)[axis], corner(i + blocks + 1)[axis]);
        const Lanes<Real> half_edge = (to - from) / 2;
        middle[axis][i] = (from + to) / 2;
        half[axis][i] = half_edge;
        sum += half_edge * half_edge;
      }
      const Lanes<Real> none{};
      half_square[i] = sum;
      inverse[i] = sum > none ? 1 / (2 * LanesOf<Real>::root(sum)) : none;
    }
  }
  /// Past the last one the first, so that an edge that fills a lane has no length.
  const Vector& corner(int i) const { return polygon.corner[i < edges ? i : 0]; }
};

template <class Real>
struct Edge {
  using Vector = Eigen::Matrix<Real, 3, 1>;
  const Vector &start, &end;
  Vector direction;
  Real length;

  Edge(const Outline<Real>& outline, int i) : start(outline.corner(i)), end(outline.corner(i + 1)) {
    const Vector whole = end - start;
    length = whole.norm();
    direction = whole / length;
  }
};

/// At most the square of the least sum of distances from a point of the edge q to both ends of the edge p, over p's
/// length: how large the ellipse about p is that q leaves free. q is taken for its line, except where both ends of p
/// lie past the same end of q.
///
/// @param middles  |w|², w from the middle of q to that of p
/// @param along_p, along_q, both  w·p, w·q and p·q of the half vectors
/// @param p_square, q_square  |p|² and |q|² of them; inverse lengths of the whole edges
template <class Real, class Type = Lanes<Real>>
Type least_square_sum(Type middles, Type along_p, Type along_q, Type both, Type p_square, Type p_inverse, Type q_square,
                      Type q_inverse) {
  const Type none{};
  const Type plus = 2 * q_inverse * (along_q + both), minus = 2 * q_inverse * (along_q - both);  // feet of p's ends
  const Type q_half = 2 * q_square * q_inverse, least = -larger(-plus, -minus), most = larger(plus, minus);
  const Type past = larger(least, -most) - q_half;  // of the nearer foot where both are past the same end
  const Type plus_past = larger(plus, -plus) - q_half, minus_past = larger(minus, -minus) - q_half;
  const Type from_middle = middles + p_square, run = plus - minus;
  const Type plus_height = larger(from_middle + 2 * along_p - plus * plus, none);
  const Type minus_height = larger(from_middle - 2 * along_p - minus * minus, none);
  const Type plus_square = plus_height + (past > none ? plus_past * plus_past : none);
  const Type minus_square = minus_height + (past > none ? minus_past * minus_past : none);
  const Type run_square = past > none ? none : run * run;
  return (plus_square + minus_square + run_square + 2 * LanesOf<Real>::root(plus_square * minus_square)) *
         (p_inverse * p_inverse);
}

/// Edges p and q: the squared distance of w + s p and t q, with s and t in [-1, 1], is quadratic in both.
template <class Type>
struct Distances {
  Type middles, along_p, along_q, both;  ///< |w|², w·p, w·q, p·q
};

template <class Real>
Distances<Lanes<Real>> distances(const Outline<Real>& p, int p_block, int p_lane, const Outline<Real>& q, int q_block) {
  Distances<Lanes<Real>> d{};
  for (int axis = 0; axis < 3; ++axis) {
    const Lanes<Real> p_half = Lanes<Real>{} + lane_of<Real>(p.half[axis][p_block], p_lane);
    const Lanes<Real> w = lane_of<Real>(p.middle[axis][p_block], p_lane) - q.middle[axis][q_block];
    d.middles += w * w;
    d.along_p += w * p_half;
    d.along_q += w * q.half[axis][q_block];
    d.both += p_half * q.half[axis][q_block];
  }
  return d;
}

}  // namespace interglow::radiosity::detail
