// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/contour_kernel.h"

#include <algorithm>
#include <numbers>
#include <type_traits>

#include "radiosity/contour_edges.h"

namespace interglow::radiosity::detail {
namespace {

constexpr int kMostPoints = 24;

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

/// The rules in working precision; the positive nodes come first.
template <class Real>
struct Rules {
  struct Rule {
    std::array<Real, kMostPoints> node, square, weight;
  };
  std::array<Rule, kMostPoints + 1> of;  ///< by number of points
  /// Gauss' error for a function on [-1, 1] with Chebyshev coefficients of at most (2/k) ρ^-k is at most this times
  /// ρ^-2n / (1 - ρ^-2).
  std::array<Real, kMostPoints + 1> share;
  std::array<Real, 65> inverse{};  ///< 1 / n

  Rules() {
    for (int n = 1; n <= kMostPoints; ++n) {
      const GaussRule& exact = gauss_legendre(n);
      for (int i = 0; i < n; ++i) {
        of[n].node[i] = static_cast<Real>(exact.node[i]);
        of[n].square[i] = static_cast<Real>(exact.node[i] * exact.node[i]);
        of[n].weight[i] = static_cast<Real>(exact.weight[i]);
      }
      share[n] = Real(2) / n * (1 + Real(1) / (4 * n * n - 1));
    }
    for (int n = 1; n <= 64; ++n) inverse[n] = Real(1) / n;
  }
};

template <class Real>
const Rules<Real>& rules() {
  static const Rules<Real> made;
  return made;
}

/// x ln sqrt(y), with 0 where the factor vanishes.
template <class Real>
Real times_log_root(Real factor, Real square) {
  return factor == 0 || square == 0 ? Real(0) : factor / 2 * std::log(square);
}

/// Where the outer edge's points stand to the inner edge's line: all is linear or quadratic in the outer parameter.
template <class Real>
struct EdgePair {
  using Vector = Eigen::Matrix<Real, 3, 1>;
  Vector outer_origin, outer_direction, inner_origin, inner_direction;
  Real outer_length, inner_length;
  Real cosine;
  Real sine;                      ///< |u × v|
  Real along_outer, along_inner;  ///< parameters of the two points where the lines come closest (sine > 0)
  Real gap;                       ///< distance of the lines there
};

/// ∫_0^s ∫_0^t ln r for lines that cross at the origin under an angle: by homogeneity (Euler) a sum of two inner
/// integrals, whose angles are those of the triangle of the crossing and the two ends.
template <class Real>
Real corner_integral(Real s, Real t, Real cosine, Real sine) {
  if (s == 0 || t == 0) return 0;
  const Real facing = s * t > 0 ? cosine : -cosine, s_size = std::abs(s), t_size = std::abs(t);
  const Real s_rest = s_size - t_size * facing, t_rest = t_size - s_size * facing;
  const Real s_height = t_size * sine, t_height = s_size * sine;
  const Real angles = s * s * std::atan2(s_height, s_rest) + t * t * std::atan2(t_height, t_rest);
  const Real s_square = s * s, t_square = t * t;
  const Real logs = times_log_root(s_size * t_rest + t_size * s_rest, s_rest * s_rest + s_height * s_height) +
                    facing / 2 * (s_square * std::log(s_square) + t_square * std::log(t_square));
  const Real value = (logs + sine * angles - 3 * s_size * t_size) / 2;
  return s * t > 0 ? value : -value;
}

/// Second antiderivative of ln sqrt(h² + z²).
template <class Real>
Real parallel_integral(Real z, Real h) {
  const Real arc = h == 0 || z == 0 ? Real(0) : h * z * std::atan2(z, h);
  return times_log_root((z - h) * (z + h) / 2, z * z + h * h) + arc - 3 * z * z / 4;
}

template <class Real>
class ContourSum {
 public:
  using Vector = Eigen::Matrix<Real, 3, 1>;

