// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/transport_assembly.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include "radiosity/assembly_problem.h"
#include "radiosity/blocker_search.h"
#include "radiosity/form_factor.h"
#include "radiosity/line_sampling.h"
#include "radiosity/occluded_form_factor.h"
#include "radiosity/row_error.h"
#include "radiosity/sampled_rows.h"
#include "radiosity/sampled_tile.h"
#include "radiosity/shadow_cells.h"

namespace interglow::radiosity {
namespace {

using Eigen::Vector3d;

/// Pieces of parallel work to aim at: enough to keep many cores busy to the end.
constexpr std::size_t kTasks = 1024;

/// More polygons than this in the way of one pair are sampled by rays: clipping would cost more than the tolerance is
/// worth.
constexpr std::size_t kMostClipped = 12;
/// Lines between two clusters, one of them black, that must all be blocked for the pair to be dropped: at least so
/// many, and so many times the inverse tolerance, which leaves a quarter of it in doubt where a row sees nothing else.
constexpr int kLeastClusterLines = 256;
constexpr double kClusterLines = 4.0;
/// Draws of lines other than those of sampled tiles.
constexpr std::uint64_t kLonePairs = 2;
constexpr std::uint64_t kClusterLine = std::uint64_t{1} << 32;
/// Lines of a pair past few bodies that the cells give up.
constexpr int kManyLines = 4096;

struct NodePair {
  int a;
  int b;
};

/// Takes what blockers hide off an exchange area.
void take_away(const ShadowResult& result, FormFactor& exchange, TransportReport& counts) {
  exchange.error_estimate += result.error_estimate;
  if (!result.touched) return;
  if (result.covered) {
    ++counts.blocked_pairs;
    exchange.value = 0.0;
    exchange.method = FormFactorMethod::kBlocked;
    return;
  }
  ++counts.partially_visible_pairs;
  exchange.value = std::clamp(exchange.value - result.hidden, 0.0, exchange.value);
  exchange.method = FormFactorMethod::kOccluded;
}

/// Works through pairs of clusters of one task.
class Descent {
 public:
  Descent(const AssemblyProblem& problem, const Progress& stop) : problem_(problem), stop_(stop), search_(problem) {
    if (!problem.visibility) return;
    lines_.emplace(problem.elements, problem.tree, *problem.visibility);
    sampler_.emplace(problem);
  }

  void run(NodePair pair) {
    Candidates all;
    if (problem_.few_blockers()) {
      for (std::size_t k = 0; k < problem_.blockers.body.size(); ++k) all.push_back(static_cast<int>(k));
    }
    to_tiles(pair.a, pair.b, all);
  }

  TileMatrix::Chunk chunk;
  TransportReport counts;
  std::vector<RowError> row_errors;
  std::vector<SampledTile> sampled;

 private:
  /// A pair of a tile that blockers may reach.
  struct Shadowed {
    int row;
    int column;
    int first_candidate;
    int candidates;
  };

  const Cluster& cluster(int node) const { return problem_.cluster(node); }
  int element(int position) const { return problem_.element(position); }
  double flat() const { return problem_.tree.flat(); }

  /// Whether no body hides all lines between two clusters; keeps those that may hide some.
  bool thin_out(int a, int b, const Candidates& candidates, Candidates& left) {
    if (candidates.empty() || search_.thin_out(a, b, candidates, left)) return true;
    count_blocked(a, b);
    return false;
  }

  void count_blocked(int a, int b) {
    counts.blocked_pairs += static_cast<std::int64_t>(cluster(a).count) * cluster(b).count;
  }

