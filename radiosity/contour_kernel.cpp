// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/contour_kernel.h"

#include <algorithm>
#include <numbers>
#include <type_traits>

namespace interglow::radiosity::detail {
namespace {

GaussRule make_gauss_legendre(int n) {
  GaussRule rule;
  rule.points = n;
  for (int i = 0; i < n; ++i) {
    long double x = std::cos(std::numbers::pi_v<long double> * (i + 0.75L) / (n + 0.5L)), slope = 1;
    for (int step = 0; step < 60; ++step) {  // Newton on the Legendre polynomial, from its three-term recurrence
      long double p = 1, before = 0;
      for (int k = 1; k <= n; ++k) {
        const long double next = ((2 * k - 1) * x * p - (k - 1) * before) / k;
        before = p;
        p = next;
      }
      slope = n * (x * p - before) / (x * x - 1);
      const long double change = p / slope;
      x -= change;
      if (std::abs(change) < 2e-19L) break;
    }
    rule.node[i] = x;
    rule.weight[i] = 2 / ((1 - x * x) * slope * slope);
  }
  return rule;
}

/// x ln|y|, with 0 where the factor vanishes.
template <class Real>
Real times_log(Real factor, Real positive) {
  return factor == 0 || positive == 0 ? Real(0) : factor * std::log(positive);
}

/// Where the outer edge's points stand to the inner edge's line: all is linear or quadratic in the outer parameter.
template <class Real>
struct EdgePair {
  using Vector = Eigen::Matrix<Real, 3, 1>;
  Vector outer_origin, outer_direction, inner_origin, inner_direction;
  Real outer_length, inner_length;
  Real sine;                      ///< |u × v|
  Real along_outer, along_inner;  ///< parameters of the two points where the lines come closest (sine > 0)
  Real gap;                       ///< distance of the lines there
};

/// ∫_0^s ∫_0^t ln r for lines that cross at the origin under an angle: by homogeneity (Euler) a sum of two inner
/// integrals.
template <class Real>
Real corner_integral(Real s, Real t, Real cosine, Real sine) {
  const auto inner = [&](Real at, Real end) {  // ∫_0^end ln r dt' from the point `at` on the other line
    const Real foot = at * cosine, height = std::abs(at) * sine, rest = end - foot;
    return times_log(rest, std::hypot(rest, height)) + times_log(foot, std::abs(at)) - end +
           height * (std::atan2(rest, height) + std::atan2(foot, height));
  };
  if (s == 0 || t == 0) return 0;
  return (s * inner(s, t) + t * inner(t, s) - s * t) / 2;
}

/// Second antiderivative of ln sqrt(h² + z²).
template <class Real>
Real parallel_integral(Real z, Real h) {
  const Real r = std::hypot(z, h);
  const Real arc = h == 0 ? Real(0) : h * z * std::atan2(z, h);
  return times_log((z - h) * (z + h) / 2, r) + arc - 3 * z * z / 4;
}

template <class Real>
class ContourSum {
 public:
  using Vector = Eigen::Matrix<Real, 3, 1>;

  ContourSum(Real tolerance, int terms) : panel_tolerance_(tolerance / terms) {}

  void add_edges(const Vector& p0, const Vector& p1, const Vector& q0, const Vector& q1) {
    const Vector p = p1 - p0, q = q1 - q0;
    const Real p_length = p.norm(), q_length = q.norm();
    if (p_length == 0 || q_length == 0) return;
    const Real cosine = p.dot(q) / (p_length * q_length);
    if (cosine == 0) return;
    scale_ = cosine;
    magnitude_ = 0;
    const Real value = p_length <= q_length ? edge_pair(p0, p1, p / p_length, p_length, q0, q1, q / q_length, q_length)
                                            : edge_pair(q0, q1, q / q_length, q_length, p0, p1, p / p_length, p_length);
    add(cosine * value);
    rounding_ += std::abs(cosine) * magnitude_;
  }