  /// @param tolerance  of the sum over all pairs of edges
  ContourSum(Real tolerance, int pairs) : left_(tolerance), pairs_left_(pairs), rules_(rules<Real>()) {}

  /// What one pair of edges leaves of its share goes to those after it.
  void add(const Outline<Real>& a, int a_block, int a_lane, const Outline<Real>& b, int b_block) {
    const Distances<Lanes<Real>> d = distances(a, a_block, a_lane, b, b_block);
    const Lanes<Real> weights = larger(d.both, -d.both);
    if (!LanesOf<Real>::any(weights > Lanes<Real>{})) {  // right angles, or no edges
      pairs_left_ -= kLanes<Real>;
      return;
    }
    const Lanes<Real> a_square = Lanes<Real>{} + lane_of<Real>(a.half_square[a_block], a_lane);
    const Lanes<Real> a_inverse = Lanes<Real>{} + lane_of<Real>(a.inverse[a_block], a_lane);
    const Lanes<Real> b_square = b.half_square[b_block], b_inverse = b.inverse[b_block];
    const auto p_sum =
        least_square_sum<Real>(d.middles, d.along_p, d.along_q, d.both, a_square, a_inverse, b_square, b_inverse);
    const auto q_sum =
        least_square_sum<Real>(d.middles, -d.along_q, -d.along_p, d.both, b_square, b_inverse, a_square, a_inverse);
    const Lanes<Real> p_decay = decay_of_square<Real>(p_sum), q_decay = decay_of_square<Real>(q_sum);
    // The mean of |ln r| is at most 2 + 1 / length, for r < 3.5.
    const Lanes<Real> whole = 4 * weights * (2 + (a_inverse < b_inverse ? a_inverse : b_inverse));
    for (int lane = 0; lane < kLanes<Real>; ++lane) {
      share_ = left_ * rules_.inverse[pairs_left_--];
      const Real weight = lane_of<Real>(weights, lane);
      if (weight == 0) continue;
      const Real before = truncation_;
      if (8 * lane_of<Real>(whole, lane) <= share_) {
        truncation_ += lane_of<Real>(whole, lane);
      } else if (!by_points_on_both({lane_of<Real>(d.middles, lane), lane_of<Real>(d.along_p, lane),
                                     lane_of<Real>(d.along_q, lane), lane_of<Real>(d.both, lane)},
                                    lane_of<Real>(a_square, lane), lane_of<Real>(b_square, lane),
                                    lane_of<Real>(p_decay, lane), lane_of<Real>(q_decay, lane),
                                    lane_of<Real>(p_sum, lane))) {
        const int i = a_block + a_lane * a.blocks, j = b_block + lane * b.blocks;
        if (!by_common_corner({a.corner(i), a.corner(i + 1)}, {b.corner(j), b.corner(j + 1)},
                              lane_of<Real>(d.both, lane), lane_of<Real>(a_inverse, lane),
                              lane_of<Real>(b_inverse, lane))) {
          const Edge<Real> p(a, i), q(b, j);
          if (p.length <= q.length) {
            by_inner_integral(p, q);
          } else {
            by_inner_integral(q, p);
          }
        }
      }
      left_ = std::max(left_ - (truncation_ - before), Real(0));
    }
  }

  ContourResult result() const {
    const Real share = 1 / (2 * std::numbers::pi_v<Real>);
    return {static_cast<long double>((sum_ + carry_) * share), static_cast<long double>(truncation_ * share),
            static_cast<long double>(kRoundings * kEpsilon * rounding_ * share)};
  }

 private:
  // Neumaier's sum: the terms of a tiny polygon cancel to the square of its size.
  void add(Real term) {
    const Real next = sum_ + term;
    carry_ += std::abs(sum_) >= std::abs(term) ? (sum_ - next) + term : (term - next) + sum_;
    sum_ = next;
  }

  struct Points {
    int count = 0;  ///< past kMostPoints: not even so many are enough
    Real left_out = 0;
  };