  void to_tiles(int a, int b, const Candidates& candidates) {
    if (!problem_.may_exchange(a, b)) return;
    Candidates left;
    if (!thin_out(a, b, candidates, left)) return;
    if (problem_.is_tile(a) && problem_.is_tile(b)) {
      stop_.update("form factors", 0.0);
      tile(a, b, left);
      return;
    }
    if (problem_.is_black(a) != problem_.is_black(b) && hidden_by_lines(a, b)) return;
    if (a == b) {
      to_tiles(cluster(a).left, cluster(a).left, left);
      to_tiles(cluster(a).left, cluster(a).right, left);
      to_tiles(cluster(a).right, cluster(a).right, left);
    } else if (!problem_.is_tile(a) && (problem_.is_tile(b) || cluster(a).count >= cluster(b).count)) {
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
    rows_ = cluster(a).count;
    columns_ = cluster(b).count;
    facing_.assign(static_cast<std::size_t>(rows_ * columns_), 0);
    shadowed_.clear();
    candidate_pool_.clear();
    any_ = false;
    sampled_ = false;
    if (!problem_.few_blockers()) {
      Candidates found;
      if (!search_.search(a, b, kMostClipped, found)) {
        count_blocked(a, b);
        return;
      }
      sampled_ = found.size() > kMostClipped;
      if (sampled_) found.clear();
      pairs(a, b, found);
    } else {
      pairs(a, b, candidates);
    }
    if (!any_) return;
    values_.assign(static_cast<std::size_t>(rows_ * columns_), 0.0);
    of_rows_.assign(static_cast<std::size_t>(rows_), {});
    of_columns_.assign(static_cast<std::size_t>(columns_), {});
    fill();
    if (a == b && !sampled_) {
      for (int r = 0; r < columns_; ++r) {
        for (int c = 0; c < r; ++c) {
          double& lower = values_[static_cast<std::size_t>(r * columns_ + c)];
          double& upper = values_[static_cast<std::size_t>(c * columns_ + r)];
          lower = upper = lower + upper;  // one of them is 0
        }
      }
    }
    const auto add_errors = [&](int first, std::vector<RowError>& errors) {
      for (std::size_t k = 0; k < errors.size(); ++k) {
        if (!(errors[k].bound > 0.0 || errors[k].variance > 0.0)) continue;
        errors[k].element = element(first + static_cast<int>(k));
        row_errors.push_back(errors[k].over(problem_.elements.area_mm2[errors[k].element]));
      }
    };
    add_errors(row_first_, of_rows_);
    add_errors(column_first_, of_columns_);
    chunk.values.push_back(values_);
    double* const tile_values = chunk.values.back().data();
    chunk.tiles.push_back({problem_.tile_of_node[static_cast<std::size_t>(a)],
                           problem_.tile_of_node[static_cast<std::size_t>(b)], tile_values});
    if (!sampled_) return;
    SampledTile tile{row_first_, column_first_, rows_, columns_, tile_values, {}};
    tile.pair.resize(methods_.size());
    for (std::size_t at = 0; at < methods_.size(); ++at) tile.pair[at].method = methods_[at];
    sampler_->draw_pilot(tile);
    sampled.push_back(std::move(tile));
  }

  /// Marks the pairs of a tile that face one another and lists those that blockers may reach.
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
    if (!problem_.may_exchange(a, b)) return;
    if (candidates.empty()) {
      for (int p = ca.first; p < ca.first + ca.count; ++p) {
        for (int q = cb.first; q < cb.first + cb.count; ++q) mark(p, q);
      }
      return;
    }
    Candidates left;
    if (!thin_out(a, b, candidates, left)) return;
    if (ca.count == 1 && cb.count == 1) {
      if (!mark(ca.first, cb.first) || left.empty()) return;
      shadowed_.push_back({ca.first - row_first_, cb.first - column_first_, static_cast<int>(candidate_pool_.size()),
                           static_cast<int>(left.size())});
      candidate_pool_.insert(candidate_pool_.end(), left.begin(), left.end());
    } else if (cb.count == 1 ||
               (ca.count > 1 && (ca.box.high - ca.box.low).squaredNorm() >= (cb.box.high - cb.box.low).squaredNorm())) {
      pairs(ca.left, b, left);
      pairs(ca.right, b, left);
    } else {
      pairs(a, cb.left, left);
      pairs(a, cb.right, left);
    }
  }

