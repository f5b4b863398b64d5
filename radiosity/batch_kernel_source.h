// SPDX-License-Identifier: GPL-3.0-or-later
// The vectorised kernels, included once for each instruction set by batch_kernel_<set>.cpp, which define
//   INTERGLOW_LANES     doubles in a vector
//   INTERGLOW_KERNELS   name of the function that returns the table
// Lanes never mix, so a pair's bits do not depend on its neighbours in the packet. No header with inline functions may
// be included (see batch_kernel.h).
#include "radiosity/batch_kernel.h"

namespace interglow::radiosity::batch {
namespace {

constexpr int kLanes = INTERGLOW_LANES;
using Real = double __attribute__((vector_size(kLanes * sizeof(double))));
using Mask = long long __attribute__((vector_size(kLanes * sizeof(double))));

constexpr double kPi = 3.14159265358979323846;
constexpr double kEpsilon = 2.220446049250313e-16;
/// Rounding of plane distances in normalised coordinates (at most 2): sides within it are left to the exact decision.
constexpr double kSideRounding = 64 * kEpsilon;

inline Real splat(double value) { return Real{} + value; }
inline Real max(Real a, Real b) { return a > b ? a : b; }
inline Real min(Real a, Real b) { return a < b ? a : b; }

inline Real square_root(Real x) {
  Real y;
  for (int lane = 0; lane < kLanes; ++lane) y[lane] = __builtin_sqrt(x[lane]);
  return y;
}

struct Vector {
  Real x, y, z;
};
inline Vector operator+(Vector a, Vector b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vector operator-(Vector a, Vector b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vector operator*(Real s, Vector a) { return {s * a.x, s * a.y, s * a.z}; }
inline Real dot(Vector a, Vector b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

/// The records of one side of a packet; often all the same one.
struct Lanes {
  const PatchRecord* record[kLanes];
  bool uniform;

  Lanes(const PatchRecord* const* records, int count) : uniform(true) {
    for (int lane = 0; lane < kLanes; ++lane) {
      record[lane] = records[lane < count ? lane : count - 1];
      uniform = uniform && record[lane] == record[0];
    }
  }
  template <class Pick>
  Real load(Pick pick) const {
    if (uniform) return splat(pick(*record[0]));
    Real value;
    for (int lane = 0; lane < kLanes; ++lane) value[lane] = pick(*record[lane]);
    return value;
  }
  template <class Pick>
  Vector load_vector(Pick pick) const {
    return {load([&](const PatchRecord& r) { return pick(r)[0]; }),
            load([&](const PatchRecord& r) { return pick(r)[1]; }),
            load([&](const PatchRecord& r) { return pick(r)[2]; })};
  }
};

struct Patch {
  Vector origin, e1, e2, e3, normal, centre;
  explicit Patch(const Lanes& lanes)
      : origin(lanes.load_vector([](const PatchRecord& r) { return r.origin; })),
        e1(lanes.load_vector([](const PatchRecord& r) { return r.e1; })),
        e2(lanes.load_vector([](const PatchRecord& r) { return r.e2; })),
        e3(lanes.load_vector([](const PatchRecord& r) { return r.e3; })),
        normal(lanes.load_vector([](const PatchRecord& r) { return r.normal; })),
        centre(lanes.load_vector([](const PatchRecord& r) { return r.centre; })) {}
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
  void range(Real& low, Real& high) const {
    const Real a = at_origin, b = a + along_u, c = a + along_v, d = b + along_v + along_uv;
    low = min(min(a, b), min(c, d));
    high = max(max(a, b), max(c, d));
  }
};

void classify(const PatchRecord* const* first, const PatchRecord* const* second, int count, double tolerance,
              std::int32_t* choice, double* bound) {
  for (int start = 0; start < count; start += kLanes) {
    const int lanes_used = count - start < kLanes ? count - start : kLanes;
    const Lanes first_lanes(first + start, lanes_used), second_lanes(second + start, lanes_used);
    const Patch a(first_lanes), b(second_lanes);
    const auto scalar_of = [](const Lanes& lanes, double PatchRecord::*member) {
      return lanes.load([member](const PatchRecord& r) { return r.*member; });
    };
    const Real radius_a = scalar_of(first_lanes, &PatchRecord::radius),
               radius_b = scalar_of(second_lanes, &PatchRecord::radius);
    const Vector between = b.centre - a.centre;
    const Real distance = square_root(dot(between, between));
    const Real reach = distance + radius_a + radius_b;
    const Real open_a = kSideRounding + scalar_of(first_lanes, &PatchRecord::deviation) +
                        scalar_of(first_lanes, &PatchRecord::lever) * reach;
    const Real open_b = kSideRounding + scalar_of(second_lanes, &PatchRecord::deviation) +
                        scalar_of(second_lanes, &PatchRecord::lever) * reach;
    Real low_a, high_a, low_b, high_b;
    Height(a, b).range(low_a, high_a);
    Height(b, a).range(low_b, high_b);
    const Mask hidden = (high_a < -open_b) | (high_b < -open_a) |
                        ((high_a <= open_b) & (low_a >= -open_b) & (high_b <= open_a) & (low_b >= -open_a) &
                         (dot(a.normal, b.normal) > 0)) |
                        (scalar_of(first_lanes, &PatchRecord::area) * scalar_of(second_lanes, &PatchRecord::area) <= 0);
    // Corners on the other's plane within rounding need no clipping: the rules count heights below it as 0.
    const Mask in_front = (low_a >= -open_b) & (low_b >= -open_a) & (high_a > open_b) & (high_b > open_a);

    // |k-th Taylor coefficient of the kernel| <= (k + 1) / (π D^(k + 2)), so a rule of degree 2m - 1 leaves at most
    // (2m + 1) spread[m] / (π D^2m (D - R)²) of the mean, for each side; D: distance from the centre to the other
    // patch.
    const Real area = scalar_of(first_lanes, &PatchRecord::area) * scalar_of(second_lanes, &PatchRecord::area);
    const Real limit =
        tolerance * min(scalar_of(first_lanes, &PatchRecord::area), scalar_of(second_lanes, &PatchRecord::area));
    // D by balls, by the heights over the own plane, and by what lies along the line of centres; the largest holds.
    const Vector along = (1.0 / max(distance, splat(1e-100))) * between;
    Real a_begin, a_end, b_begin, b_end;  // from the centre of a
    Height(a, along, a.centre).range(a_begin, a_end);
    Height(b, along, a.centre).range(b_begin, b_end);
    const Real away_a = max(max(distance - radius_b, low_b), b_begin),
               away_b = max(max(distance - radius_a, low_a), distance - a_end);
    const Real gap_a = away_a - radius_a, gap_b = away_b - radius_b,
               gap = max(distance - radius_a - radius_b, b_begin - a_end);
    const Mask clear = (gap_a > 0) & (gap_b > 0), apart = gap > 0;
    const Real inverse_a = 1.0 / (away_a * away_a), inverse_b = 1.0 / (away_b * away_b),
               inverse_gap = 1.0 / (gap * gap);
    // The height of the visible parts bounds what a clamped rule can miss where one plane cuts the other patch.
    const Real crossing = max(high_a, splat(0)) * max(high_b, splat(0)) * inverse_gap * inverse_gap * area / kPi;
    Real chosen = splat(kScalar), chosen_bound = splat(0);
    Real power_a = 1.0 / (gap_a * gap_a), power_b = 1.0 / (gap_b * gap_b);
    const Real extra =
        max(scalar_of(first_lanes, &PatchRecord::bilinear), scalar_of(second_lanes, &PatchRecord::bilinear));
    for (int m = 1; m < kMaxOrder; ++m) {
      power_a *= inverse_a;
      power_b *= inverse_b;
      const Real spread_a = first_lanes.load([m](const PatchRecord& r) { return r.spread[m]; });
      const Real spread_b = second_lanes.load([m](const PatchRecord& r) { return r.spread[m]; });
      const Real left = (2 * m + 1) / kPi * area * (spread_a * power_a + spread_b * power_b);
      const Mask take = (left <= limit) & (chosen == splat(kScalar));
      chosen = take ? extra + static_cast<double>(m) : chosen;
      chosen_bound = take ? left : chosen_bound;
    }
    const Mask far = in_front & clear;
    const Mask cut = ~in_front & apart & (crossing <= limit);
    chosen = far ? chosen : (cut ? splat(2) : splat(kScalar));
    chosen_bound = cut ? crossing : chosen_bound;
    chosen = hidden ? splat(kNothing) : chosen;
    for (int lane = 0; lane < lanes_used; ++lane) {
      choice[start + lane] = static_cast<std::int32_t>(chosen[lane]);
      bound[start + lane] = chosen_bound[lane];
    }
  }
}

/// Nodes of one patch: points, and height over the other's plane times weight (heights below it count as 0).
template <int kPoints>
struct Nodes {
  Vector point[kPoints * kPoints];
  Real weighted_height[kPoints * kPoints];

  Nodes(const Lanes& lanes, const Patch& patch, const Patch& other, const ProductRule& rule) {
    const Height height(patch, other);
    const Real triangle = lanes.load([](const PatchRecord& r) { return r.triangle; });
    const Vector density = lanes.load_vector([](const PatchRecord& r) { return r.density; });
    for (int i = 0; i < kPoints * kPoints; ++i) {
      const Real u = triangle > 0 ? splat(rule.u[1][i]) : splat(rule.u[0][i]);
      const Real v = triangle > 0 ? splat(rule.v[1][i]) : splat(rule.v[0][i]);
      const Real weight = triangle > 0 ? splat(rule.weight[1][i]) : splat(rule.weight[0][i]);
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
    const Nodes<kPoints> from(first_lanes, a, b, rule), to(second_lanes, b, a, rule);
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
    const Real area = first_lanes.load([](const PatchRecord& r) { return r.area; }) *
                      second_lanes.load([](const PatchRecord& r) { return r.area; });
    sum *= area * (1 / kPi);
    for (int lane = 0; lane < lanes_used; ++lane) exchange[start + lane] = sum[lane];
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

}  // namespace

const Kernels& INTERGLOW_KERNELS() {
  static constexpr Kernels table{INTERGLOW_KERNEL_NAME, classify, product};
  return table;
}

}  // namespace interglow::radiosity::batch