  /// The least even number of points whose error times `size` is at most `wanted`, for functions like ln r on [-1, 1].
  Points even_points(Real decay, Real size, Real wanted) const {
    const Real squared = decay * decay, most = wanted * (1 - decay);
    Real tail = size * squared;
    int n = 2;
    while (n <= kMostPoints && !(tail * rules_.share[n] <= most)) tail *= squared, n += 2;
    return {n, n <= kMostPoints ? tail * rules_.share[n] / (1 - decay) : Real(0)};
  }

  /// Gauss points on both edges, if not too many of them are needed.
  bool by_points_on_both(const Distances<Real>& d, Real p_squared, Real q_squared, Real p_decay, Real q_decay,
                         Real p_sum) {
    const auto& [middles, along_p, along_q, both] = d;
    // Products of eight squared distances must not leave the range of double.
    if (!(std::max(p_decay, q_decay) < kMostDecayOfBoth) || middles < Real(1e-30)) return false;
    const Real weight = std::abs(both), wanted = std::max(share_ / 2, kEpsilon / 2 * weight);
    const Points on_p = even_points(p_decay, 2 * weight, wanted);
    const Points on_q = even_points(q_decay, 2 * weight, wanted);
    const int most = std::max(on_p.count, on_q.count);
    if (most > kMostPoints || on_p.count * on_q.count > kMostDistances) return false;
    truncation_ += on_p.left_out + on_q.left_out;

    // The four points at ±s and ±t have one weight: the product of their squared distances has one logarithm. So have
    // the points at ±t and ±s where both edges have the same rule, which is given them where that saves logarithms.
    const bool same_rule = most * (most + 2) / 2 <= on_p.count * on_q.count;
    const auto& rule_p = rules_.of[same_rule ? most : on_p.count];
    const auto& rule_q = rules_.of[same_rule ? most : on_q.count];
    const int p_pairs = (same_rule ? most : on_p.count) / 2, q_pairs = (same_rule ? most : on_q.count) / 2;
    struct Middle {
      Real plus, minus, plus_turned, minus_turned;
    };
    std::array<Middle, kMostPoints / 2> at;
    for (int i = 0; i < p_pairs; ++i) {
      const Real s = rule_p.node[i], middle = middles + rule_p.square[i] * p_squared, move = 2 * s * along_p;
      const Real plus_turn = 2 * (along_q + s * both), minus_turn = 2 * (along_q - s * both);
      at[i] = {middle + move, middle - move, plus_turn * plus_turn, minus_turn * minus_turn};
    }
    const auto product = [&](int i, int k) {
      const Real t_square = rule_q.square[k], along = t_square * q_squared;
      const Real plus = at[i].plus + along, minus = at[i].minus + along;
      return (plus * plus - t_square * at[i].plus_turned) * (minus * minus - t_square * at[i].minus_turned);
    };
    Real sum = 0;
    for (int i = 0; i < p_pairs; ++i) {
      Real inner = 0;
      if (same_rule) {
        for (int k = 0; k < i; ++k) inner += rule_q.weight[k] * std::log(product(i, k) * product(k, i));
        inner += rule_q.weight[i] * std::log(product(i, i));
      } else {
        for (int k = 0; k < q_pairs; ++k) inner += rule_q.weight[k] * std::log(product(i, k));
      }
      sum += rule_p.weight[i] * inner;
    }
    add(both / 2 * sum);
    // A squared distance has the roundings of the largest terms it is made of.
    const Real largest = middles + p_squared + q_squared + 2 * (std::abs(along_p) + std::abs(along_q) + weight);
    const Real distance_square = p_squared * (p_sum - 1);
    rounding_ += 4 * weight * (std::abs(sum) / 8 + largest / (8 * distance_square));
    return true;
  }

