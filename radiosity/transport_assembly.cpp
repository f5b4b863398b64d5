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
#include "radiosity/row_budget.h"
#include "radiosity/shadow_cells.h"

namespace interglow::radiosity {
namespace {

using Eigen::Vector3d;

/// Pieces of parallel work to aim at: enough to keep many cores busy to the end.
constexpr std::size_t kTasks = 1024;

/// More polygons than this in the way of one pair are sampled by rays: clipping would cost more than the tolerance is
/// worth.
constexpr std::size_t kMostClipped = 12;
/// Lines between two clusters, one of them black, that must all be blocked for the pair to be dropped.
constexpr int kClusterLines = 256;
/// Lines of a sampled pair that one line does not settle.
constexpr int kFewestLines = 4;
constexpr int kMostLines = 4096;
/// After this many the row's budget decides how many more there will be.
constexpr int kFirstLines = 8;

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
    if (problem.visibility) lines_.emplace(problem.elements, problem.tree, *problem.visibility);
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
  struct RowError {
    int element;
    double squared;
  };
  std::vector<RowError> row_errors;
  std::vector<UnsettledPair> unsettled;

 private:
  /// A pair of a tile that blockers may reach.
  struct Shadowed {
    int row;
    int column;
    int first_candidate;
    int candidates;
  };

  /// The line that every pair of a sampled tile gets: the first that carries something.
  struct FirstLine {
    int number = 0;
    double weight = 0.0;
    bool blocked = false;
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
    in_doubt_ = 0.0;
    if (sampled_ && !sample_tile()) return;
    values_.assign(static_cast<std::size_t>(rows_ * columns_), 0.0);
    squared_error_a_.assign(static_cast<std::size_t>(rows_), 0.0);
    squared_error_b_.assign(static_cast<std::size_t>(columns_), 0.0);
    std::size_t first_unsettled = unsettled.size();
    fill();
    if (a == b) {
      for (int r = 0; r < columns_; ++r) {
        for (int c = 0; c < r; ++c) {
          double& lower = values_[static_cast<std::size_t>(r * columns_ + c)];
          double& upper = values_[static_cast<std::size_t>(c * columns_ + r)];
          lower = upper = lower + upper;  // one of them is 0
        }
      }
    }
    if (in_doubt_ > 0.0) add_doubt();
    const auto add_errors = [&](int first, const std::vector<double>& squared) {
      for (std::size_t k = 0; k < squared.size(); ++k) {
        if (squared[k] > 0.0) row_errors.push_back({element(first + static_cast<int>(k)), squared[k]});
      }
    };
    add_errors(row_first_, squared_error_a_);
    add_errors(column_first_, squared_error_b_);
    chunk.values.push_back(values_);
    double* const tile_values = chunk.values.back().data();
    for (; first_unsettled < unsettled.size(); ++first_unsettled) {
      const int at = unsettled[first_unsettled].pair.at;
      unsettled[first_unsettled].value = tile_values + at;
      if (a == b) unsettled[first_unsettled].mirror = tile_values + at % columns_ * columns_ + at / columns_;
    }
    chunk.tiles.push_back({problem_.tile_of_node[static_cast<std::size_t>(a)],
                           problem_.tile_of_node[static_cast<std::size_t>(b)], tile_values});
  }

  /// What a tile's agreeing lines leave open may be wrong for all of a row at once.
  void add_doubt() {
    for (int r = 0; r < rows_; ++r) {
      const double area = problem_.elements.area_mm2[element(row_first_ + r)];
      double sum = 0.0;
      for (int c = 0; c < columns_; ++c) sum += values_[static_cast<std::size_t>(r * columns_ + c)];
      squared_error_a_[static_cast<std::size_t>(r)] += std::pow(in_doubt_ * sum / area, 2);
    }
    for (int c = 0; c < columns_; ++c) {
      const double area = problem_.elements.area_mm2[element(column_first_ + c)];
      double sum = 0.0;
      for (int r = 0; r < rows_; ++r) sum += values_[static_cast<std::size_t>(r * columns_ + c)];
      squared_error_b_[static_cast<std::size_t>(c)] += std::pow(in_doubt_ * sum / area, 2);
    }
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
    facing_[static_cast<std::size_t>((p - row_first_) * columns_ + q - column_first_)] = kFacing;
    return true;
  }