  bool in_front_of(int i, const Polygon& other) const {
    return in_front(problem_.elements.normal.row(i).transpose(), problem_.tree.polygon(i).corner[0], other);
  }

  bool mark(int p, int q) {
    const int i = element(p);
    const int j = element(q);
    // Front and back of one face: rounding may put either in front of the other.
    if (problem_.elements.face[static_cast<std::size_t>(i)] == problem_.elements.face[static_cast<std::size_t>(j)])
      return false;
    if (problem_.idle(problem_.elements.material[static_cast<std::size_t>(i)] < 0,
                      problem_.elements.material[static_cast<std::size_t>(j)] < 0))
      return false;
    if (!in_front_of(i, problem_.tree.polygon(j)) || !in_front_of(j, problem_.tree.polygon(i))) return false;
    ++counts.facing_pairs;
    any_ = true;
    facing_[static_cast<std::size_t>((p - row_first_) * columns_ + q - column_first_)] = 1;
    return true;
  }

  /// Wanted error of what blockers hide [mm²].
  double shadow_tolerance(int i, int j) const {
    return 0.2 * problem_.entry_tolerance * std::min(problem_.elements.area_mm2[i], problem_.elements.area_mm2[j]);
  }

  /// Exchange areas of the marked pairs of a tile, row by row; then what blockers leave of them.
  void fill() {
    results_.assign(static_cast<std::size_t>(rows_ * columns_), FormFactor{});
    others_.clear();
    places_.clear();
    for (int r = 0; r < rows_; ++r) {
      for (int c = 0; c < columns_; ++c) {
        if (facing_[static_cast<std::size_t>(r * columns_ + c)] == 0) continue;
        others_.push_back(static_cast<std::uint32_t>(element(column_first_ + c)));
        places_.push_back(r * columns_ + c);
      }
    }
    found_.assign(others_.size(), FormFactor{});
    kernel_rows_.clear();
    for (std::size_t begin = 0, end = 0; begin < places_.size(); begin = end) {
      const int r = places_[begin] / columns_;
      while (end < places_.size() && places_[end] / columns_ == r) ++end;
      kernel_rows_.push_back({static_cast<std::uint32_t>(element(row_first_ + r)),
                              std::span(others_).subspan(begin, end - begin),
                              std::span(found_).subspan(begin, end - begin)});
    }
    problem_.kernel->exchange_areas(kernel_rows_, problem_.unoccluded_tolerance);
    for (std::size_t k = 0; k < others_.size(); ++k) {
      // The vector kernel takes patches that rise above a plane by a few roundings of the scene as not rising.
      if (found_[k].method == FormFactorMethod::kZero) {
        const int one = element(row_first_ + places_[k] / columns_), other = static_cast<int>(others_[k]);
        const double smaller = std::min(problem_.elements.area_mm2[one], problem_.elements.area_mm2[other]);
        found_[k] = exchange_area(problem_.tree.polygon(one), problem_.tree.polygon(other),
                                  problem_.unoccluded_tolerance * smaller);
      }
      results_[static_cast<std::size_t>(places_[k])] = found_[k];
    }
    for (const Shadowed& pair : shadowed_) {
      FormFactor& exchange = results_[static_cast<std::size_t>(pair.row * columns_ + pair.column)];
      if (exchange.value > 0.0) shadow(pair, exchange);
    }
    methods_.assign(sampled_ ? results_.size() : 0, 0);
    for (int r = 0; r < rows_; ++r) {
      for (int c = 0; c < columns_; ++c) {
        const auto at = static_cast<std::size_t>(r * columns_ + c);
        if (facing_[at] == 0) continue;
        const FormFactor& exchange = results_[at];
        if (sampled_ && exchange.value > 0.0)
          methods_[at] = static_cast<std::uint8_t>(exchange.method);  // counted once it is settled
        else
          ++counts.pairs_by_method[static_cast<std::size_t>(exchange.method)];
        values_[at] = exchange.value;
        of_rows_[static_cast<std::size_t>(r)].bound += exchange.error_estimate;
        of_columns_[static_cast<std::size_t>(c)].bound += exchange.error_estimate;
      }
    }
  }