  /// Edges that share a corner, unless they lie on one line or are so different that the closed form loses digits.
  bool by_common_corner(const std::array<Vector, 2>& p, const std::array<Vector, 2>& q, Real both, Real p_inverse,
                        Real q_inverse) {
    const bool starts = p[0] == q[0], ends = p[1] == q[1], start_to_end = p[0] == q[1], end_to_start = p[1] == q[0];
    if (!starts && !ends && !start_to_end && !end_to_start) return false;
    const Real s = 1 / p_inverse, t = 1 / q_inverse, cosine = 4 * both * p_inverse * q_inverse, size = std::abs(cosine);
    if ((starts && ends) || (start_to_end && end_to_start)) {  // one edge
      add(cosine * s * t * (std::log(s) - Real(1.5)));
      rounding_ += 8 * size * s * t;
      return true;
    }
    const Vector& corner = p[starts || start_to_end ? 0 : 1];
    const Vector u = p[starts || start_to_end ? 1 : 0] - corner, v = q[starts || end_to_start ? 1 : 0] - corner;
    const Real sine = u.cross(v).norm() * (p_inverse * q_inverse), least = std::min(s, t), most = std::max(s, t);
    if (sine * std::max(most, Real(1)) <= 4 * kEpsilon || (most > 3 * least && !whole_is_exact(size, most)))
      return false;
    add(cosine * corner_integral(s, t, starts || ends ? cosine : -cosine, sine));
    rounding_ += 4 * size * (s + t) * (s + t > 8 * least ? s + t : least);
    return true;
  }

  /// Whether the digits that a closed form loses by the length of the longer edge do not matter.
  bool whole_is_exact(Real cosine, Real length) const {
    return kRoundings * kEpsilon * 4 * cosine * length * length <= share_ / 4;
  }

  /// The outer edge is the shorter one.
  void by_inner_integral(const Edge<Real>& p, const Edge<Real>& q) {
    EdgePair<Real> pair{p.start, p.direction, q.start, q.direction, p.length, q.length, 0, 0, 0, 0, 0};
    const Vector& u = pair.outer_direction;
    const Vector& v = pair.inner_direction;
    const Vector cross = u.cross(v);
    pair.cosine = u.dot(v);
    pair.sine = cross.norm();
    scale_ = std::abs(pair.cosine);
    least_share_ = kEpsilon / 16 * scale_ * p.length * q.length;
    magnitude_ = 0;
    add(pair.cosine * edge_pair(pair, p, q, cross));
    rounding_ += scale_ * magnitude_;
  }

  /// ∫∫ ln r.
  Real edge_pair(EdgePair<Real>& pair, const Edge<Real>& p, const Edge<Real>& q, const Vector& cross) {
    const Real rounding = 4 * kEpsilon;
    const Vector& v = pair.inner_direction;
    const Real p_length = p.length, q_length = q.length;
    const bool parallel = pair.sine * std::max(q_length, Real(1)) <= rounding;
    if (!parallel) {
      const Vector between = q.start - p.start;
      pair.along_outer = between.cross(v).dot(cross) / (pair.sine * pair.sine);
      // The same point on the inner line. On its own it would be as uncertain, and where both edges lie on one line up
      // to rounding, a crossing that the two place differently shifts the edges against each other.
      pair.along_inner = pair.along_outer * pair.cosine - between.dot(v);
      pair.gap = std::abs(between.dot(cross)) / pair.sine;
      // A corner that both edges share is the crossing, without rounding.
      const bool from_start = p.start == q.start || p.start == q.end, from_end = p.end == q.start || p.end == q.end;
      if (from_start || from_end) {
        pair.along_outer = from_start ? Real(0) : p_length;
        pair.along_inner = (from_start ? p.start == q.start : p.end == q.start) ? Real(0) : q_length;
        pair.gap = 0;
      }
    } else {
      pair.sine = 0;
    }
    if (parallel || pair.gap <= rounding || gap_is_negligible(pair)) {
      const Real near_inner_middle = parallel ? ((p.start + p.end) / 2 - q.start).dot(v) : pair.along_inner;
      const bool reaches = parallel || (pair.along_outer >= -p_length && pair.along_outer <= 2 * p_length);
      // The closed forms lose the digits that a long inner edge has more than the short outer one: where those matter,
      // they take its near part only.
      const Real near_part = whole_is_exact(scale_, q_length) ? q_length + std::abs(near_inner_middle) : 3 * p_length;
      const Real from = std::clamp(near_inner_middle - near_part, Real(0), q_length);
      const Real to = std::clamp(near_inner_middle + near_part, Real(0), q_length);
      if (reaches && to > from && is_near(pair, from, to)) {
        Real value = closed_form(pair, parallel, from, to);
        if (!parallel && pair.gap > rounding) truncation_ += scale_ * left_out_by_gap(pair);
        if (from > 0) value += quadrature(part_of(pair, 0, from), share_ / 4);
        if (to < q_length) value += quadrature(part_of(pair, to, q_length), share_ / 4);
        return value;
      }
    }
    return quadrature(pair, share_);
  }