  ContourResult result() const {
    const Real share = 1 / (2 * std::numbers::pi_v<Real>);
    return {static_cast<long double>((sum_ + carry_) * share), static_cast<long double>(truncation_ * share),
            static_cast<long double>(kRoundings * std::numeric_limits<Real>::epsilon() * rounding_ * share)};
  }

 private:
  // Neumaier's sum: the terms of a tiny polygon cancel to the square of its size.
  void add(Real term) {
    const Real next = sum_ + term;
    carry_ += std::abs(sum_) >= std::abs(term) ? (sum_ - next) + term : (term - next) + sum_;
    sum_ = next;
  }

  /// ∫∫ ln r; the outer edge is the shorter one.
  Real edge_pair(const Vector& p0, const Vector& p1, const Vector& u, Real p_length, const Vector& q0, const Vector& q1,
                 const Vector& v, Real q_length) {
    const Vector cross = u.cross(v);
    EdgePair<Real> pair{p0, u, q0, v, p_length, q_length, cross.norm(), 0, 0, 0};
    const Real rounding = 4 * std::numeric_limits<Real>::epsilon();
    const bool parallel = pair.sine * std::max(q_length, Real(1)) <= rounding;
    if (!parallel) {
      const Vector between = q0 - p0;
      pair.along_outer = between.cross(v).dot(cross) / (pair.sine * pair.sine);
      // The same point on the inner line. On its own it would be as uncertain, and where both edges lie on one line up
      // to rounding, a crossing that the two place differently shifts the edges against each other.
      pair.along_inner = pair.along_outer * u.dot(v) - between.dot(v);
      pair.gap = std::abs(between.dot(cross)) / pair.sine;
      // A corner that both edges share is the crossing, without rounding.
      const bool from_start = p0 == q0 || p0 == q1, from_end = p1 == q0 || p1 == q1;
      if (from_start || from_end) {
        pair.along_outer = from_start ? Real(0) : p_length;
        pair.along_inner = (from_start ? p0 == q0 : p1 == q0) ? Real(0) : q_length;
        pair.gap = 0;
      }
    } else {
      pair.sine = 0;
    }
    if (parallel || pair.gap <= rounding) {
      const Real near_inner_middle = parallel ? (p0 + p_length / 2 * u - q0).dot(v) : pair.along_inner;
      const bool reaches = parallel || (pair.along_outer >= -p_length && pair.along_outer <= 2 * p_length);
      // The closed forms lose the digits that a long inner edge has more than the short outer one: they take its near
      // part only.
      const Real from = std::clamp(near_inner_middle - 3 * p_length, Real(0), q_length);
      const Real to = std::clamp(near_inner_middle + 3 * p_length, Real(0), q_length);
      if (reaches && to > from && is_near(pair, from, to)) {
        Real value = closed_form(pair, parallel, from, to);
        if (from > 0) value += quadrature(part_of(pair, 0, from));
        if (to < q_length) value += quadrature(part_of(pair, to, q_length));
        return value;
      }
    }
    return quadrature(pair);
  }

  static EdgePair<Real> part_of(EdgePair<Real> pair, Real from, Real to) {
    pair.inner_origin += from * pair.inner_direction;
    pair.inner_length = to - from;
    pair.along_inner -= from;
    return pair;
  }

  /// Whether the quadrature would have to halve panels.
  static bool is_near(const EdgePair<Real>& pair, Real from, Real to) {
    const Vector middle = pair.outer_origin + pair.outer_length / 2 * pair.outer_direction;
    const Real foot = std::clamp((middle - pair.inner_origin).dot(pair.inner_direction), from, to);
    return (middle - pair.inner_origin - foot * pair.inner_direction).norm() < kReach * pair.outer_length / 2;
  }