  void shadow(const Shadowed& pair, FormFactor& exchange) {
    int outer = element(row_first_ + pair.row);
    int source = element(column_first_ + pair.column);
    if (outer > source) std::swap(outer, source);
    bodies_.clear();
    for (int k = 0; k < pair.candidates; ++k) {
      bodies_.push_back(
          &problem_.blockers
               .body[static_cast<std::size_t>(candidate_pool_[static_cast<std::size_t>(pair.first_candidate + k)])]);
    }
    const FormFactor whole = exchange;
    const double tolerance = shadow_tolerance(outer, source);
    const bool swap = better_outer(source, outer);
    const ShadowResult result =
        cells_.integrate(problem_.tree.polygon(swap ? source : outer), problem_.tree.polygon(swap ? outer : source),
                         bodies_, tolerance, flat());
    take_away(result, exchange, counts);
    // Patches that nearly touch, with blockers in the gap.
    if (result.error_estimate > 4.0 * tolerance &&
        !cut_at_events(swap ? source : outer, swap ? outer : source, whole, tolerance, exchange))
      ask_lines(pair, whole, exchange);
  }

  /// The visible share of a pair past sheets, cut where they come into sight: slower than the cells, and surer in
  /// narrow gaps. Whether it knows better than they do.
  bool cut_at_events(int outer, int source, const FormFactor& whole, double tolerance, FormFactor& exchange) {
    std::vector<BlockerOutline> outlines;
    for (const ConvexBody* body : bodies_) {
      if (body->solid) return false;
      outlines.emplace_back(body->vertex);
    }
    const VisibleShare seen = visible_share(problem_.tree.polygon(outer), problem_.tree.polygon(source), outlines,
                                            tolerance / whole.value, true, visible_part_);
    const double estimate = whole.error_estimate + seen.error_estimate * whole.value;
    if (estimate > exchange.error_estimate) return false;
    exchange.value = whole.value * seen.share;
    exchange.error_estimate = estimate;
    return true;
  }

  /// The visible share by lines, if they know it better than the cells.
  void ask_lines(const Shadowed& pair, const FormFactor& whole, FormFactor& exchange) {
    const int i = element(row_first_ + pair.row);
    const int j = element(column_first_ + pair.column);
    lines_->clear();
    lines_->add(std::min(i, j), std::max(i, j), kLonePairs, kManyLines);
    lines_->trace();
    const LineSums sums = lines_->sums(0, lines_->size());
    const double variance = std::max(sums.variance(), 0.5 / (kManyLines * 1.0 * kManyLines));
    if (problem_.deviations * std::sqrt(variance) * whole.value > exchange.error_estimate) return;
    // Lines know no gaps below single precision, where the cells do.
    if (std::abs(whole.value * sums.share() - exchange.value) > exchange.error_estimate) return;
    exchange.value = whole.value * sums.share();
    exchange.error_estimate = whole.error_estimate;
    RowError error;
    error.variance = variance * whole.value * whole.value;
    error.draws_variance = error.variance;
    error.draws_squares = error.variance * error.variance / 3.0;
    of_rows_[static_cast<std::size_t>(pair.row)] += error;
    of_columns_[static_cast<std::size_t>(pair.column)] += error;
  }

  /// Seen from the farther patch, shadows on the other one move less: their edges cross fewer of its corners.
  bool better_outer(int i, int j) const {
    const auto nearest = [&](int e) {
      double least = std::numeric_limits<double>::infinity();
      const Vector3d p = problem_.elements.centroid.row(e).transpose();
      for (const ConvexBody* body : bodies_)
        least = std::min(least, (p.cwiseMax(body->box.low).cwiseMin(body->box.high) - p).squaredNorm());
      return least;
    };
    return problem_.elements.area_mm2[i] * nearest(j) < problem_.elements.area_mm2[j] * nearest(i);
  }