  /// What ∫∫ ln r changes by where the lines are moved together. With ρ the distance then, ½ ln(1 + gap²/ρ²) is left
  /// out over a parallelogram, of at most its integral over a disc of the same area about the crossing.
  static Real left_out_by_gap(const EdgePair<Real>& pair) {
    const Real square = pair.gap * pair.gap;
    const Real disc = pair.outer_length * pair.inner_length * pair.sine / std::numbers::pi_v<Real>;
    return std::numbers::pi_v<Real> / 2 * square / pair.sine * (1 + std::log(1 + disc / square));
  }
  bool gap_is_negligible(const EdgePair<Real>& pair) const {
    const Real share = share_ / 4;
    return 2 * scale_ * pair.gap * pair.gap <= share * pair.sine && scale_ * left_out_by_gap(pair) <= share;
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
    return (middle - pair.inner_origin - foot * pair.inner_direction).norm() < Real(2.5) * pair.outer_length / 2;
  }

  Real closed_form(const EdgePair<Real>& pair, bool parallel, Real from, Real to) {
    const Real extent = to - from + pair.outer_length;
    magnitude_ += 4 * extent * (extent > 8 * pair.outer_length ? extent : pair.outer_length);
    if (parallel) {
      const Vector between = pair.outer_origin - pair.inner_origin;
      const Real height = between.cross(pair.inner_direction).norm();
      const Real start = between.dot(pair.inner_direction);
      const Real end = start + std::copysign(pair.outer_length, pair.cosine);
      const Real value = parallel_integral(end - from, height) - parallel_integral(start - from, height) -
                         parallel_integral(end - to, height) + parallel_integral(start - to, height);
      return pair.cosine > 0 ? value : -value;
    }
    const Real s0 = -pair.along_outer, s1 = pair.outer_length - pair.along_outer;
    const Real t0 = from - pair.along_inner, t1 = to - pair.along_inner;
    // From a crossing next to a corner three of the four count little: the mean of |ln r| is at most 3 + 1 / length.
    const auto from_crossing = [&](Real s, Real t) {
      const Real whole = scale_ * std::abs(s * t) * (3 + 1 / std::max({std::abs(s), std::abs(t), kEpsilon}));
      if (16 * whole > std::max(share_, least_share_)) return corner_integral(s, t, pair.cosine, pair.sine);
      truncation_ += whole;
      return Real(0);
    };
    return from_crossing(s1, t1) - from_crossing(s0, t1) - from_crossing(s1, t0) + from_crossing(s0, t0);
  }

  /// What all panels of an outer edge share.
  struct Outer {
    const EdgePair<Real>& pair;
    Vector rise;  ///< the outer direction's part across the inner edge
    /// Whether the point of the inner line next to the outer one lies on the edge; unknown where rounding decides.
    enum { kInside, kOutside, kUnknown } closest;
  };

