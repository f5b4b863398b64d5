// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/transport_assembly.h"

#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <mutex>
#include <vector>

#include "radiosity/blockers.h"
#include "radiosity/element_tree.h"
#include "radiosity/form_factor.h"
#include "radiosity/occluded_form_factor.h"

namespace interglow::radiosity {
namespace {

using Eigen::Vector3d;
using Candidates = std::vector<int>;

/// Elements a side of a tile: small enough to stay in the first-level cache with its vectors, large enough for dense
/// products.
constexpr int kTileSize = 32;
/// Pieces of parallel work to aim at: enough to keep many cores busy to the end.
constexpr std::size_t kTasks = 1024;

struct Problem {
  const Elements& elements;
  const TransportParams& params;
  ElementTree tree;
  Blockers blockers;
  std::vector<int> tile_of_node;  ///< number of the tile cluster a node is, -1 if it is none
  double entry_tolerance;         ///< of one form factor
};

struct NodePair {
  int a;
  int b;
};

struct Shaft {
  std::array<Vector3d, 16> corner;
  int corners = 0;
};

/// Works through pairs of clusters of one task.
class Descent {
 public:
  explicit Descent(const Problem& problem) : problem_(problem) {}

  void run(NodePair pair) {
    Candidates all;
    if (problem_.params.occlusion) {
      for (std::size_t k = 0; k < problem_.blockers.blocker.size(); ++k) all.push_back(static_cast<int>(k));
    }
    to_tiles(pair.a, pair.b, all);
  }

  TileMatrix::Chunk chunk;
  TransportReport counts;
  struct RowError {
    int element;
    double squared;
  };
  std::vector<RowError> row_errors;

 private:
  const Cluster& cluster(int node) const { return problem_.tree.cluster(node); }
  double flat() const { return problem_.tree.flat(); }
  bool is_tile(int node) const { return problem_.tile_of_node[static_cast<std::size_t>(node)] >= 0; }

  bool may_exchange(int a, int b) const {
    return may_face(cluster(a), cluster(b).box, flat()) && may_face(cluster(b), cluster(a).box, flat());
  }

  void to_tiles(int a, int b, const Candidates& candidates) {
    if (!may_exchange(a, b)) return;
    const Candidates left = thin_out(a, b, candidates);
    if (is_tile(a) && is_tile(b)) {
      tile(a, b, left);
      return;
    }
    if (a == b) {
      to_tiles(cluster(a).left, cluster(a).left, left);
      to_tiles(cluster(a).left, cluster(a).right, left);
      to_tiles(cluster(a).right, cluster(a).right, left);
    } else if (!is_tile(a) && (is_tile(b) || cluster(a).count >= cluster(b).count)) {
      to_tiles(cluster(a).left, b, left);
      to_tiles(cluster(a).right, b, left);
    } else {
      to_tiles(a, cluster(b).left, left);
      to_tiles(a, cluster(b).right, left);
    }
  }

  void tile(int a, int b, const Candidates& candidates) {
    if (problem_.tile_of_node[static_cast<std::size_t>(a)] > problem_.tile_of_node[static_cast<std::size_t>(b)])
      std::swap(a, b);
    row_first_ = cluster(a).first;
    column_first_ = cluster(b).first;
    columns_ = cluster(b).count;
    values_.assign(static_cast<std::size_t>(cluster(a).count) * static_cast<std::size_t>(columns_), 0.0);
    squared_error_a_.assign(static_cast<std::size_t>(cluster(a).count), 0.0);
    squared_error_b_.assign(static_cast<std::size_t>(columns_), 0.0);
    any_ = false;
    pairs(a, b, candidates);
    if (!any_) return;
    if (a == b) {
      for (int r = 0; r < columns_; ++r) {
        for (int c = 0; c < r; ++c) {
          double& lower = values_[static_cast<std::size_t>(r * columns_ + c)];
          double& upper = values_[static_cast<std::size_t>(c * columns_ + r)];
          lower = upper = lower + upper;  // one of them is 0
        }
      }
    }
    const auto add_errors = [&](int first, const std::vector<double>& squared) {
      for (std::size_t k = 0; k < squared.size(); ++k) {
        if (squared[k] > 0.0)
          row_errors.push_back({problem_.tree.order()[static_cast<std::size_t>(first) + k], squared[k]});
      }
    };
    add_errors(row_first_, squared_error_a_);
    add_errors(column_first_, squared_error_b_);
    chunk.values.push_back(values_);
    chunk.tiles.push_back({problem_.tile_of_node[static_cast<std::size_t>(a)],
                           problem_.tile_of_node[static_cast<std::size_t>(b)], chunk.values.back().data()});
  }

