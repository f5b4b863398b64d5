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

/// A tile of exchange areas that are unoccluded at first, and what a few lines told of each.
struct SampledTile {
  int row_first = 0;  ///< positions in the order of the tree
  int column_first = 0;
  int rows = 0;
  int columns = 0;
  double* values = nullptr;  ///< exchange areas [mm²]; on the diagonal each pair stands once until it is settled
  std::vector<std::uint8_t> pilot;   ///< by pair: visible share, in steps of 1 / kPilotScale
  std::vector<std::uint8_t> method;  ///< by pair: FormFactorMethod of the unoccluded value
};

struct RowSpread {
  int element;
  double spread;
};

/// Two stages, so that the result has no bias. A few lines a pair, the pilot, only tell how many the pair gets; those
/// are drawn afresh and make the value, the unoccluded exchange area times the share of them that is seen. No pair goes
/// without: how many disagree among the pairs whose pilots agreed is part of what is measured.
class TileSampler {
 public:
  static constexpr int kPilotLines = 4;
  static constexpr int kPilotScale = 240;

  /// Keeps a reference. @pre the problem has occlusion
  explicit TileSampler(const AssemblyProblem& problem)
      : problem_(problem), lines_(problem.elements, problem.tree, *problem.visibility) {}

  /// Draws the pilot of every pair with a value above 0.
  void draw_pilot(SampledTile& tile);

  /// Appends by element the sum of its pairs' expected standard deviations from one line, as form factors.
  void find_spread(const SampledTile& tile, std::vector<RowSpread>& spread);

  /// Draws n = σ max(lines_per_spread of both elements) lines for every pair, in two halves, σ the exchange area's
  /// standard deviation from one line, and puts the visible exchange areas in place. Where lines agree throughout, half
  /// a line of all those of the tile stays in doubt.
  ///
  /// @param lines_per_spread  by element [1/mm²]
  /// @return false if nothing is seen by anybody
  bool settle(SampledTile& tile, const Eigen::VectorXd& lines_per_spread, std::vector<RowError>& errors,
              TransportReport& counts);

 private:
  struct Pair {
    int at;
    int i, j;                ///< elements, i < j
    std::size_t middle = 0;  ///< the two draws' ends among the lines
    std::size_t end = 0;
  };
  int element(int position) const { return problem_.element(position); }
  Pair pair_at(const SampledTile& tile, std::size_t at) const;
  /// By pair: standard deviation of the share from one line, from its own pilot and those of its row and column.
  void find_deviations(const SampledTile& tile);

  const AssemblyProblem& problem_;
  LineSampler lines_;
  std::vector<Pair> pairs_;
  std::vector<double> deviation_, row_share_, column_share_;
};

}  // namespace interglow::radiosity