  Real quadrature(const EdgePair<Real>& pair, Real share) {
    Outer outer{pair, pair.outer_direction - pair.cosine * pair.inner_direction, Outer::kOutside};
    if (pair.sine > 0) {
      const Real doubt = 64 * kEpsilon / pair.sine;
      const Real inside = std::min(pair.along_inner, pair.inner_length - pair.along_inner);
      outer.closest = inside > doubt ? Outer::kInside : inside < -doubt ? Outer::kOutside : Outer::kUnknown;
    }
    return panel(outer, 0, pair.outer_length, share);
  }

  /// ∫ of the inner integral over the outer edge's [from, to], halved where a singularity stands near.
  /// @param share  what may be left out, the cosine included
  Real panel(const Outer& outer, Real from, Real to, Real share) {
    const EdgePair<Real>& pair = outer.pair;
    const Vector& v = pair.inner_direction;
    const Real half = (to - from) / 2, middle = (from + to) / 2, length = pair.inner_length;
    const Vector offset = pair.outer_origin + middle * pair.outer_direction - pair.inner_origin;
    const Real along = offset.dot(v);  // foot of the panel's middle on the inner line
    const Vector across = offset - along * v;

    // The ends of the panel, seen from the inner edge's line and corners.
    const Real run = pair.cosine * half;
    const Real low_square = (across - half * outer.rise).squaredNorm();
    const Real high_square = (across + half * outer.rise).squaredNorm();
    const auto corner_sum = [&](Real foot) {
      return std::sqrt(low_square + (foot + run) * (foot + run)) + std::sqrt(high_square + (foot - run) * (foot - run));
    };
    const std::array<Real, 2> foot{-along, length - along};
    const std::array<Real, 2> sum{corner_sum(foot[0]), corner_sum(foot[1])};
    const Real low = std::sqrt(low_square), high = std::sqrt(high_square), heights = low + high;
    const Real nearest = heights > 0 ? run * (low - high) / heights : Real(0);
    // The least sum of distances of an inner point to both ends.
    const Real least_sum = nearest < foot[0]   ? sum[0]
                           : nearest > foot[1] ? sum[1]
                                               : std::sqrt(4 * run * run + heights * heights);

    const Real accepted = std::max(share, least_share_), wanted = accepted / scale_;
    Real decay = decay_of(least_sum / half);
    Points points = points_of_logs(half * length, decay, wanted);
    bool split_kink = false;
    if (points.count > 2 && std::min(sum[0], sum[1]) > least_sum) {
      // The inner edge's interior is nearer than its corners, but only the kink makes that matter.
      std::array<Real, 2> corner_decay{decay_of(sum[0] / half), decay_of(sum[1] / half)};
      bool split = false;
      if (pair.sine > 0) {
        const Real beyond = pair.along_outer - middle, aside = pair.gap / pair.sine;
        const Real kink_decay = decay_of((std::sqrt((beyond - half) * (beyond - half) + aside * aside) +
                                          std::sqrt((beyond + half) * (beyond + half) + aside * aside)) /
                                         half);
        if (kink_decay > std::min(corner_decay[0], corner_decay[1])) {
          split = outer.closest == Outer::kInside;
          if (outer.closest == Outer::kUnknown)
            for (Real& each : corner_decay) each = std::max(each, kink_decay);
        }
      }
      const Real height = across.norm(), speed = std::abs(pair.cosine) + pair.sine;
      std::array<Real, 2> size;
      for (int k = 0; k < 2; ++k) {
        const Real root = std::sqrt(corner_decay[k]);
        size[k] = half * (std::abs(foot[k]) + height + speed * half * (root + 1 / root) / 2);
      }
      const Points by_corners = points_of_corners(size, corner_decay, wanted);
      if (by_corners.count < points.count) {
        points = by_corners;
        split_kink = split;
        decay = std::max(corner_decay[0], corner_decay[1]);
      }
    }

    // Two panels of two points cost no less than one of four.
    if (points.count > kMostPoints || (points.count > 4 && decay > kCutDecay)) {
      const Real square = scale_ * half * half;
      bool small = half <= kEpsilon;
      points = {1, 0};
      if (4 * square * (std::abs(pair.cosine) + pair.sine) <= accepted) {
        const Real farthest = std::max(sum[0], sum[1]);
        points.left_out = half * half *
                          (2 * std::numbers::pi_v<Real> * pair.sine +
                           4 * std::abs(pair.cosine) * (1 + std::log(2 * farthest / half)));
        small = small || points.left_out <= wanted;
      }
      if (!small) {
        const Real low_past = run + std::clamp(-run, foot[0], foot[1]);
        const Real high_past = run - std::clamp(run, foot[0], foot[1]);
        const Real low_distance = std::sqrt(low_square + low_past * low_past);
        const Real high_distance = std::sqrt(high_square + high_past * high_past);
        const bool low_is_near = low_distance < high_distance;
        // The far part gets an ellipse of 2.6 if the singularity stands at the near end, the near part if it stands at
        // 0.4 of its length; a crossing within the panel becomes an end of both.
        const Real near = std::min(low_distance, high_distance), whole = 2 * half;
        const Real part =
            std::max({whole / 5, std::min(Real(2.4) * near, half), whole * (near / (low_distance + high_distance))});
        const Real cut = low_is_near ? from + part : to - part, before = truncation_;
        const Real far_part = low_is_near ? panel(outer, cut, to, share / 2) : panel(outer, from, cut, share / 2);
        const Real rest = std::max(share - (truncation_ - before), Real(0));
        return far_part + (low_is_near ? panel(outer, from, cut, rest) : panel(outer, cut, to, rest));
      }
    }
    truncation_ += scale_ * points.left_out;

    const auto& rule = rules_.of[points.count];
    Real value = 0, largest = 0;
    for (int i = 0; i < points.count; ++i) {
      const Real move = half * rule.node[i];
      const Real height_square = (across + move * outer.rise).squaredNorm(), height = std::sqrt(height_square);
      const Real s0 = foot[0] - move * pair.cosine, s1 = foot[1] - move * pair.cosine;
      const Real logs = times_log_root(s1, height_square + s1 * s1) - times_log_root(s0, height_square + s0 * s0);
      const Real turn = height_square + s0 * s1;
      const Real angle = split_kink ? -std::atan2(height * length, -turn) : std::atan2(height * length, turn);
      value += rule.weight[i] * (logs - length + height * angle);
      largest = std::max(largest, std::abs(logs) + length);
    }
    magnitude_ += 2 * half * largest;
    value *= half;
    if (split_kink) value += std::numbers::pi_v<Real> * distance_integral(across, outer.rise, half);
    return value;
  }