  void pairs(int a, int b, const Candidates& candidates) {
    const Cluster& ca = cluster(a);
    const Cluster& cb = cluster(b);
    if (a == b) {
      if (ca.count == 1) return;
      pairs(ca.left, ca.left, candidates);
      pairs(ca.left, ca.right, candidates);
      pairs(ca.right, ca.right, candidates);
      return;
    }
    if (!may_exchange(a, b)) return;
    if (candidates.empty()) {
      for (int p = ca.first; p < ca.first + ca.count; ++p) {
        for (int q = cb.first; q < cb.first + cb.count; ++q) one_pair(p, q, candidates);
      }
      return;
    }
    const Candidates left = thin_out(a, b, candidates);
    if (ca.count == 1 && cb.count == 1) {
      one_pair(ca.first, cb.first, left);
    } else if (cb.count == 1 ||
               (ca.count > 1 && (ca.box.high - ca.box.low).squaredNorm() >= (cb.box.high - cb.box.low).squaredNorm())) {
      pairs(ca.left, b, left);
      pairs(ca.right, b, left);
    } else {
      pairs(a, cb.left, left);
      pairs(a, cb.right, left);
    }
  }

  bool in_front(int element, const Polygon& other) const {
    const Vector3d normal = problem_.elements.normal.row(element).transpose();
    const Vector3d& origin = problem_.tree.polygon(element).corner[0];
    for (int k = 0; k < other.corners; ++k) {
      if (normal.dot(other.corner[static_cast<std::size_t>(k)] - origin) > flat()) return true;
    }
    return false;
  }

  void one_pair(int p, int q, const Candidates& candidates) {
    int i = problem_.tree.order()[static_cast<std::size_t>(p)];
    int j = problem_.tree.order()[static_cast<std::size_t>(q)];
    // Two black sides exchange nothing that anybody asks for.
    if (problem_.elements.material[static_cast<std::size_t>(i)] < 0 &&
        problem_.elements.material[static_cast<std::size_t>(j)] < 0)
      return;
    if (i > j) std::swap(i, j);
    const Polygon& a = problem_.tree.polygon(i);
    const Polygon& b = problem_.tree.polygon(j);
    if (!in_front(i, b) || !in_front(j, a)) return;
    ++counts.facing_pairs;
    const double smaller = std::min(problem_.elements.area_mm2[i], problem_.elements.area_mm2[j]);
    FormFactor exchange = exchange_area(a, b, 0.1 * problem_.entry_tolerance * smaller);
    if (exchange.value > 0.0 && !candidates.empty()) occlude(i, j, candidates, smaller, exchange);
    ++counts.pairs_by_method[static_cast<std::size_t>(exchange.method)];
    if (!(exchange.value > 0.0)) return;
    any_ = true;
    const int row = p - row_first_;
    const int column = q - column_first_;
    values_[static_cast<std::size_t>(row * columns_ + column)] = exchange.value;
    const auto squared = [&](int position) {
      const double error = exchange.error_estimate /
                           problem_.elements.area_mm2[problem_.tree.order()[static_cast<std::size_t>(position)]];
      return error * error;
    };
    squared_error_a_[static_cast<std::size_t>(row)] += squared(row + row_first_);
    squared_error_b_[static_cast<std::size_t>(column)] += squared(column + column_first_);
  }

