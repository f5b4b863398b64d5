// SPDX-License-Identifier: GPL-3.0-or-later
/// How many lines the pairs of a scene get, so that its rows keep within their tolerance.
#pragma once

#include <span>
#include <vector>

#include "diagnostics/progress.h"
#include "radiosity/assembly_problem.h"
#include "radiosity/row_error.h"
#include "radiosity/sampled_tile.h"

namespace interglow::radiosity {

/// Draws the lines of tiles that have their pilots: a survey, a round of lines for all, and up to four more for the
/// rows whose estimates still exceed the tolerance, of fresh lines in place of the old ones.
///
/// Lines of the first round do not know what they weigh. Later rounds are for few rows: kept values, chosen for a low
/// estimate with a probability of P, are thereby moved by sqrt(1/P - 1) of their standard deviations or less.
///
/// @param tasks  tiles; each is worked on by one thread
/// @param rules  by element: errors of all that is not sampled
/// @return       by element: errors of everything
/// Same result for any number of threads.
std::vector<RowError> draw_lines(const AssemblyProblem& problem, std::span<std::vector<SampledTile>> tasks,
                                 const std::vector<RowError>& rules, const Progress& progress);

}  // namespace interglow::radiosity