  /// Error of a sampled exchange area that its rows can bear [mm²]. With e² = ε² (1/N + F) / 2 for an entry F the
  /// squares of a row, whose entries sum to at most 1, sum to ε²; the variance of n lines falls as F² / n, so that
  /// entries get lines in proportion to their size, which is the fewest lines for a given error of the row.
  double sampling_tolerance(int i, int j, double exchange) const {
    const double smaller = std::min(problem_.elements.area_mm2[i], problem_.elements.area_mm2[j]);
    return smaller * std::sqrt(0.5 * (problem_.entry_tolerance * problem_.entry_tolerance +
                                      problem_.params.tolerance * problem_.params.tolerance * exchange / smaller));
  }

  /// Error below which a pair is settled whatever else its rows hold: all N of them together take a quarter of the
  /// squared tolerance [mm²].
  double settled_tolerance(int i, int j) const {
    return 0.5 * problem_.entry_tolerance * std::min(problem_.elements.area_mm2[i], problem_.elements.area_mm2[j]);
  }

  /// Exchange areas of the marked pairs of a tile, row by row; then what blockers leave of them.
  void fill() {
    results_.assign(static_cast<std::size_t>(rows_ * columns_), FormFactor{});
    for (int r = 0; r < rows_; ++r) {
      others_.clear();
      columns_of_others_.clear();
      for (int c = 0; c < columns_; ++c) {
        if (facing_[static_cast<std::size_t>(r * columns_ + c)] == 0) continue;
        others_.push_back(static_cast<std::uint32_t>(element(column_first_ + c)));
        columns_of_others_.push_back(c);
      }
      row_results_.assign(others_.size(), FormFactor{});
      problem_.kernel->exchange_areas(static_cast<std::uint32_t>(element(row_first_ + r)), others_,
                                      0.1 * problem_.entry_tolerance, row_results_);
      for (std::size_t k = 0; k < others_.size(); ++k) {
        // The vector kernel takes patches that rise above a plane by a few roundings of the scene as not rising.
        if (row_results_[k].method == FormFactorMethod::kZero) {
          const double smaller = std::min(problem_.elements.area_mm2[element(row_first_ + r)],
                                          problem_.elements.area_mm2[static_cast<Eigen::Index>(others_[k])]);
          row_results_[k] = exchange_area(problem_.tree.polygon(element(row_first_ + r)),
                                          problem_.tree.polygon(static_cast<int>(others_[k])),
                                          0.1 * problem_.entry_tolerance * smaller);
        }
        results_[static_cast<std::size_t>(r * columns_ + columns_of_others_[k])] = row_results_[k];
      }
    }
    sample_pairs();
    for (const Shadowed& pair : shadowed_) {
      FormFactor& exchange = results_[static_cast<std::size_t>(pair.row * columns_ + pair.column)];
      if (exchange.value > 0.0) shadow(pair, exchange);
    }
    for (int r = 0; r < rows_; ++r) {
      for (int c = 0; c < columns_; ++c) {
        const auto at = static_cast<std::size_t>(r * columns_ + c);
        if (facing_[at] != kFacing) continue;
        const FormFactor& exchange = results_[at];
        ++counts.pairs_by_method[static_cast<std::size_t>(exchange.method)];
        values_[at] = exchange.value;
        const double squared = exchange.error_estimate * exchange.error_estimate;
        const double area_a = problem_.elements.area_mm2[element(row_first_ + r)];
        const double area_b = problem_.elements.area_mm2[element(column_first_ + c)];
        squared_error_a_[static_cast<std::size_t>(r)] += squared / (area_a * area_a);
        squared_error_b_[static_cast<std::size_t>(c)] += squared / (area_b * area_b);
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
    const double bearable = sampling_tolerance(outer, source, exchange.value);
    ShadowResult result;
    if (bodies_.size() <= kMostClipped) {
      const double tolerance = 0.5 * problem_.entry_tolerance *
                               std::min(problem_.elements.area_mm2[outer], problem_.elements.area_mm2[source]);
      const bool swap = better_outer(source, outer);
      result = cells_.integrate(problem_.tree.polygon(swap ? source : outer),
                                problem_.tree.polygon(swap ? outer : source), bodies_, tolerance, flat());
    }
    // Patches that touch, with blockers in the gap: the cells give up before lines do.
    if (bodies_.size() > kMostClipped ||
        result.error_estimate > std::max(bearable, exchange.value / static_cast<double>(kMostLines))) {
      sampled_pairs_.assign(1, {outer, source, exchange.value, bearable});
      lines_->sample(sampled_pairs_, kFewestLines, kMostLines);
      const ShadowResult& sampled = sampled_pairs_[0].result;
      if (bodies_.size() > kMostClipped || sampled.error_estimate < result.error_estimate) result = sampled;
    }
    take_away(result, exchange, counts);
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
  bool sample_tile();
  double largest_share() const;
  void sample_pairs();
  const AssemblyProblem& problem_;
  const Progress& stop_;
  BlockerSearch search_;
  ShadowCells cells_;
  std::optional<LineSampler> lines_;
  std::vector<const ConvexBody*> bodies_;
  static constexpr char kFacing = 1, kUnsettled = 2;
  std::vector<char> facing_;  ///< of the tile's pairs: 0, kFacing, kUnsettled
  std::vector<Shadowed> shadowed_;
  std::vector<int> candidate_pool_;
  std::vector<std::uint32_t> others_;
  std::vector<int> columns_of_others_;
  std::vector<FormFactor> results_, row_results_;
  std::vector<SampledPair> sampled_pairs_;
  std::vector<FirstLine> first_lines_;
  std::vector<std::size_t> places_;
  std::vector<double> values_, squared_error_a_, squared_error_b_;
  int row_first_ = 0;
  int column_first_ = 0;
  int rows_ = 0;
  int columns_ = 0;
  bool any_ = false;
  double in_doubt_ = 0.0;  ///< share of every pair of a sampled tile that its lines left open
  bool sampled_ = false;   ///< rays decide about this tile's pairs
};

/// The black inside of an open sheet is behind its outside for most of a scene, but no single face hides it. It sends
/// nothing back, so lines are proof enough: if all of them are blocked the clusters are dropped, with one line in
/// doubt.
bool Descent::hidden_by_lines(int a, int b) {
  if (problem_.few_blockers()) return false;
  const Cluster& ca = cluster(a);
  const Cluster& cb = cluster(b);
  constexpr std::array<double, 2> kStep = {0.7548776662466927, 0.5698402909980532};
  double factor = 0.0;  // mean over the lines of the form factor from a member of a to all of b
  int lines = 0;
  for (int number = 0; number < 4 * kClusterLines && lines < kClusterLines;) {
    lines_->clear();
    constexpr int kTogether = 32;
    double areas = 0.0;
    for (int k = 0; k < kTogether; ++k, ++number) {
      const double x = (number + 0.5) * kStep[0];
      const double y = (number + 0.5) * kStep[1];
      const int i = element(ca.first + static_cast<int>((x - std::floor(x)) * ca.count));
      const int j = element(cb.first + static_cast<int>((y - std::floor(y)) * cb.count));
      if (lines_->add_line(i, j, number)) areas += problem_.elements.area_mm2[j];
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
  if (lines < kClusterLines) return false;
  count_blocked(a, b);
  const double in_doubt = std::min(1.0, factor / lines) / lines;
  for (int k = ca.first; k < ca.first + ca.count; ++k) row_errors.push_back({element(k), in_doubt * in_doubt});
  return true;
}

/// One line for every pair of the tile, before anything is computed. If they agree, all of the tile is clear or
/// blocked, with one line in doubt; not so where that would take too much of a row: its square may be a quarter of the
/// squared tolerance times the tile's share of the row. False if the tile is blocked; `sampled_` stays set if the pairs
/// must be looked at one by one.
bool Descent::sample_tile() {
  lines_->clear();
  first_lines_.assign(static_cast<std::size_t>(rows_ * columns_), {});
  places_.clear();
  for (int r = 0; r < rows_; ++r) {
    for (int c = 0; c < columns_; ++c) {
      const auto at = static_cast<std::size_t>(r * columns_ + c);
      if (facing_[at] == 0) continue;
      const int i = std::min(element(row_first_ + r), element(column_first_ + c));
      const int j = std::max(element(row_first_ + r), element(column_first_ + c));
      // Not all pairs share front sides along every line.
      int number = 0;
      bool found = false;
      for (; number < kFewestLines && !found; ++number) found = lines_->add_line(i, j, number);
      first_lines_[at].number = number - 1;
      if (!found) continue;
      first_lines_[at].weight = lines_->weight(lines_->size() - 1);
      places_.push_back(at);
    }
  }
  lines_->trace();
  std::size_t blocked = 0;
  for (std::size_t k = 0; k < places_.size(); ++k) {
    first_lines_[places_[k]].blocked = lines_->blocked(k);
    if (lines_->blocked(k)) ++blocked;
  }
  constexpr std::size_t kEnough = 64;
  if (lines_->size() < kEnough || (blocked != 0 && blocked != lines_->size())) return true;
  in_doubt_ = 1.0 / static_cast<double>(lines_->size());
  if (in_doubt_ * in_doubt_ * largest_share() > 0.25 * problem_.params.tolerance * problem_.params.tolerance) {
    in_doubt_ = 0.0;
    return true;
  }
  sampled_ = false;
  if (blocked == 0) return true;
  counts.blocked_pairs += static_cast<std::int64_t>(std::count(facing_.begin(), facing_.end(), kFacing));
  return false;
}

/// About the largest sum of form factors of a row or column over the tile, from the pairs' first lines.
double Descent::largest_share() const {
  std::vector<double> of_row(static_cast<std::size_t>(rows_), 0.0);
  std::vector<double> of_column(static_cast<std::size_t>(columns_), 0.0);
  for (int r = 0; r < rows_; ++r) {
    for (int c = 0; c < columns_; ++c) {
      const double weight = first_lines_[static_cast<std::size_t>(r * columns_ + c)].weight / std::numbers::pi;
      of_row[static_cast<std::size_t>(r)] += weight * problem_.elements.area_mm2[element(column_first_ + c)];
      of_column[static_cast<std::size_t>(c)] += weight * problem_.elements.area_mm2[element(row_first_ + r)];
    }
  }
  return std::max(*std::max_element(of_row.begin(), of_row.end()),
                  *std::max_element(of_column.begin(), of_column.end()));
}

/// All pairs of a tile whose lines disagree.
void Descent::sample_pairs() {
  if (!sampled_) return;
  sampled_pairs_.clear();
  for (int r = 0; r < rows_; ++r) {
    for (int c = 0; c < columns_; ++c) {
      const auto at = static_cast<std::size_t>(r * columns_ + c);
      if (facing_[at] == 0 || !(results_[at].value > 0.0)) continue;
      const int i = std::min(element(row_first_ + r), element(column_first_ + c));
      const int j = std::max(element(row_first_ + r), element(column_first_ + c));
      const double exchange = results_[at].value;
      const double bearable = settled_tolerance(i, j);
      SampledPair pair{i, j, exchange, bearable};
      pair.at = static_cast<int>(at);
      const FirstLine& line = first_lines_[at];
      pair.lines = line.number + 1;
      pair.whole = line.weight;
      pair.seen = line.blocked ? 0.0 : line.weight;
      sampled_pairs_.push_back(pair);
    }
  }
  lines_->sample(sampled_pairs_, kFewestLines, kFirstLines);
  for (const SampledPair& pair : sampled_pairs_) {
    const auto at = static_cast<std::size_t>(pair.at);
    if (pair.result.error_estimate <= pair.tolerance) {
      take_away(pair.result, results_[at], counts);
    } else {
      unsettled.push_back({pair, results_[at]});
      facing_[at] = kUnsettled;
    }
  }
}

/// Draws the lines that a task's unsettled pairs are allowed and writes their exchange areas.
void settle(const AssemblyProblem& problem, const Progress& stop, std::vector<UnsettledPair>& unsettled,
            TransportReport& counts, std::vector<Descent::RowError>& row_errors) {
  constexpr std::size_t kTogether = 1024;
  LineSampler lines(problem.elements, problem.tree, *problem.visibility);
  std::vector<SampledPair> pairs;
  for (std::size_t first = 0; first < unsettled.size(); first += kTogether) {
    stop.update("shadows", 0.0);
    const std::size_t end = std::min(first + kTogether, unsettled.size());
    pairs.clear();
    for (std::size_t k = first; k < end; ++k) pairs.push_back(unsettled[k].pair);
    lines.sample(pairs, 2 * kFirstLines, kMostLines);
    for (std::size_t k = first; k < end; ++k) {
      FormFactor exchange = unsettled[k].unoccluded;
      const SampledPair& pair = pairs[k - first];
      take_away(pair.result, exchange, counts);
      ++counts.pairs_by_method[static_cast<std::size_t>(exchange.method)];
      *unsettled[k].value = exchange.value;
      if (unsettled[k].mirror != nullptr) *unsettled[k].mirror = exchange.value;
      for (const int e : {pair.i, pair.j}) {
        const double error = exchange.error_estimate / problem.elements.area_mm2[e];
        row_errors.push_back({e, error * error});
      }
    }
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
  assembly.error_estimate = Eigen::VectorXd::Zero(n);
  assembly.report.elements = n;
  assembly.report.pairs = n * (n - 1) / 2;
  if (n == 0) return assembly;
  AssemblyProblem problem(elements, params);
  const std::vector<NodePair> tasks = make_tasks(problem);
  assembly.report.seconds_search = seconds_since(start);
  const auto factors_start = std::chrono::steady_clock::now();

  std::vector<TileMatrix::Chunk> chunks(tasks.size());
  std::vector<TransportReport> counts(tasks.size());
  std::vector<std::vector<Descent::RowError>> row_errors(tasks.size());
  std::vector<std::vector<UnsettledPair>> unsettled(tasks.size());
  std::atomic<std::size_t> done = 0;
  const Progress stop{.report = {}, .cancelled = progress.cancelled};
  tbb::parallel_for(std::size_t{0}, tasks.size(), [&](std::size_t t) {
    Descent descent(problem, stop);
    descent.run(tasks[t]);
    chunks[t] = std::move(descent.chunk);
    counts[t] = descent.counts;
    row_errors[t] = std::move(descent.row_errors);
    unsettled[t] = std::move(descent.unsettled);
    progress.update("form factors", static_cast<double>(++done) / static_cast<double>(tasks.size()));
  });
  const auto collect_errors = [&] {
    for (std::vector<Descent::RowError>& list : row_errors) {
      for (const auto& [element, squared] : list) assembly.error_estimate[element] += squared;
      list.clear();
    }
  };
  collect_errors();
  // The estimates are standard deviations; half of the squared tolerance keeps nearly all rows within it.
  const double allowed = 0.5 * params.tolerance * params.tolerance;
  share_budget(elements, (allowed - assembly.error_estimate.array()).max(0.25 * allowed).matrix(), unsettled);
  done = 0;
  tbb::parallel_for(std::size_t{0}, tasks.size(), [&](std::size_t t) {
    if (!unsettled[t].empty()) settle(problem, stop, unsettled[t], counts[t], row_errors[t]);
    progress.update("shadows", static_cast<double>(++done) / static_cast<double>(tasks.size()));
  });
  collect_errors();
  for (const TransportReport& count : counts) {
    assembly.report.facing_pairs += count.facing_pairs;
    assembly.report.partially_visible_pairs += count.partially_visible_pairs;
    assembly.report.blocked_pairs += count.blocked_pairs;
    for (std::size_t m = 0; m < count.pairs_by_method.size(); ++m)
      assembly.report.pairs_by_method[m] += count.pairs_by_method[m];
  }
  assembly.error_estimate = assembly.error_estimate.cwiseSqrt();
  assembly.exchange = TileMatrix(problem.tree.order(), std::move(problem.tile_first), std::move(chunks));
  assembly.report.seconds_factors = seconds_since(factors_start);
  return assembly;
}

}  // namespace interglow::radiosity