  Real closed_form(const EdgePair<Real>& pair, bool parallel, Real from, Real to) {
    magnitude_ += pair.outer_length * (to - from + pair.outer_length) * 4;
    const Real cosine = pair.outer_direction.dot(pair.inner_direction);
    if (parallel) {
      const Vector between = pair.outer_origin - pair.inner_origin;
      const Real height = between.cross(pair.inner_direction).norm();
      const Real start = between.dot(pair.inner_direction);
      const Real end = start + std::copysign(pair.outer_length, cosine);
      const Real value = parallel_integral(end - from, height) - parallel_integral(start - from, height) -
                         parallel_integral(end - to, height) + parallel_integral(start - to, height);
      return cosine > 0 ? value : -value;
    }
    const Real s0 = -pair.along_outer, s1 = pair.outer_length - pair.along_outer;
    const Real t0 = from - pair.along_inner, t1 = to - pair.along_inner;
    return corner_integral(s1, t1, cosine, pair.sine) - corner_integral(s0, t1, cosine, pair.sine) -
           corner_integral(s1, t0, cosine, pair.sine) + corner_integral(s0, t0, cosine, pair.sine);
  }

  Real quadrature(const EdgePair<Real>& pair) { return panel(pair, 0, pair.outer_length); }

  /// ∫ of the inner integral over the outer edge's [from, to], halved until no corner stands near.
  Real panel(const EdgePair<Real>& pair, Real from, Real to) {
    const Real half = (to - from) / 2, middle = (from + to) / 2;
    const Real cosine = pair.outer_direction.dot(pair.inner_direction);
    const Vector offset = pair.outer_origin + middle * pair.outer_direction - pair.inner_origin;
    const Real along = offset.dot(pair.inner_direction);  // foot of the panel's middle on the inner line
    const Vector across = offset - along * pair.inner_direction;
    const Real height = across.norm();
    const Real start = -along, end = pair.inner_length - along;
    const Real to_corner = std::min(std::hypot(start, height), std::hypot(end, height));
    const Real drift = std::abs(cosine) * half;
    const bool start_fixed = std::abs(start) >= drift, end_fixed = std::abs(end) >= drift;
    const bool inside = start < 0 && end > 0;
    const bool split_kink = inside && start_fixed && end_fixed;
    const bool smooth = height >= kReach * half * pair.sine || (start_fixed && end_fixed);
    // A panel shorter than the rounding of its coordinates cannot matter, for the integrand is bounded; and halving it
    // would not end, because none of its parts can be told from the corner.
    if (half > std::numeric_limits<Real>::epsilon() && (!smooth || to_corner < kReach * half)) {
      return panel(pair, from, middle) + panel(pair, middle, to);
    }

    const Real reach = std::max(to_corner / half, Real(1.001));
    const Real ellipse = reach + std::sqrt(reach * reach - 1);
    // 16: (64/15) of the Bernstein bound times the inner integral on the ellipse, about 3 inner lengths.
    const Real variation = 16 * half * std::min(pair.inner_length, 4 * (to_corner + half) + height);
    int points = 2;
    Real left_out = variation * std::pow(ellipse, Real(-4));
    const Real squared = ellipse * ellipse;
    const Real wanted = std::max(panel_tolerance_ / std::max(std::abs(scale_), Real(1e-3)),
                                 std::numeric_limits<Real>::epsilon() * half * pair.inner_length / 4);
    while (left_out > wanted && points < 24) left_out /= squared, ++points;
    truncation_ += std::abs(scale_) * left_out;

    const GaussRule& rule = gauss_legendre(points);
    Real sum = 0, size = 0;
    for (int i = 0; i < points; ++i) {
      const Real t = middle + half * static_cast<Real>(rule.node[i]);
      const Vector x = pair.outer_origin + t * pair.outer_direction - pair.inner_origin;
      const Real foot = x.dot(pair.inner_direction);
      const Real h = x.cross(pair.inner_direction).norm();
      const Real s0 = -foot, s1 = pair.inner_length - foot;
      const Real r0 = std::hypot(s0, h), r1 = std::hypot(s1, h);
      const Real arc = split_kink ? -h * (std::atan2(h, s1) + std::atan2(h, -s0))
                                  : h * std::atan2(h * pair.inner_length, h * h + s0 * s1);
      const Real logs = times_log(s1, r1) - times_log(s0, r0);
      sum += static_cast<Real>(rule.weight[i]) * (logs - pair.inner_length + arc);
      size = std::max(size, std::abs(logs) + pair.inner_length);
    }
    magnitude_ += 2 * half * size;
    Real value = half * sum;
    if (split_kink) value += std::numbers::pi_v<Real> * distance_integral(pair, from, to);
    return value;
  }

