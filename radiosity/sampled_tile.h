// SPDX-License-Identifier: GPL-3.0-or-later
/// Pairs that see one another past more blockers than are worth clipping: lines tell.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "radiosity/assembly_problem.h"
#include "radiosity/line_sampling.h"
#include "radiosity/row_error.h"
#include "radiosity/transport.h"

namespace interglow::radiosity {

/// What lines told of a pair.
struct SampledPair {
  float share = 0.0F;           ///< of the exchange that is visible
  float deviation = 0.0F;       ///< of the share from one line, expected
  float variance = 0.0F;        ///< of the share, as if lines were independent; 1 / LineSums::worth() if they agree
  float draws_variance = 0.0F;  ///< of the share, from the differences of the draws
  std::int32_t lines = 0;
  std::uint8_t draws = 0;
  std::uint8_t method = 0;  ///< FormFactorMethod of the unoccluded value
  bool agree = true;        ///< all lines
};

/// A tile of exchange areas, unoccluded until it is finished.
struct SampledTile {
  int row_first = 0;  ///< positions in the order of the tree
  int column_first = 0;
  int rows = 0;
  int columns = 0;
  double* values = nullptr;  ///< exchange areas [mm²]; on the diagonal each pair stands once until the end
  std::vector<SampledPair> pair;
};

/// What a row expects of its lines, as form factors.
struct RowSpread {
  int element;
  double deviation;  ///< Σ of the pairs' standard deviations from one line
  double squares;    ///< Σ of their squares
  double variance;  ///< Σ of their variances from the lines that were drawn, kOfLattice times that of independent ones
};

/// Lines in stages. A few a pair, the pilot, and more where many are wanted, the survey, only tell how many the pair
/// gets; those are drawn afresh and make the value, the unoccluded exchange area times the share of them that is seen.
/// No pair goes without: how many disagree among the pairs that agreed before is part of what is measured.
class TileSampler {
 public:
  static constexpr int kPilotLines = 4;
  /// Of a pair with more than a few lines.
  static constexpr int kManyDraws = 4;
  /// Variance of a lattice's lines over that which pilots expect of independent ones, about.
  static constexpr double kOfLattice = 0.25;

  /// Keeps a reference. @pre the problem has occlusion
  explicit TileSampler(const AssemblyProblem& problem)
      : problem_(problem), lines_(problem.elements, problem.tree, *problem.visibility) {}

  /// Draws the pilot of every pair with a value above 0.
  void draw_pilot(SampledTile& tile);

  /// Draws an eighth of n = σ max(lines_per_spread of both elements) lines of every pair that wants many, σ the
  /// exchange area's standard deviation from one line.
  ///
  /// @param lines_per_spread  by element [1/mm²]
  void draw_survey(SampledTile& tile, const Eigen::VectorXd& lines_per_spread);

  /// Draws n lines of every pair in place of those that it had, if those were fewer: the first time (round 0) of all.
  void draw(SampledTile& tile, const Eigen::VectorXd& lines_per_spread, int round);

  void find_spread(const SampledTile& tile, std::vector<RowSpread>& spread) const;

  /// Errors of the tile's rows and columns. Where lines agree throughout, half a line of all those of the tile stays in
  /// doubt.
  void find_errors(const SampledTile& tile, std::vector<RowError>& errors) const;

  /// Puts the visible exchange areas in place.
  /// @return false if nothing is seen by anybody
  static bool finish(SampledTile& tile, TransportReport& counts);

 private:
  struct Drawn {
    std::size_t at;
    int draws;
  };
  int element(int position) const { return problem_.element(position); }
  double wanted(const SampledTile& tile, std::size_t at, const Eigen::VectorXd& lines_per_spread) const;
  void add(const SampledTile& tile, std::size_t at, std::uint64_t draw, int draws, int lines);
  /// Traces what was added.
  void trace(SampledTile& tile);
  /// Deviations expected after pilot and survey, from a pair's lines and those of its row and column.
  static void find_deviations(SampledTile& tile);
  /// Share of a line that stays in doubt where all agree.
  static double share_in_doubt(const SampledTile& tile);

  const AssemblyProblem& problem_;
  LineSampler lines_;
  std::vector<Drawn> drawn_;
  std::vector<std::size_t> ends_;  ///< of the draws among the lines
};

}  // namespace interglow::radiosity
