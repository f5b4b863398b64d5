// SPDX-License-Identifier: GPL-3.0-or-later
/// Shares what error the rows of form factors may have among the pairs that lines have not settled yet.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "radiosity/elements.h"
#include "radiosity/form_factor.h"
#include "radiosity/line_sampling.h"

namespace interglow::radiosity {

/// A pair that a few lines leave in doubt, and where its exchange area goes.
struct UnsettledPair {
  SampledPair pair;
  FormFactor unoccluded;     ///< exchange area
  double* value = nullptr;   ///< in the tile
  double* mirror = nullptr;  ///< the same pair the other way round, in tiles on the diagonal
};

/// Sets the tolerance of every pair such that the squared errors of row i sum to at most `budget[i]`, with the fewest
/// lines: n lines leave σ / √n of a pair, so that Σ n is least, for a given Σ σ² / n, where every pair gets
/// e² = budget σ / Σ σ; of its two rows' shares a pair takes the smaller.
///
/// @param budget  by element: squared error of the sum of form factors that is left to these pairs
/// Sums in the order of the lists. Cost O(pairs).
void share_budget(const Elements& elements, const Eigen::VectorXd& budget, std::span<std::vector<UnsettledPair>> lists);

}  // namespace interglow::radiosity
