// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/form_factor_batch.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "diagnostics/error.h"
#include "radiosity/batch_kernel.h"
#include "radiosity/contour_kernel.h"
#include "radiosity/horizon_clip.h"

namespace interglow::radiosity {
namespace {

using batch::kMaxOrder;
using batch::PatchRecord;
using batch::ProductRule;
using Eigen::Vector3d;

const batch::Kernels& best_kernels() {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq")) return batch::avx512_kernels();
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return batch::avx2_kernels();
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

const ProductRule& product_rule(int m) {
  static const std::array<ProductRule, kMaxOrder + 1> rules = [] {
    std::array<ProductRule, kMaxOrder + 1> made{};
    for (int i = 1; i <= kMaxOrder; ++i) made[i] = make_rule(i);
    return made;
  }();
  return rules[m];
}

void store(double (&to)[3], const Vector3d& from) {
  for (int axis = 0; axis < 3; ++axis) to[axis] = from[axis];
}

Vector3d load(const double (&from)[3]) { return {from[0], from[1], from[2]}; }

/// Σ weight |x - centre|^2k over the m x m rule.
double mean_power(const PatchRecord& record, int m, int k) {
  const ProductRule& rule = product_rule(m);
  const int shape = record.triangle > 0 ? 1 : 0;
  double sum = 0;
  for (int i = 0; i < m * m; ++i) {
    const double u = rule.u[shape][i], v = rule.v[shape][i];
    const Vector3d x = load(record.origin) + u * load(record.e1) + v * load(record.e2) + u * v * load(record.e3);
    const double density = record.density[0] + u * record.density[1] + v * record.density[2];
    sum += rule.weight[shape][i] * density * std::pow((x - load(record.centre)).squaredNorm(), k);
  }
  return sum;
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
    record.bilinear = e3.norm() > 8 * std::numeric_limits<double>::epsilon() ? 1 : 0;
    const double first = plane.normal.dot((c[1] - c[0]).cross(c[2] - c[0])),
                 second = plane.normal.dot((c[2] - c[0]).cross(c[3] - c[0]));
    store(record.centre, (first * (c[0] + c[1] + c[2]) + second * (c[0] + c[2] + c[3])) / (3 * (first + second)));
  }
  for (int i = 0; i < scaled.corners; ++i) record.radius = std::max(record.radius, (c[i] - load(record.centre)).norm());
  for (int m = 1; m < kMaxOrder; ++m)
    record.spread[m] =
        mean_power(record, std::min(m + 2, kMaxOrder), m) + mean_power(record, m + (record.bilinear > 0 ? 1 : 0), m);
  record.deviation = 2 * plane.deviation;
  record.lever = (4 * plane.deviation + 16 * std::numeric_limits<double>::epsilon() * longest) / plane.thickness;
  return record;
}

}  // namespace

FormFactorBatch::FormFactorBatch(std::vector<Polygon> polygons)
    : polygons_(std::move(polygons)), kernels_(&best_kernels()) {
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

void FormFactorBatch::exchange_areas(std::uint32_t one, std::span<const std::uint32_t> others, double tolerance,
                                     std::span<FormFactor> results) const {
  using batch::kBlock;
  std::array<const PatchRecord*, kBlock> first, second, packed_first, packed_second;
  std::array<std::int32_t, kBlock> choice, place;
  std::array<double, kBlock> bound, exchange;
  const double square_unit = unit_ * unit_;
  for (std::size_t start = 0; start < others.size(); start += kBlock) {
    const int count = static_cast<int>(std::min<std::size_t>(kBlock, others.size() - start));
    // The lower index comes first, whichever way the pair is asked for: the same bits for (i, j) and (j, i).
    for (int k = 0; k < count; ++k) {
      const std::uint32_t other = others[start + k];
      first[k] = &records_[std::min(one, other)];
      second[k] = &records_[std::max(one, other)];
    }
    kernels_->classify(first.data(), second.data(), count, tolerance, choice.data(), bound.data());
    for (int m = 1; m <= kMaxOrder; ++m) {
      int members = 0;
      for (int k = 0; k < count; ++k)
        if (choice[k] == m) {
          packed_first[members] = first[k];
          packed_second[members] = second[k];
          place[members++] = k;
        }
      if (members == 0) continue;
      kernels_->product(packed_first.data(), packed_second.data(), members, product_rule(m), exchange.data());
      for (int i = 0; i < members; ++i) {
        const int k = place[i];
        const double most = std::min(first[k]->area, second[k]->area);
        const double value = std::min(exchange[i], most);
        const double rounding = 32 * std::numeric_limits<double>::epsilon() * value;
        results[start + k] = {value * square_unit, (bound[k] + rounding) * square_unit,
                              FormFactorMethod::kFarQuadrature};
      }
    }
    for (int k = 0; k < count; ++k) {
      if (choice[k] == batch::kNothing) results[start + k] = {};
      if (choice[k] != batch::kScalar) continue;
      const std::uint32_t other = others[start + k];
      const double least_area = std::min(first[k]->area, second[k]->area) * square_unit;
      results[start + k] =
          exchange_area(polygons_[std::min(one, other)], polygons_[std::max(one, other)], tolerance * least_area);
    }
  }
}

void FormFactorBatch::exchange_areas_by_rule(std::uint32_t one, std::span<const std::uint32_t> others, int points,
                                             std::span<double> results) const {
  if (points < 1 || points > kMaxOrder)
    throw InvalidParams(fmt::format("form factors: points = {}, expected 1 to {}.", points, kMaxOrder));
  std::array<const PatchRecord*, batch::kBlock> first, second;
  for (std::size_t start = 0; start < others.size(); start += batch::kBlock) {
    const int count = static_cast<int>(std::min<std::size_t>(batch::kBlock, others.size() - start));
    for (int k = 0; k < count; ++k) {
      first[k] = &records_[std::min(one, others[start + k])];
      second[k] = &records_[std::max(one, others[start + k])];
    }
    kernels_->product(first.data(), second.data(), count, product_rule(points), results.data() + start);
    for (int k = 0; k < count; ++k) results[start + k] *= unit_ * unit_;
  }
}

}  // namespace interglow::radiosity
