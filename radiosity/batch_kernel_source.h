// SPDX-License-Identifier: GPL-3.0-or-later
// The vectorised kernels, included once for each instruction set by batch_kernel_<set>.cpp, which define
//   INTERGLOW_LANES     doubles in a vector
//   INTERGLOW_KERNELS   name of the function that returns the table
// Lanes never mix, so a pair's bits do not depend on its neighbours in the packet. No header with inline functions may
// be included (see batch_kernel.h).
#include "radiosity/batch_choice.h"

namespace interglow::radiosity::batch {
namespace {

struct Patch {
  Vector origin, e1, e2, e3, normal, centre, density;
  Real area;
  Mask triangle;
  explicit Patch(const Lanes& lanes) {
    const Centre line(lanes);
    centre = line.centre, normal = line.normal, area = line.area;
    const Shape shape(lanes);
    origin = shape.origin, e1 = shape.e1, e2 = shape.e2, e3 = shape.e3;
    Real of_density[3];
    lanes.load(offsetof(PatchRecord, density), of_density);
    triangle = dot(e2, e2) <= 0;
    density = {of_density[0], of_density[1], of_density[2]};
  }
};

/// Height of a patch along a direction, from a point, bilinear in its parameters.
struct Height {
  Real at_origin, along_u, along_v, along_uv;
  Height(const Patch& of, Vector direction, Vector from)
      : at_origin(dot(direction, of.origin - from)),
        along_u(dot(direction, of.e1)),
        along_v(dot(direction, of.e2)),
        along_uv(dot(direction, of.e3)) {}
  /// Over the plane of another patch.
  Height(const Patch& of, const Patch& over) : Height(of, over.normal, over.centre) {}
};

void centres(const PatchRecord* const* first, const PatchRecord* const* second, int count, int moments,
             double* exchange) {
  for (int start = 0; start < count; start += kLanes) {
    const int lanes_used = count - start < kLanes ? count - start : kLanes;
    const Lanes first_lanes(first + start, lanes_used), second_lanes(second + start, lanes_used);
    const Centre a(first_lanes), b(second_lanes);
    CentreLine line(a, b);
    line.divide(a, b, 1.0 / line.square);
    Real value = line.exchange;
    if (moments == 2) value = line.with_round_moments(a, b, Spread(a.spread).second, Spread(b.spread).second);
    if (moments == 3) value = line.with_moments(a, b, Moments(first_lanes), Moments(second_lanes));
    store(exchange + start, value, lanes_used);
  }
}

/// Nodes of one patch: points, and height over the other's plane times weight (heights below it count as 0).
template <int kPoints>
struct Nodes {
  Vector point[kPoints * kPoints];
  Real weighted_height[kPoints * kPoints];

