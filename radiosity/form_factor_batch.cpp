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

/// Where a mean is taken: over the patch, or over the middles of the straight lines of constant v or u.
enum class MeanOver { kPatch, kMiddlesAlongU, kMiddlesAlongV };

/// Σ weight f(x - centre) over the 6 x 6 rule: exact for polynomials of degree 10.
template <class Function>
auto mean_of(const PatchRecord& record, MeanOver where, Function f) {
  const ProductRule& rule = product_rules()[kMaxOrder];
  const int shape = load(record.e2).isZero(0) ? 1 : 0;  // a triangle's
  decltype(f(Vector3d())) sum = 0 * f(Vector3d(Vector3d::Zero()));
  for (int i = 0; i < kMaxOrder * kMaxOrder; ++i) {
    const double u = where == MeanOver::kMiddlesAlongU ? 0.5 : rule.u[shape][i],
                 v = where == MeanOver::kMiddlesAlongV ? 0.5 : rule.v[shape][i];
    const Vector3d x = load(record.origin) + u * load(record.e1) + v * load(record.e2) + u * v * load(record.e3);
    const double density = record.density[0] + u * record.density[1] + v * record.density[2];
    sum += rule.weight[shape][i] * density * f(x - load(record.centre));
  }
  return sum;
}

template <class Function>
double mean_of(const PatchRecord& record, Function f) {
  return mean_of(record, MeanOver::kPatch, f);
}