  /// Points for the inner integral over logarithms of distances, whose Chebyshev coefficients are known.
  Points points_of_logs(Real size, Real decay, Real wanted) const {
    if (decay > kMostDecay) return {kMostPoints + 1, 0};
    Real tail = size * decay * decay / (1 - decay);
    int n = 2;
    while (n <= kMostPoints && !(tail * rules_.share[n] <= wanted)) tail *= decay, ++n;
    return {n, tail * rules_.share[std::min(n, kMostPoints)]};
  }

  /// Points for the functions of both corners, each at most 2π size on its own ellipse; Bernstein.
  Points points_of_corners(const std::array<Real, 2>& size, const std::array<Real, 2>& decay, Real wanted) const {
    if (std::max(decay[0], decay[1]) > kMostDecay) return {kMostPoints + 1, 0};
    constexpr Real kBernstein = 64 * 2 * std::numbers::pi_v<Real> / 15;
    std::array<Real, 2> tail;
    for (int k = 0; k < 2; ++k) tail[k] = kBernstein * size[k] * decay[k] * decay[k] / (1 - decay[k]);
    int n = 2;
    while (n <= kMostPoints && !(tail[0] + tail[1] <= wanted)) tail[0] *= decay[0], tail[1] *= decay[1], ++n;
    return {n, tail[0] + tail[1]};
  }