  Nodes(const Patch& patch, const Patch& other, const ProductRule& rule) {
    const Height height(patch, other);
    const Mask triangle = patch.triangle;
    const Vector density = patch.density;
    for (int i = 0; i < kPoints * kPoints; ++i) {
      const Real u = triangle ? splat(rule.u[1][i]) : splat(rule.u[0][i]);
      const Real v = triangle ? splat(rule.v[1][i]) : splat(rule.v[0][i]);
      const Real weight = triangle ? splat(rule.weight[1][i]) : splat(rule.weight[0][i]);
      const Real uv = u * v;
      point[i] = patch.origin + u * patch.e1 + v * patch.e2 + uv * patch.e3;
      const Real above = height.at_origin + u * height.along_u + v * height.along_v + uv * height.along_uv;
      weighted_height[i] = weight * (density.x + u * density.y + v * density.z) * max(above, splat(0));
    }
  }
};

template <int kPoints>
void product_of(const PatchRecord* const* first, const PatchRecord* const* second, int count, const ProductRule& rule,
                double* exchange) {
  constexpr int kNodes = kPoints * kPoints;
  for (int start = 0; start < count; start += kLanes) {
    const int lanes_used = count - start < kLanes ? count - start : kLanes;
    const Lanes first_lanes(first + start, lanes_used), second_lanes(second + start, lanes_used);
    const Patch a(first_lanes), b(second_lanes);
    const Nodes<kPoints> from(a, b, rule), to(b, a, rule);
    Real sum = splat(0);
    const auto fourth_power = [&](int i, int j) {
      const Vector r = to.point[j] - from.point[i];
      const Real squared = dot(r, r);
      return squared * squared;
    };
    for (int i = 0; i < kNodes; ++i) {
      Real inner = splat(0);
      int j = 0;
      for (; j + 1 < kNodes; j += 2) {  // two fractions on one denominator: half the divisions
        const Real r0 = fourth_power(i, j), r1 = fourth_power(i, j + 1);
        inner += (to.weighted_height[j] * r1 + to.weighted_height[j + 1] * r0) / (r0 * r1);
      }
      if (j < kNodes) inner += to.weighted_height[j] / fourth_power(i, j);
      sum += from.weighted_height[i] * inner;
    }
    sum *= a.area * b.area * (1 / kPi);
    store(exchange + start, sum, lanes_used);
  }
}

void product(const PatchRecord* const* first, const PatchRecord* const* second, int count, const ProductRule& rule,
             double* exchange) {
  switch (rule.points) {
    case 1:
      return product_of<1>(first, second, count, rule, exchange);
    case 2:
      return product_of<2>(first, second, count, rule, exchange);
    case 3:
      return product_of<3>(first, second, count, rule, exchange);
    case 4:
      return product_of<4>(first, second, count, rule, exchange);
    case 5:
      return product_of<5>(first, second, count, rule, exchange);
    default:
      return product_of<6>(first, second, count, rule, exchange);
  }
}

void edges_of_any(const PatchRecord* const* first, const PatchRecord* const* second, int count, const EdgeRule& rule,
                  double* exchange) {
  for (int start = 0; start < count; start += kLanes) {
    const int lanes_used = count - start < kLanes ? count - start : kLanes;
    const Lanes first_lanes(first + start, lanes_used), second_lanes(second + start, lanes_used);
    const Outline a{Shape(first_lanes)}, b{Shape(second_lanes)};
    const Vector origins = a.origin - b.origin;
    // Σ e·f = 0, so that any unit of length will do: one that keeps the logarithms small.
    const Real unit = square_of(square_of(dot(origins, origins))), both_units = unit * unit;
    Real sum = splat(0);
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j) {
        const Real a_b = dot(a.half[i], b.half[j]);
        if (!any(a_b != splat(0))) continue;
        const EdgePair pair(origins + (a.middle[i] - b.middle[j]), a.half[i], b.half[j]);
        const Real a_squared = dot(a.half[i], a.half[i]), b_squared = dot(b.half[j], b.half[j]);
        EdgePair::Points at[kMaxEdgePoints / 2];
        Real of_pair = splat(0);
        for (int p = 0; p < rule.half; ++p) {
          const double s = rule.node[p];
          at[p] = pair.at(s, (s * s) * a_squared, (2 * s) * a_b);
          of_pair += (rule.weight[p] * rule.weight[p]) * log_ratio(product(at[p], s, (s * s) * b_squared), unit);
          // (p, q) and (q, p) weigh the same.
          Real inner = splat(0);
          for (int q = 0; q < p; ++q) {
            const double t = rule.node[q];
            inner +=
                rule.weight[q] *
                log_ratio(product(at[p], t, (t * t) * b_squared) * product(at[q], s, (s * s) * b_squared), both_units);
          }
          of_pair += rule.weight[p] * inner;
        }
        sum += a_b * of_pair;
      }
    sum *= 1 / kPi;
    store(exchange + start, sum, lanes_used);
  }
}

void edges(const PatchRecord* const* first, const PatchRecord* const* second, int count, const EdgeRule& rule,
           bool parallelograms, double* exchange) {
  if (!parallelograms) return edges_of_any(first, second, count, rule, exchange);
  for (int start = 0; start < count; start += kLanes) {
    const int lanes_used = count - start < kLanes ? count - start : kLanes;
    const Lanes first_lanes(first + start, lanes_used), second_lanes(second + start, lanes_used);
    store(exchange + start, edges_of_parallelograms(first_lanes, second_lanes, rule), lanes_used);
  }
}

}  // namespace

const Kernels& INTERGLOW_KERNELS() {
  static constexpr Kernels kTable{
      INTERGLOW_KERNEL_NAME, settle, choose, choose_products, classify, centres, product, edges};
  return kTable;
}

}  // namespace interglow::radiosity::batch
