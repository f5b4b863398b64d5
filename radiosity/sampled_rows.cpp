// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/sampled_rows.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <cmath>

namespace interglow::radiosity {
namespace {

/// Of what a row may be wrong by: the rest is for chance in the spread of lines, which is only guessed beforehand.
constexpr double kPlanned = 0.9;
/// Of that again the first round is planned with, so that few rows are drawn twice.
constexpr double kFirst = 0.8;
/// However much the rules may be wrong by, this share of the tolerance is left to lines.
constexpr double kLeastForLines = 0.25;
/// After the first.
constexpr int kRounds = 4;

class Rows {
 public:
  Rows(const AssemblyProblem& problem, std::span<std::vector<SampledTile>> tasks, const std::vector<RowError>& rules,
       const Progress& progress)
      : problem_(problem), tasks_(tasks), rules_(rules), progress_(progress), spread_(tasks.size()) {}

  /// Does something to every tile and collects the rows' spread.
  template <class Work>
  void of_tiles(Work work) {
    const Progress stop{.report = {}, .cancelled = progress_.cancelled};
    std::atomic<std::size_t> done = 0;
    tbb::parallel_for(
        std::size_t{0}, tasks_.size(),
        [&](std::size_t t) {
          spread_[t].clear();
          if (!tasks_[t].empty()) {
            TileSampler sampler(problem_);
            for (SampledTile& tile : tasks_[t]) {
              stop.update("shadows", 0.0);
              work(sampler, tile);
              sampler.find_spread(tile, spread_[t]);
            }
          }
          progress_.update("shadows", static_cast<double>(++done) / static_cast<double>(tasks_.size()));
        },
        tbb::simple_partitioner());
  }

  /// n lines leave σ / √n of a pair: for a given Σ σ² / n of a row Σ n is least where n is proportional to σ.
  Eigen::VectorXd first_plan() const {
    Eigen::VectorXd lines = sum_of(&RowSpread::deviation);
    const Eigen::VectorXd squares = sum_of(&RowSpread::squares);
    for (Eigen::Index e = 0; e < lines.size(); ++e) {
      if (!(squares[e] > 0.0)) continue;
      // Variances will be as these deviations are; draws less one for each.
      const double freedom = (TileSampler::kManyDraws - 1) * lines[e] * lines[e] / squares[e];
      const double allowed =
          kFirst * for_lines(e) /
          std::min(student(problem_.deviations, freedom), problem_.deviations / std::sqrt(TileSampler::kOfLattice));
      const double variance = rules_[static_cast<std::size_t>(e)].variance;
      lines[e] *= TileSampler::kOfLattice /
                  (problem_.elements.area_mm2[e] * std::max(0.25 * allowed * allowed, allowed * allowed - variance));
    }
    return lines;
  }

  /// For rows whose estimate exceeds the tolerance; 0 if more lines would not help.
  Eigen::VectorXd next_plan(const std::vector<RowError>& errors) const {
    Eigen::VectorXd lines = sum_of(&RowSpread::deviation);
    const Eigen::VectorXd variance = sum_of(&RowSpread::variance);
    for (Eigen::Index e = 0; e < lines.size(); ++e) {
      const double estimate = errors[static_cast<std::size_t>(e)].estimate(problem_.deviations);
      const double less = for_lines(e) / (estimate - rules_[static_cast<std::size_t>(e)].bound);
      if (estimate > problem_.params.tolerance && less < 1.0 && variance[e] > 0.0)
        lines[e] *= TileSampler::kOfLattice / (problem_.elements.area_mm2[e] * less * less * variance[e]);
      else
        lines[e] = 0.0;
    }
    return lines;
  }

  std::vector<RowError> errors() const {
    std::vector<std::vector<RowError>> of_tasks(tasks_.size());
    tbb::parallel_for(std::size_t{0}, tasks_.size(), [&](std::size_t t) {
      if (tasks_[t].empty()) return;
      const TileSampler sampler(problem_);
      for (const SampledTile& tile : tasks_[t]) sampler.find_errors(tile, of_tasks[t]);
    });
    std::vector<RowError> all = rules_;
    for (const std::vector<RowError>& list : of_tasks) {
      for (const RowError& error : list) all[static_cast<std::size_t>(error.element)] += error;
    }
    return all;
  }

 private:
  /// What the rules leave of a row's tolerance.
  double for_lines(Eigen::Index e) const {
    const double tolerance = problem_.params.tolerance;
    return std::max(kLeastForLines * tolerance, kPlanned * tolerance - rules_[static_cast<std::size_t>(e)].bound);
  }

  Eigen::VectorXd sum_of(double RowSpread::*which) const {
    Eigen::VectorXd sum = Eigen::VectorXd::Zero(problem_.elements.size());
    for (const std::vector<RowSpread>& list : spread_) {
      for (const RowSpread& row : list) sum[row.element] += row.*which;
    }
    return sum;
  }

  const AssemblyProblem& problem_;
  std::span<std::vector<SampledTile>> tasks_;
  const std::vector<RowError>& rules_;
  const Progress& progress_;
  std::vector<std::vector<RowSpread>> spread_;  ///< by task
};

}  // namespace

std::vector<RowError> draw_lines(const AssemblyProblem& problem, std::span<std::vector<SampledTile>> tasks,
                                 const std::vector<RowError>& rules, const Progress& progress) {
  if (std::all_of(tasks.begin(), tasks.end(), [](const auto& tiles) { return tiles.empty(); })) return rules;
  Rows rows(problem, tasks, rules, progress);
  rows.of_tiles([](TileSampler&, SampledTile&) {});
  Eigen::VectorXd plan = rows.first_plan();
  rows.of_tiles([&](TileSampler& sampler, SampledTile& tile) { sampler.draw_survey(tile, plan); });
  plan = rows.first_plan();
  for (int round = 0;; ++round) {
    rows.of_tiles([&](TileSampler& sampler, SampledTile& tile) { sampler.draw(tile, plan, round); });
    std::vector<RowError> errors = rows.errors();
    if (round == kRounds) return errors;
    plan = rows.next_plan(errors);
    if (!(plan.maxCoeff() > 0.0)) return errors;
  }
}

}  // namespace interglow::radiosity