  void occlude(int i, int j, const Candidates& candidates, double smaller, FormFactor& exchange) {
    outlines_.clear();
    for (int k : candidates) outlines_.emplace_back(problem_.blockers.blocker[static_cast<std::size_t>(k)].corner);
    const Polygon& a = problem_.tree.polygon(i);
    const Polygon& b = problem_.tree.polygon(j);
    const double tolerance = problem_.entry_tolerance * smaller / exchange.value;
    const VisibleShare share = visible_share(a, b, outlines_, tolerance, false, work_);
    if (share.partial) {
      ++counts.partially_visible_pairs;
      exchange.error_estimate += share.error_estimate * exchange.value;
      exchange.value *= share.share;
      exchange.method = FormFactorMethod::kOccluded;
    } else if (share.share == 0.0) {
      ++counts.blocked_pairs;
      exchange = {0.0, 0.0, FormFactorMethod::kBlocked};
    }
  }

  void add_to_shaft(int node, Shaft& shaft) const {
    const Cluster& c = cluster(node);
    if (c.count == 1) {
      const Polygon& polygon = problem_.tree.polygon(problem_.tree.order()[static_cast<std::size_t>(c.first)]);
      for (int k = 0; k < polygon.corners; ++k)
        shaft.corner[static_cast<std::size_t>(shaft.corners++)] = polygon.corner[static_cast<std::size_t>(k)];
    } else {
      for (int k = 0; k < 8; ++k) shaft.corner[static_cast<std::size_t>(shaft.corners++)] = c.box.corner(k);
    }
  }

  /// The candidates that may cut a line between a member of `a` and one of `b`.
  Candidates thin_out(int a, int b, const Candidates& candidates) const {
    Candidates left;
    if (candidates.empty()) return left;
    Shaft shaft;
    add_to_shaft(a, shaft);
    const int a_corners = shaft.corners;
    add_to_shaft(b, shaft);
    Box hull = Box::empty();
    for (int k = 0; k < shaft.corners; ++k) hull.cover(shaft.corner[static_cast<std::size_t>(k)]);
    for (int k : candidates) {
      const Blocker& blocker = problem_.blockers.blocker[static_cast<std::size_t>(k)];
      if ((blocker.box.low.array() > hull.high.array() + flat()).any() ||
          (blocker.box.high.array() < hull.low.array() - flat()).any())
        continue;
      int a_sides = 0;
      int b_sides = 0;
      for (int c = 0; c < shaft.corners; ++c) {
        const double height = blocker.height(shaft.corner[static_cast<std::size_t>(c)]);
        (c < a_corners ? a_sides : b_sides) |= height > flat() ? 1 : height < -flat() ? 2 : 0;
      }
      if ((a_sides | b_sides) != 3) continue;
      if (!may_face(cluster(a), blocker.box, flat()) || !may_face(cluster(b), blocker.box, flat())) continue;
      if (separated(shaft.corner.data(), shaft.corners, blocker.corner.data(), static_cast<int>(blocker.corner.size()),
                    flat()))
        continue;
      left.push_back(k);
    }
    return left;
  }