  /// ∫ h over a panel, h = |across + τ rise| the distance to the inner line. Where the lines come closest follows from
  /// these two again, not from the edges: of nearly parallel ones h is known better than that place.
  Real distance_integral(const Vector& across, const Vector& rise, Real half) const {
    const Real square = rise.squaredNorm(), sine = std::sqrt(square);
    const Real closest = square > 0 ? -across.dot(rise) / square : Real(0);
    const Real gap = square > 0 ? across.cross(rise).norm() / sine : Real(0);
    const Real a = -half - closest, b = half - closest;
    // Nearly parallel lines cross too far away for the antiderivative; h is then smooth and a plain rule exact enough.
    if (!(square > 0) || gap >= 30 * sine * std::max(std::abs(a), std::abs(b)) ||
        (a * b > 0 && std::min(std::abs(a), std::abs(b)) > 4 * (b - a))) {
      const auto& rule = rules_.of[16];
      Real sum = 0;
      for (int i = 0; i < 16; ++i) sum += rule.weight[i] * (across + half * rule.node[i] * rise).norm();
      return half * sum;
    }
    const auto antiderivative = [&](Real tau) {  // of sqrt(gap² + sine² τ²), odd in τ
      const Real climb = sine * tau, h = std::sqrt(gap * gap + climb * climb);
      const Real log_part = gap == 0 ? Real(0) : gap * gap / sine * std::asinh(climb / gap);
      return (tau * h + log_part) / 2;
    };
    return antiderivative(b) - antiderivative(a);
  }

  static constexpr Real kEpsilon = std::numeric_limits<Real>::epsilon();
  /// Roundings a term may gather: 25 were seen in double, whose corners are rounded themselves (a patch ten sizes from
  /// one of 1e4 times its area), 9 in extended precision.
  static constexpr Real kRoundings = std::is_same_v<Real, double> ? 40 : 16;
  static constexpr Real kMostDecayOfBoth = 0.5;  ///< of points on both edges: ρ = 1.41
  static constexpr int kMostDistances = 256;     ///< of points on both edges, past which the inner integral is cheaper
  static constexpr Real kMostDecay = 0.6;
  static constexpr Real kCutDecay = 0.45;  ///< ρ = 1.5: two panels of 2.6 would take more points

  Real left_;
  int pairs_left_;
  const Rules<Real>& rules_;
  Real sum_ = 0, carry_ = 0;
  Real share_ = 0;        ///< of the present pair of edges
  Real least_share_ = 0;  ///< rounding makes less pointless
  Real scale_ = 0;        ///< |u·v|
  Real magnitude_ = 0;    ///< of what was summed for it
  Real truncation_ = 0, rounding_ = 0;
};

}  // namespace

const GaussRule& gauss_legendre(int n) {
  static const std::array<GaussRule, kMostPoints + 1> rules = [] {
    std::array<GaussRule, kMostPoints + 1> made;
    for (int i = 1; i <= kMostPoints; ++i) made[i] = make_gauss_legendre(i);
    return made;
  }();
  return rules[n];
}

template <class Real>
ContourResult contour_exchange_area(const ClippedPolygon<Real>& a, const ClippedPolygon<Real>& b, Real tolerance) {
  const Outline<Real> first(a), second(b);
  ContourSum<Real> sum(2 * std::numbers::pi_v<Real> * tolerance, first.edges * second.blocks * kLanes<Real>);
  for (int i = 0; i < first.edges; ++i)
    for (int j = 0; j < second.blocks; ++j) sum.add(first, i % first.blocks, i / first.blocks, second, j);
  return sum.result();
}

template ContourResult contour_exchange_area(const ClippedPolygon<double>&, const ClippedPolygon<double>&, double);
template ContourResult contour_exchange_area(const ClippedPolygon<long double>&, const ClippedPolygon<long double>&,
                                             long double);

}  // namespace interglow::radiosity::detail
