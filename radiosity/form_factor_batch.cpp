// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/form_factor_batch.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>

#include "diagnostics/error.h"
#include "radiosity/batch_kernel.h"
#include "radiosity/contour_kernel.h"
#include "radiosity/horizon_clip.h"

namespace interglow::radiosity {
namespace {

using batch::EdgeRule;
using batch::kMaxEdgePoints;
using batch::kMaxOrder;
using batch::PatchRecord;
using batch::ProductRule;
using Eigen::Vector3d;

const batch::Kernels& best_kernels([[maybe_unused]] InstructionSet most) {
#if defined(__x86_64__)
  if (most >= InstructionSet::kAvx512 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512vl"))
    return batch::avx512_kernels();
  if (most >= InstructionSet::kAvx2 && __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
    return batch::avx2_kernels();
#endif
  return batch::baseline_kernels();
}

/// Gauss-Jacobi nodes for ∫_0^1 f(u) 2u du, from the Gauss-Legendre nodes' neighbours by Newton on the Jacobi
/// polynomial P^(0,1).
void weighted_gauss(int n, long double* node, long double* weight) {
  const auto jacobi = [n](long double x, long double& slope) {  // P_n^(0,1) = (P_n + P_{n+1}) / (1 + x)
    long double before = 1, p = x, slope_before = 0, slope_p = 1;
    for (int k = 1; k <= n; ++k) {
      const long double next = ((2 * k + 1) * x * p - k * before) / (k + 1);
      const long double slope_next = slope_before + (2 * k + 1) * p;
      before = p, p = next;
      slope_before = slope_p, slope_p = slope_next;
    }
    const long double value = (before + p) / (1 + x);
    slope = (slope_before + slope_p - value) / (1 + x);
    return value;
  };
  const detail::GaussRule& guess = detail::gauss_legendre(n + 1);  // its n + 1 nodes interlace with the n wanted ones
  for (int i = 0; i < n; ++i) {
    long double low = guess.node[i + 1], high = guess.node[i], slope = 0;
    const bool rising = jacobi(high, slope) > 0;
    for (int step = 0; step < 80; ++step) {
      const long double middle = (low + high) / 2;
      ((jacobi(middle, slope) > 0) == rising ? high : low) = middle;
    }
    const long double x = (low + high) / 2;
    jacobi(x, slope);
    node[i] = (1 + x) / 2;
    weight[i] = 1 / ((1 - x * x) * slope * slope);  // normalised below
  }
  long double sum = 0;
  for (int i = 0; i < n; ++i) sum += weight[i];
  for (int i = 0; i < n; ++i) weight[i] /= sum;
}

ProductRule make_rule(int m) {
  ProductRule rule{};
  rule.points = m;
  const detail::GaussRule& plain = detail::gauss_legendre(m);
  std::array<long double, kMaxOrder + 1> node{}, weight{};
  weighted_gauss(m, node.data(), weight.data());
  for (int j = 0; j < batch::kProductErrors; ++j) {
    const int order = 2 * m + j;
    const bool odd = order % 2 != 0;
    long double of_quad = odd ? 0 : 1.0L / (order + 1), of_triangle = odd ? 1.0L / (order + 2) : 1.0L / (order + 1);
    for (int i = 0; i < m; ++i) {
      of_quad -= plain.weight[i] / 2 * std::pow(plain.node[i], order);
      of_triangle -= weight[i] * std::pow(2 * node[i] - 1, order);
    }
    rule.error[j] = static_cast<double>(std::max(std::abs(of_quad), std::abs(of_triangle))) + 1e-18;
  }
  for (int i = 0; i < m; ++i)
    for (int j = 0; j < m; ++j) {
      const int k = i * m + j;
      rule.u[0][k] = static_cast<double>((1 + plain.node[i]) / 2);
      rule.v[0][k] = rule.v[1][k] = static_cast<double>((1 + plain.node[j]) / 2);
      rule.weight[0][k] = static_cast<double>(plain.weight[i] * plain.weight[j] / 4);
      rule.u[1][k] = static_cast<double>(node[i]);
      rule.weight[1][k] = static_cast<double>(weight[i] * plain.weight[j] / 2);
    }
  return rule;
}

using ProductRules = std::array<ProductRule, kMaxOrder + 1>;

/// By their points per direction.
const ProductRules& product_rules() {
  static const ProductRules kRules = [] {
    ProductRules made{};
    for (int i = 1; i <= kMaxOrder; ++i) made[i] = make_rule(i);
    return made;
  }();
  return kRules;
}

using EdgeRules = std::array<EdgeRule, kMaxEdgePoints / 2 + 1>;

/// By half of their points.
const EdgeRules& edge_rules() {
  static const EdgeRules kRules = [] {
    EdgeRules made{};
    for (int half = 1; half <= kMaxEdgePoints / 2; ++half) {
      const detail::GaussRule& gauss = detail::gauss_legendre(2 * half);  // the positive nodes come first
      made[half].half = half;
      for (int i = 0; i < half; ++i) {
        made[half].node[i] = static_cast<double>(gauss.node[i]);
        made[half].weight[i] = static_cast<double>(gauss.weight[i] / 2);
      }
      for (int j = 0; j < batch::kErrors; ++j) {
        const int order = 4 * half + 2 * j;
        long double error = 1.0L / (order + 1);
        for (int i = 0; i < half; ++i) error -= gauss.weight[i] * std::pow(gauss.node[i], order);
        made[half].error[j] = static_cast<double>(error) + 1e-18;  // what is rounded
      }
    }
    return made;
  }();
  return kRules;
}

void store(double (&to)[3], const Vector3d& from) {
  for (int axis = 0; axis < 3; ++axis) to[axis] = from[axis];
}

Vector3d load(const double (&from)[3]) { return {from[0], from[1], from[2]}; }

/// Σ weight f(x - centre) over the 6 x 6 rule: exact for polynomials of degree 10.
template <class Function>
double mean_of(const PatchRecord& record, Function f) {
  const ProductRule& rule = product_rules()[kMaxOrder];
  const int shape = record.triangle > 0 ? 1 : 0;
  double sum = 0;
  for (int i = 0; i < kMaxOrder * kMaxOrder; ++i) {
    const double u = rule.u[shape][i], v = rule.v[shape][i];
    const Vector3d x = load(record.origin) + u * load(record.e1) + v * load(record.e2) + u * v * load(record.e3);
    const double density = record.density[0] + u * record.density[1] + v * record.density[2];
    sum += rule.weight[shape][i] * density * f(x - load(record.centre));
  }
  return sum;
}

/// Absolute and directed moments about the centre. Returns the difference of the principal ones.
double set_moments(PatchRecord& record) {
  record.second = mean_of(record, [](const Vector3d& x) { return x.squaredNorm(); });
  record.fourth = mean_of(record, [](const Vector3d& x) { return x.squaredNorm() * x.squaredNorm(); });
  // By Cauchy and Schwarz, for |x|³ is no polynomial.
  record.third = record.skew >= 0 ? 0 : std::sqrt(record.second * record.fourth);
  // Cholesky in the frame of the direction in which the patch is longer, as p = (xx, xy) / √xx.
  const Vector3d normal = load(record.normal), side = load(record.e1).squaredNorm() > load(record.e2).squaredNorm()
                                                          ? load(record.e1)
                                                          : load(record.e2);
  const Vector3d first = (side - normal.dot(side) * normal).normalized(), second = normal.cross(first);
  const auto moment = [&record](const Vector3d& u, const Vector3d& v) {
    return mean_of(record, [&](const Vector3d& x) { return u.dot(x) * v.dot(x); });
  };
  const double xx = moment(first, first), xy = moment(first, second), yy = moment(second, second);
  const Vector3d p = xx >= yy ? Vector3d((xx * first + xy * second) / std::sqrt(xx))
                              : Vector3d((xy * first + yy * second) / std::sqrt(yy));
  const double left = std::sqrt(std::max(0.0, xx >= yy ? yy - xy * xy / xx : xx - xy * xy / yy));
  store(record.moment1, p);
  store(record.moment2, left * (xx >= yy ? second : first));
  return std::hypot(xx - yy, 2 * xy);
}

/// The leading `bits` of a number's exponent and mantissa, rounded up.
std::uint64_t rounded_up(double x, int bits) {
  const std::uint64_t most = std::bit_cast<std::uint64_t>(std::numeric_limits<double>::max());
  const int dropped = 63 - bits;
  return (std::min(std::bit_cast<std::uint64_t>(x), most - (std::uint64_t{1} << dropped)) +
          (std::uint64_t{1} << dropped) - 1) >>
         dropped;
}

/// What `batch::Spread` unpacks.
double pack_spread(const PatchRecord& record, double difference) {
  const bool symmetric = record.third <= 0;
  const double ball_square =
      std::min(record.ball + 2 * batch::kOpen, 1e100) * std::min(record.ball + 2 * batch::kOpen, 1e100);
  const std::uint64_t second = std::bit_cast<std::uint64_t>(record.second) >> 32;
  double beyond = difference + record.second * 1.01e-6;  // 20 bits
  if (!symmetric) beyond += record.third * record.third / (15 * ball_square * record.second);
  const std::uint64_t low = rounded_up(beyond, 15) << 1 | (symmetric ? 0 : 1);
  return std::bit_cast<double>(second << 32 | rounded_up(ball_square, 16) << 16 | low);
}

PatchRecord make_record(const Polygon& polygon, const Vector3d& moved_by, double unit) {
  PatchRecord record{};
  detail::ClippedPolygon<double> scaled;
  for (int i = 0; i < polygon.corners; ++i) {
    const Vector3d& next = polygon.corner[i + 1 == polygon.corners ? 0 : i + 1];
    if (polygon.corner[i] != next) scaled.corner[scaled.corners++] = (polygon.corner[i] - moved_by) / unit;
  }
  if (scaled.corners < 3) return record;
  const detail::Plane<double> plane = detail::plane_of(scaled);
  if (!(plane.area > 0)) return record;

  const auto& c = scaled.corner;
  const bool triangle = scaled.corners == 3;
  bool parallelogram = false;
  const Vector3d e1 = c[1] - c[0];
  const Vector3d e2 = triangle ? Vector3d(Vector3d::Zero()) : Vector3d(c[3] - c[0]);
  const Vector3d e3 = triangle ? Vector3d(c[2] - c[1]) : Vector3d((c[2] - c[1]) - (c[3] - c[0]));
  store(record.origin, c[0]);
  store(record.e1, e1);
  store(record.e2, e2);
  store(record.e3, e3);
  store(record.normal, plane.normal);
  record.area = plane.area;
  record.triangle = triangle ? 1 : 0;
  record.density[0] = 1;
  double longest = 0;
  for (int i = 0; i < scaled.corners; ++i) longest = std::max(longest, (c[i] - c[0]).norm());
  if (triangle) {
    store(record.centre, (c[0] + c[1] + c[2]) / 3);
  } else {
    record.density[0] = plane.normal.dot(e1.cross(e2)) / plane.area;
    record.density[1] = plane.normal.dot(e1.cross(e3)) / plane.area;
    record.density[2] = plane.normal.dot(e3.cross(e2)) / plane.area;
    parallelogram = e3.norm() <= 8 * std::numeric_limits<double>::epsilon();
    const double first = plane.normal.dot((c[1] - c[0]).cross(c[2] - c[0])),
                 second = plane.normal.dot((c[2] - c[0]).cross(c[3] - c[0]));
    store(record.centre, (first * (c[0] + c[1] + c[2]) + second * (c[0] + c[2] + c[3])) / (3 * (first + second)));
  }
  for (int i = 0; i < scaled.corners; ++i) record.radius = std::max(record.radius, (c[i] - load(record.centre)).norm());
  double longest_edge = 0;
  for (int i = 0; i < scaled.corners; ++i) {
    const double edge = (c[i + 1 == scaled.corners ? 0 : i + 1] - c[i]).norm();
    record.perimeter += edge;
    const Vector3d middle = (c[i] + c[i + 1 == scaled.corners ? 0 : i + 1]) / 2;
    record.middle_radius = std::max(record.middle_radius, (middle - load(record.centre)).norm());
    longest_edge = std::max(longest_edge, edge);
  }
  record.half_edge = longest_edge / 2;
  record.inverse_half_edge = 2 / longest_edge;
  record.skew = parallelogram ? e3.norm() * longest_edge : -1;
  const double turn = set_moments(record);
  record.sides = std::sqrt(e1.norm() * e2.norm() * (e1.norm() * e2.norm() + std::abs(e1.dot(e2))));
  record.deviation = 2 * plane.deviation;
  record.lever = (4 * plane.deviation + 16 * std::numeric_limits<double>::epsilon() * longest) / plane.thickness;
  const double reach = 8;  // farther than two points in normalised coordinates are apart
  record.ball =
      record.deviation + record.lever * reach < batch::kOpen ? record.radius : std::numeric_limits<double>::max() / 4;
  record.spread = pack_spread(record, turn);
  return record;
}

}  // namespace

FormFactorBatch::FormFactorBatch(std::vector<Polygon> polygons, InstructionSet most)
    : polygons_(std::move(polygons)), kernels_(&best_kernels(most)) {
  Vector3d low = Vector3d::Constant(std::numeric_limits<double>::infinity()), high = -low;
  for (std::size_t p = 0; p < polygons_.size(); ++p)
    for (int i = 0; i < polygons_[p].corners; ++i) {
      const Vector3d& corner = polygons_[p].corner[i];
      if (!corner.allFinite())
        throw InvalidParams(
            fmt::format("form factors: corner {} of polygon {} is ({}, {}, {}); expected finite coordinates. "
                        "Repair the mesh.",
                        i, p, corner.x(), corner.y(), corner.z()));
      low = low.cwiseMin(corner);
      high = high.cwiseMax(corner);
    }
  const double half_extent = polygons_.empty() ? 0 : (high / 2 - low / 2).maxCoeff();
  Vector3d moved_by = Vector3d::Zero();
  if (half_extent > 0) {
    unit_ = std::exp2(std::ilogb(half_extent) + 1);
    // A multiple of the unit: taking it off rounds no coordinate that is larger than the extent.
    for (int axis = 0; axis < 3; ++axis) {
      const double middle = (low[axis] / 2 + high[axis] / 2) / unit_;
      if (std::abs(middle) > 2) moved_by[axis] = std::round(middle) * unit_;
    }
  }
  records_.reserve(polygons_.size());
  for (const Polygon& polygon : polygons_) records_.push_back(make_record(polygon, moved_by, unit_));
}

FormFactorBatch::~FormFactorBatch() = default;
FormFactorBatch::FormFactorBatch(FormFactorBatch&&) noexcept = default;
FormFactorBatch& FormFactorBatch::operator=(FormFactorBatch&&) noexcept = default;

double FormFactorBatch::area(std::size_t i) const { return records_[i].area * unit_ * unit_; }

const char* FormFactorBatch::instruction_set() const { return kernels_->name; }

// The kernels write results by bytes.
static_assert(sizeof(FormFactor) == sizeof(batch::Result) && offsetof(FormFactor, value) == 0 &&
              offsetof(FormFactor, error_estimate) == offsetof(batch::Result, error_estimate) &&
              offsetof(FormFactor, method) == offsetof(batch::Result, method) && sizeof(FormFactorMethod) == 4 &&
              std::endian::native == std::endian::little);
static_assert(static_cast<int>(FormFactorMethod::kZero) == batch::kZeroMethod &&
              static_cast<int>(FormFactorMethod::kFarQuadrature) == batch::kFarMethod &&
              static_cast<int>(FormFactorMethod::kEdgeQuadrature) == batch::kEdgeMethod);

void FormFactorBatch::exchange_areas(std::uint32_t one, std::span<const std::uint32_t> others, double tolerance,
                                     std::span<FormFactor> results) const {
  const double square_unit = unit_ * unit_;
  batch::OpenPairs open;
  for (std::size_t start = 0; start < others.size(); start += batch::kBlock) {
    const std::span<const std::uint32_t> block =
        others.subspan(start, std::min<std::size_t>(batch::kBlock, others.size() - start));
    FormFactor* const found = results.data() + start;
    kernels_->settle(records_.data(), one, block.data(), static_cast<int>(block.size()), tolerance, square_unit,
                     edge_rules().data(), reinterpret_cast<batch::Result*>(found), open);
    if (open.count > 0) finish(one, block, tolerance, open, found);
  }
}

void FormFactorBatch::finish(std::uint32_t one, std::span<const std::uint32_t> others, double tolerance,
                             batch::OpenPairs& open, FormFactor* found) const {
  using batch::kBlock;
  std::array<const PatchRecord*, kBlock> first, second, packed_first, packed_second;
  std::array<std::int32_t, kBlock> choice;
  std::array<int, kBlock> member;
  std::array<double, kBlock> packed;
  const double square_unit = unit_ * unit_;
  // The lower index comes first, whichever way the pair is asked for: the same bits for (i, j) and (j, i).
  for (int i = 0; i < open.count; ++i) {
    const std::uint32_t other = others[open.place[i]];
    first[i] = &records_[std::min(one, other)];
    second[i] = &records_[std::max(one, other)];
  }
  const auto pack = [&](int members) {
    for (int i = 0; i < members; ++i) {
      packed_first[i] = first[member[i]];
      packed_second[i] = second[member[i]];
    }
  };
  const auto unsettled = [&] {
    int members = 0;
    for (int i = 0; i < open.count; ++i) {
      member[members] = i;
      members += open.choice[i] == batch::kUnsettled ? 1 : 0;
    }
    return members;
  };
  const auto take = [&](int members) {
    for (int i = 0; i < members; ++i) {
      open.choice[member[i]] = choice[i];
      open.bound[member[i]] = packed[i];
    }
  };
  if (const int left = unsettled(); left == open.count) {
    kernels_->choose(first.data(), second.data(), left, tolerance, edge_rules().data(), open.choice, open.bound);
  } else if (left > 0) {
    pack(left);
    kernels_->choose(packed_first.data(), packed_second.data(), left, tolerance, edge_rules().data(), choice.data(),
                     packed.data());
    take(left);
  }
  if (const int left = unsettled(); left > 0) {
    pack(left);
    kernels_->classify(packed_first.data(), packed_second.data(), left, tolerance, edge_rules().data(),
                       product_rules().data(), choice.data(), packed.data());
    take(left);
  }
  // One choice after the other: all pairs of a vector take the same rule.
  static_assert(batch::kChoices <= 64);
  std::uint64_t present = 0;
  for (int i = 0; i < open.count; ++i) present |= std::uint64_t{1} << open.choice[i];
  for (; present != 0; present &= present - 1) {
    const int chosen = std::countr_zero(present);
    int members = 0;
    for (int i = 0; i < open.count; ++i) {
      member[members] = i;
      members += open.choice[i] == chosen ? 1 : 0;
    }
    if (chosen == batch::kNothing) {
      for (int i = 0; i < members; ++i) found[open.place[member[i]]] = {};
      continue;
    }
    if (chosen == batch::kContour) {
      for (int i = 0; i < members; ++i) {
        const std::uint32_t other = others[open.place[member[i]]];
        const double wanted = tolerance * std::min(first[member[i]]->area, second[member[i]]->area) * square_unit;
        found[open.place[member[i]]] =
            exchange_area(polygons_[std::min(one, other)], polygons_[std::max(one, other)], wanted);
      }
      continue;
    }
    const bool all = members == open.count;
    if (!all) pack(members);
    const PatchRecord* const* one_side = all ? first.data() : packed_first.data();
    const PatchRecord* const* other_side = all ? second.data() : packed_second.data();
    FormFactorMethod method = FormFactorMethod::kFarQuadrature;
    if (chosen == batch::kCentres || chosen == batch::kRound || chosen == batch::kMoments) {
      const int moments = 1 + chosen - batch::kCentres;
      kernels_->centres(one_side, other_side, members, moments, packed.data());
    } else if (chosen == batch::kCut) {
      kernels_->product(one_side, other_side, members, product_rules()[2], packed.data());
    } else if (chosen < batch::kEdges) {
      kernels_->product(one_side, other_side, members, product_rules()[chosen - batch::kProduct], packed.data());
    } else {
      const int points = chosen - batch::kEdges;
      kernels_->edges(one_side, other_side, members, edge_rules()[points / 2], points % 2 == 0, packed.data());
      method = FormFactorMethod::kEdgeQuadrature;
    }
    for (int i = 0; i < members; ++i) {
      const int k = member[i];
      const double value = std::clamp(packed[i], 0.0, std::min(first[k]->area, second[k]->area));
      found[open.place[k]] = {value * square_unit, open.bound[k] * square_unit, method};
    }
  }
}

void FormFactorBatch::exchange_areas_by_rule(std::uint32_t one, std::span<const std::uint32_t> others, FixedRule rule,
                                             std::span<double> results) const {
  const int most = rule.family == FixedRule::kEdges     ? kMaxEdgePoints
                   : rule.family == FixedRule::kProduct ? kMaxOrder
                                                        : 3;
  if (rule.points < 1 || rule.points > most || (rule.family == FixedRule::kEdges && rule.points % 2 != 0))
    throw InvalidParams(
        fmt::format("form factors: points = {}, expected 1 to {}, on edges an even number.", rule.points, most));
  std::array<const PatchRecord*, batch::kBlock> first, second;
  for (std::size_t start = 0; start < others.size(); start += batch::kBlock) {
    const int count = static_cast<int>(std::min<std::size_t>(batch::kBlock, others.size() - start));
    for (int k = 0; k < count; ++k) {
      first[k] = &records_[std::min(one, others[start + k])];
      second[k] = &records_[std::max(one, others[start + k])];
    }
    double* found = results.data() + start;
    if (rule.family == FixedRule::kCentres) {
      kernels_->centres(first.data(), second.data(), count, rule.points, found);
    } else if (rule.family == FixedRule::kProduct) {
      kernels_->product(first.data(), second.data(), count, product_rules()[rule.points], found);
    } else {
      bool parallelograms = true;
      for (int k = 0; k < count; ++k) parallelograms = parallelograms && first[k]->skew >= 0 && second[k]->skew >= 0;
      kernels_->edges(first.data(), second.data(), count, edge_rules()[rule.points / 2], parallelograms, found);
    }
    for (int k = 0; k < count; ++k) results[start + k] *= unit_ * unit_;
  }
}

}  // namespace interglow::radiosity