  const Problem& problem_;
  VisiblePart work_;
  std::vector<BlockerOutline> outlines_;
  std::vector<double> values_, squared_error_a_, squared_error_b_;
  int row_first_ = 0;
  int column_first_ = 0;
  int columns_ = 0;
  bool any_ = false;
};

/// Numbers the tile clusters in order of position and returns their first positions.
std::vector<int> mark_tiles(const ElementTree& tree, int node, std::vector<int>& tile_of_node,
                            std::vector<int>& first) {
  if (node < 0) return {0};
  std::vector<int> pending = {node};
  while (!pending.empty()) {
    const int n = pending.back();
    pending.pop_back();
    const Cluster& cluster = tree.cluster(n);
    if (cluster.count <= kTileSize) {
      tile_of_node[static_cast<std::size_t>(n)] = static_cast<int>(first.size());
      first.push_back(cluster.first);
    } else {
      pending.push_back(cluster.right);
      pending.push_back(cluster.left);
    }
  }
  first.push_back(tree.cluster(node).count);
  return first;
}

/// Splits the pair of the root with itself into about kTasks pairs of clusters, in a fixed order.
std::vector<NodePair> make_tasks(const Problem& problem) {
  std::vector<NodePair> tasks = {{problem.tree.root(), problem.tree.root()}};
  const auto count = [&](int node) { return problem.tree.cluster(node).count; };
  const auto is_tile = [&](int node) { return problem.tile_of_node[static_cast<std::size_t>(node)] >= 0; };
  bool split_any = true;
  while (split_any && tasks.size() < kTasks) {
    split_any = false;
    std::vector<NodePair> next;
    for (const auto& [a, b] : tasks) {
      const Cluster& ca = problem.tree.cluster(a);
      const Cluster& cb = problem.tree.cluster(b);
      if (!may_face(ca, cb.box, problem.tree.flat()) || !may_face(cb, ca.box, problem.tree.flat())) continue;
      if (is_tile(a) && is_tile(b)) {
        next.push_back({a, b});
        continue;
      }
      split_any = true;
      if (a == b) {
        next.insert(next.end(), {{ca.left, ca.left}, {ca.left, ca.right}, {ca.right, ca.right}});
      } else if (!is_tile(a) && (is_tile(b) || count(a) >= count(b))) {
        next.insert(next.end(), {{ca.left, b}, {ca.right, b}});
      } else {
        next.insert(next.end(), {{a, cb.left}, {a, cb.right}});
      }
    }
    tasks.swap(next);
  }
  return tasks;
}

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

Assembly assemble(const Elements& elements, const TransportParams& params, const Progress& progress) {
  const auto start = std::chrono::steady_clock::now();
  const Eigen::Index n = elements.size();
  Assembly assembly;
  assembly.error_estimate = Eigen::VectorXd::Zero(n);
  assembly.report.elements = n;
  assembly.report.pairs = n * (n - 1) / 2;
  Problem problem{elements, params, ElementTree(elements),
                  {},       {},     params.tolerance / std::sqrt(static_cast<double>(std::max<Eigen::Index>(n, 1)))};
  if (n == 0) return assembly;
  if (params.occlusion) problem.blockers = make_blockers(elements.faces, problem.tree.flat());
  problem.tile_of_node.assign(static_cast<std::size_t>(2 * n), -1);
  std::vector<int> first;
  mark_tiles(problem.tree, problem.tree.root(), problem.tile_of_node, first);
  const std::vector<NodePair> tasks = make_tasks(problem);
  assembly.report.seconds_search = seconds_since(start);
  const auto factors_start = std::chrono::steady_clock::now();

  std::vector<TileMatrix::Chunk> chunks(tasks.size());
  std::vector<TransportReport> counts(tasks.size());
  std::vector<std::vector<Descent::RowError>> row_errors(tasks.size());
  std::atomic<std::size_t> done = 0;
  tbb::parallel_for(std::size_t{0}, tasks.size(), [&](std::size_t t) {
    Descent descent(problem);
    descent.run(tasks[t]);
    chunks[t] = std::move(descent.chunk);
    counts[t] = descent.counts;
    row_errors[t] = std::move(descent.row_errors);
    progress.update("form factors", static_cast<double>(++done) / static_cast<double>(tasks.size()));
  });
  for (std::size_t t = 0; t < tasks.size(); ++t) {
    assembly.report.facing_pairs += counts[t].facing_pairs;
    assembly.report.partially_visible_pairs += counts[t].partially_visible_pairs;
    assembly.report.blocked_pairs += counts[t].blocked_pairs;
    for (std::size_t m = 0; m < counts[t].pairs_by_method.size(); ++m)
      assembly.report.pairs_by_method[m] += counts[t].pairs_by_method[m];
    for (const auto& [element, squared] : row_errors[t]) assembly.error_estimate[element] += squared;
  }
  assembly.error_estimate = assembly.error_estimate.cwiseSqrt();
  assembly.exchange = TileMatrix(problem.tree.order(), std::move(first), std::move(chunks));
  assembly.report.seconds_factors = seconds_since(factors_start);
  return assembly;
}

}  // namespace interglow::radiosity