  /// ∫ h over the outer edge's [from, to], h the distance to the inner line.
  Real distance_integral(const EdgePair<Real>& pair, Real from, Real to) const {
    const auto height_at = [&](Real t) {
      const Vector x = pair.outer_origin + t * pair.outer_direction - pair.inner_origin;
      return x.cross(pair.inner_direction).norm();
    };
    const Real a = from - pair.along_outer, b = to - pair.along_outer;
    // Nearly parallel lines cross too far away for the antiderivative; h is then smooth and a plain rule exact enough.
    if (pair.sine == 0 || pair.gap >= 30 * pair.sine * std::max(std::abs(a), std::abs(b)) ||
        (a * b > 0 && std::min(std::abs(a), std::abs(b)) > 4 * (b - a))) {
      const GaussRule& rule = gauss_legendre(16);
      Real sum = 0;
      for (int i = 0; i < rule.points; ++i)
        sum += static_cast<Real>(rule.weight[i]) *
               height_at((from + to) / 2 + (to - from) / 2 * static_cast<Real>(rule.node[i]));
      return (to - from) / 2 * sum;
    }
    const auto antiderivative = [&](Real tau) {  // of sqrt(gap² + sine² τ²), odd in τ
      const Real h = std::hypot(pair.gap, pair.sine * tau);
      const Real log_part =
          pair.gap == 0 ? Real(0) : pair.gap * pair.gap / pair.sine * std::asinh(pair.sine * tau / pair.gap);
      return (tau * h + log_part) / 2;
    };
    return antiderivative(b) - antiderivative(a);
  }

  static constexpr Real kReach =
      2.5;  ///< distance of the nearest corner over half a panel's length; 2.5 gives 1e-19 at 16 points
  /// Roundings a term may gather: 25 were seen in double, whose corners are rounded themselves (a patch ten sizes from
  /// one of 1e4 times its area), 9 in extended precision.
  static constexpr Real kRoundings = std::is_same_v<Real, double> ? 40 : 16;

  Real panel_tolerance_;
  Real sum_ = 0, carry_ = 0;
  Real scale_ = 0;      ///< u·v of the present pair of edges
  Real magnitude_ = 0;  ///< of what was summed for it
  Real truncation_ = 0, rounding_ = 0;
};

}  // namespace

const GaussRule& gauss_legendre(int n) {
  static const std::array<GaussRule, 25> rules = [] {
    std::array<GaussRule, 25> made;
    for (int i = 1; i <= 24; ++i) made[i] = make_gauss_legendre(i);
    return made;
  }();
  return rules[n];
}

template <class Real>
ContourResult contour_exchange_area(const ClippedPolygon<Real>& a, const ClippedPolygon<Real>& b, Real tolerance) {
  ContourSum<Real> sum(tolerance, a.corners * b.corners);
  for (int i = 0; i < a.corners; ++i)
    for (int j = 0; j < b.corners; ++j)
      sum.add_edges(a.corner[i], a.corner[i + 1 == a.corners ? 0 : i + 1], b.corner[j],
                    b.corner[j + 1 == b.corners ? 0 : j + 1]);
  return sum.result();
}

template ContourResult contour_exchange_area(const ClippedPolygon<double>&, const ClippedPolygon<double>&, double);
template ContourResult contour_exchange_area(const ClippedPolygon<long double>&, const ClippedPolygon<long double>&,
                                             long double);

}  // namespace interglow::radiosity::detail