  bool hidden_by_lines(int a, int b);
  const AssemblyProblem& problem_;
  const Progress& stop_;
  BlockerSearch search_;
  ShadowCells cells_;
  VisiblePart visible_part_;
  std::optional<LineSampler> lines_;
  std::optional<TileSampler> sampler_;
  std::vector<const ConvexBody*> bodies_;
  std::vector<char> facing_;  ///< of the tile's pairs: whether they face one another
  std::vector<Shadowed> shadowed_;
  std::vector<int> candidate_pool_;
  std::vector<FormFactor> results_;
  // The pairs that face each other, row by row: the patch of the column, the place in `results_`, what is exchanged.
  std::vector<std::uint32_t> others_;
  std::vector<int> places_;
  std::vector<FormFactor> found_;
  std::vector<FormFactorBatch::Row> kernel_rows_;
  std::vector<std::uint8_t> methods_;
  std::vector<double> values_;
  std::vector<RowError> of_rows_, of_columns_;  ///< of the tile, as exchange areas
  int row_first_ = 0;
  int column_first_ = 0;
  int rows_ = 0;
  int columns_ = 0;
  bool any_ = false;
  bool sampled_ = false;  ///< rays decide about this tile's pairs
};

/// The black inside of an open sheet is behind its outside for most of a scene, but no single face hides it. It sends
/// nothing back, so lines are proof enough: if all of them are blocked the clusters are dropped, with one line in
/// doubt.
bool Descent::hidden_by_lines(int a, int b) {
  if (problem_.few_blockers()) return false;
  const Cluster& ca = cluster(a);
  const Cluster& cb = cluster(b);
  constexpr std::array<double, 2> kStep = {0.7548776662466927, 0.5698402909980532};
  const int enough = std::max(kLeastClusterLines, static_cast<int>(kClusterLines / problem_.params.tolerance));
  // Fewer lines settle the pairs one by one.
  if (enough > 2.0 * ca.count * cb.count) return false;
  double factor = 0.0;  // mean over the lines of the form factor from a member of a to all of b
  int lines = 0;
  for (int number = 0; number < 4 * enough && lines < enough;) {
    lines_->clear();
    constexpr int kTogether = 32;
    double areas = 0.0;
    for (int k = 0; k < kTogether; ++k, ++number) {
      const double x = (number + 0.5) * kStep[0];
      const double y = (number + 0.5) * kStep[1];
      const int i = element(ca.first + static_cast<int>((x - std::floor(x)) * ca.count));
      const int j = element(cb.first + static_cast<int>((y - std::floor(y)) * cb.count));
      if (lines_->add(std::min(i, j), std::max(i, j), kClusterLine + static_cast<std::uint64_t>(number), 1) > 0)
        areas += problem_.elements.area_mm2[j];
    }
    if (lines_->size() == 0) continue;
    lines_->trace();
    double weights = 0.0;
    for (std::size_t k = 0; k < lines_->size(); ++k) {
      if (!lines_->blocked(k)) return false;
      weights += lines_->weight(k);
    }
    lines += static_cast<int>(lines_->size());
    factor += areas / static_cast<double>(lines_->size()) * cb.count * weights / std::numbers::pi;
  }
  if (lines < enough) return false;
  count_blocked(a, b);
  const double in_doubt = std::min(1.0, factor / lines) / lines;
  for (int k = ca.first; k < ca.first + ca.count; ++k) row_errors.push_back({.element = element(k), .bound = in_doubt});
  return true;
}

/// Puts what is visible in place; tiles that turn out dark are given up.
void finish(std::vector<SampledTile>& tiles, TileMatrix::Chunk& chunk, TransportReport& counts) {
  for (SampledTile& tile : tiles) {
    if (!TileSampler::finish(tile, counts)) {
      std::erase_if(chunk.tiles, [&](const TileMatrix::Tile& each) { return each.value == tile.values; });
      std::erase_if(chunk.values, [&](const std::vector<double>& values) { return values.data() == tile.values; });
    }
    tile = {};
  }
}

/// Splits the pair of the root with itself into about kTasks pairs of clusters, in a fixed order.
std::vector<NodePair> make_tasks(const AssemblyProblem& problem) {
  std::vector<NodePair> tasks = {{problem.tree.root(), problem.tree.root()}};
  bool split_any = true;
  while (split_any && tasks.size() < kTasks) {
    split_any = false;
    std::vector<NodePair> next;
    for (const auto& [a, b] : tasks) {
      const Cluster& ca = problem.cluster(a);
      const Cluster& cb = problem.cluster(b);
      if (!may_face(ca, cb.box) || !may_face(cb, ca.box)) continue;
      if (problem.is_tile(a) && problem.is_tile(b)) {
        next.push_back({a, b});
        continue;
      }
      split_any = true;
      if (a == b) {
        next.insert(next.end(), {{ca.left, ca.left}, {ca.left, ca.right}, {ca.right, ca.right}});
      } else if (!problem.is_tile(a) && (problem.is_tile(b) || ca.count >= cb.count)) {
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
  assembly.report.elements = n;
  assembly.report.pairs = n * (n - 1) / 2;
  if (n == 0) return assembly;
  AssemblyProblem problem(elements, params);
  const std::vector<NodePair> tasks = make_tasks(problem);
  assembly.report.seconds_search = seconds_since(start);
  const auto factors_start = std::chrono::steady_clock::now();

  std::vector<TileMatrix::Chunk> chunks(tasks.size());
  std::vector<TransportReport> counts(tasks.size());
  std::vector<std::vector<RowError>> row_errors(tasks.size());
  std::vector<std::vector<SampledTile>> sampled(tasks.size());
  std::atomic<std::size_t> done = 0;
  const Progress stop{.report = {}, .cancelled = progress.cancelled};
  // Tasks near contacts are by far the longest, and stand together.
  tbb::parallel_for(
      std::size_t{0}, tasks.size(),
      [&](std::size_t t) {
        Descent descent(problem, stop);
        descent.run(tasks[t]);
        chunks[t] = std::move(descent.chunk);
        counts[t] = descent.counts;
        row_errors[t] = std::move(descent.row_errors);
        sampled[t] = std::move(descent.sampled);
        progress.update("form factors", static_cast<double>(++done) / static_cast<double>(tasks.size()));
      },
      tbb::simple_partitioner());
  std::vector<RowError> of_rows(static_cast<std::size_t>(n));
  for (std::vector<RowError>& list : row_errors) {
    for (const RowError& error : list) of_rows[static_cast<std::size_t>(error.element)] += error;
  }
  of_rows = draw_lines(problem, sampled, of_rows, progress);
  for (std::size_t t = 0; t < tasks.size(); ++t) finish(sampled[t], chunks[t], counts[t]);
  for (const TransportReport& count : counts) {
    assembly.report.facing_pairs += count.facing_pairs;
    assembly.report.partially_visible_pairs += count.partially_visible_pairs;
    assembly.report.blocked_pairs += count.blocked_pairs;
    for (std::size_t m = 0; m < count.pairs_by_method.size(); ++m)
      assembly.report.pairs_by_method[m] += count.pairs_by_method[m];
  }
  assembly.error_estimate.resize(n);
  for (Eigen::Index e = 0; e < n; ++e)
    assembly.error_estimate[e] = of_rows[static_cast<std::size_t>(e)].estimate(problem.deviations);
  assembly.exchange = TileMatrix(problem.tree.order(), std::move(problem.tile_first), std::move(chunks));
  assembly.report.seconds_factors = seconds_since(factors_start);
  return assembly;
}

}  // namespace interglow::radiosity