/// The lines that product rules run along.
void set_lines(PatchRecord& record) {
  const Vector3d e1 = load(record.e1), e2 = load(record.e2), e3 = load(record.e3);
  record.half_line_u = std::max(e1.norm(), (e1 + e3).norm()) / 2;
  record.half_line_v = std::max(e2.norm(), (e2 + e3).norm()) / 2;
  const double along_u = std::abs(record.density[1]) / 2, along_v = std::abs(record.density[2]) / 2,
               most = std::max(along_u, along_v);
  // Of the middles of lines: the other parameter at either end.
  const double least = record.density[0] + (record.density[1] + record.density[2]) / 2 - most;
  record.density_skew = least > 0 ? most / least : 1e100;
  for (const MeanOver where : {MeanOver::kPatch, MeanOver::kMiddlesAlongU, MeanOver::kMiddlesAlongV}) {
    const Eigen::Matrix3d moments =
        mean_of(record, where, [](const Vector3d& x) -> Eigen::Matrix3d { return x * x.transpose(); });
    // The larger eigenvalue of a matrix of rank 2.
    const double trace = moments.trace(), difference = std::max(0.0, 2 * moments.squaredNorm() - trace * trace);
    record.variance = std::max(record.variance, (trace + std::sqrt(difference)) / 2 * (1 + 1e-12));
    record.offset =
        std::max(record.offset, mean_of(record, where, [](const Vector3d& x) -> Vector3d { return x; }).norm());
  }
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
/// @param ball  `radius`; without end if the plane is too uncertain for what is asked of the first line
double pack_spread(const PatchRecord& record, double difference, double ball) {
  const bool symmetric = record.third <= 0;
  const double enlarged = std::min(ball + 2 * batch::kOpen, 1e100), ball_square = enlarged * enlarged;
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
    longest_edge = std::max(longest_edge, edge);
  }
  record.half_edge = longest_edge / 2;
  record.skew = parallelogram ? e3.norm() * longest_edge : -1;
  const double turn = set_moments(record);
  set_lines(record);
  record.sides = std::sqrt(e1.norm() * e2.norm() * (e1.norm() * e2.norm() + std::abs(e1.dot(e2))));
  record.deviation = 2 * plane.deviation;
  record.lever = (4 * plane.deviation + 16 * std::numeric_limits<double>::epsilon() * longest) / plane.thickness;
  const double reach = 8;  // farther than two points in normalised coordinates are apart
  const bool certain = record.deviation + record.lever * reach < batch::kOpen;
  record.spread = pack_spread(record, turn, certain ? record.radius : std::numeric_limits<double>::max() / 4);
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

/// Collects what `settle` has left of several rows and does it rule by rule, in full vectors.
class FormFactorBatch::Sorter {
 public:
  Sorter(const FormFactorBatch& batch, double tolerance)
      : batch_(batch), kernels_(*batch.kernels_), tolerance_(tolerance), square_unit_(batch.unit_ * batch.unit_) {
    open_.count = 0;
  }

  /// @param others  at most kBlock
  void add(std::uint32_t one, std::span<const std::uint32_t> others, FormFactor* found) {
    if (open_.count + static_cast<int>(others.size()) > batch::kMostOpen) finish();
    int added = open_.count;
    kernels_.settle(batch_.records_.data(), one, others.data(), static_cast<int>(others.size()), tolerance_,
                    square_unit_, edge_rules().data(), reinterpret_cast<batch::Result*>(found), open_);
    // The lower index comes first, whichever way the pair is asked for: the same bits for (i, j) and (j, i).
    for (; added < open_.count; ++added) {
      const std::uint32_t other = others[open_.place[added]];
      first_[added] = &batch_.records_[std::min(one, other)];
      second_[added] = &batch_.records_[std::max(one, other)];
      found_[added] = found + open_.place[added];
    }
  }

  void finish() {
    if (open_.count == 0) return;
    choose();
    // One choice after the other, sorted by counting: all pairs of a vector take the same rule.
    std::array<int, batch::kChoices + 1> end{};
    for (int i = 0; i < open_.count; ++i) ++end[open_.choice[i] + 1];
    for (int choice = 1; choice <= batch::kChoices; ++choice) end[choice] += end[choice - 1];
    std::array<int, batch::kMostOpen> sorted;
    for (int i = 0; i < open_.count; ++i) sorted[end[open_.choice[i]]++] = i;
    for (int begin = 0; begin < open_.count;) {
      const int choice = open_.choice[sorted[begin]];
      compute(choice, {sorted.data() + begin, static_cast<std::size_t>(end[choice] - begin)});
      begin = end[choice];
    }
    open_.count = 0;
  }

 private:
  using Records = const PatchRecord* const*;
  static constexpr int kMost = batch::kMostOpen;

  void choose() {
    const EdgeRule* of_edges = edge_rules().data();
    const ProductRule* products = product_rules().data();
    ask(batch::kParallelograms, [&](Records first, Records second, int count, std::int32_t* choice, double* bound) {
      kernels_.choose(first, second, count, tolerance_, of_edges, choice, bound);
    });
    ask(batch::kOthers, [&](Records first, Records second, int count, std::int32_t* choice, double* bound) {
      kernels_.choose_products(first, second, count, tolerance_, products, choice, bound);
    });
    for (int i = 0; i < open_.count; ++i)
      if (open_.choice[i] == batch::kUnsettled && share_a_corner(i)) open_.choice[i] = batch::kContour;
    ask(batch::kUnsettled, [&](Records first, Records second, int count, std::int32_t* choice, double* bound) {
      kernels_.classify(first, second, count, tolerance_, of_edges, products, choice, bound);
    });
  }

  /// Edges that meet take the contour integral: no need to look closer.
  bool share_a_corner(int i) const {
    const double reach = first_[i]->radius + second_[i]->radius + batch::kOpen;
    if ((load(first_[i]->centre) - load(second_[i]->centre)).squaredNorm() > reach * reach) return false;
    const Polygon &one = polygon(first_[i]), &other = polygon(second_[i]);
    for (int a = 0; a < one.corners; ++a)
      for (int b = 0; b < other.corners; ++b)
        if (one.corner[a] == other.corner[b]) return true;
    return false;
  }

  const Polygon& polygon(const PatchRecord* record) const { return batch_.polygons_[record - batch_.records_.data()]; }

  template <class Chooser>
  void ask(batch::Choice about, Chooser chooser) {
    std::array<int, kMost> member;
    std::size_t members = 0;
    for (int i = 0; i < open_.count; ++i) {
      member[members] = i;
      members += open_.choice[i] == about ? 1 : 0;
    }
    const int count = static_cast<int>(members);
    if (count == 0) return;
    if (count == open_.count) return chooser(first_.data(), second_.data(), count, open_.choice, open_.bound);
    pack({member.data(), members});
    std::array<std::int32_t, kMost> choice;
    chooser(packed_first_.data(), packed_second_.data(), count, choice.data(), values_.data());
    for (int i = 0; i < count; ++i) {
      open_.choice[member[i]] = choice[i];
      open_.bound[member[i]] = values_[i];
    }
  }

  void pack(std::span<const int> members) {
    for (std::size_t i = 0; i < members.size(); ++i) {
      packed_first_[i] = first_[members[i]];
      packed_second_[i] = second_[members[i]];
    }
  }

  /// The pairs of one choice.
  void compute(int choice, std::span<const int> members) {
    if (choice == batch::kNothing) {
      for (const int i : members) *found_[i] = {};
      return;
    }
    if (choice == batch::kContour) {
      for (const int i : members) {
        const double wanted = tolerance_ * std::min(first_[i]->area, second_[i]->area) * square_unit_;
        *found_[i] = exchange_area(polygon(first_[i]), polygon(second_[i]), wanted);
      }
      return;
    }
    pack(members);
    const Records first = packed_first_.data(), second = packed_second_.data();
    const int count = static_cast<int>(members.size());
    FormFactorMethod method = FormFactorMethod::kFarQuadrature;
    if (choice == batch::kRound || choice == batch::kMoments) {
      kernels_.centres(first, second, count, choice == batch::kRound ? 2 : 3, values_.data());
    } else if (choice == batch::kCut) {
      kernels_.product(first, second, count, product_rules()[2], values_.data());
    } else if (choice < batch::kEdges) {
      kernels_.product(first, second, count, product_rules()[choice - batch::kProduct], values_.data());
    } else {
      const int points = choice - batch::kEdges;
      kernels_.edges(first, second, count, edge_rules()[points / 2], points % 2 == 0, values_.data());
      method = FormFactorMethod::kEdgeQuadrature;
    }
    for (int k = 0; k < count; ++k) {
      const int i = members[k];
      const double value = std::clamp(values_[k], 0.0, std::min(first_[i]->area, second_[i]->area));
      *found_[i] = {value * square_unit_, open_.bound[i] * square_unit_, method};
    }
  }

  const FormFactorBatch& batch_;
  const batch::Kernels& kernels_;
  double tolerance_, square_unit_;
  batch::OpenPairs open_;
  std::array<const PatchRecord*, kMost> first_, second_, packed_first_, packed_second_;
  std::array<FormFactor*, kMost> found_;
  std::array<double, kMost> values_;
};

void FormFactorBatch::exchange_areas(std::span<const Row> rows, double tolerance) const {
  Sorter sorter(*this, tolerance);
  for (const Row& row : rows)
    for (std::size_t start = 0; start < row.others.size(); start += batch::kBlock) {
      const std::size_t count = std::min<std::size_t>(batch::kBlock, row.others.size() - start);
      sorter.add(row.one, row.others.subspan(start, count), row.results.data() + start);
    }
  sorter.finish();
}

void FormFactorBatch::exchange_areas(std::uint32_t one, std::span<const std::uint32_t> others, double tolerance,
                                     std::span<FormFactor> results) const {
  const Row row{one, others, results};
  exchange_areas({&row, 1}, tolerance);
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
