// SPDX-License-Identifier: GPL-3.0-or-later
/// Which pairs of elements exchange light, and how much.
#pragma once

#include "diagnostics/progress.h"
#include "radiosity/elements.h"
#include "radiosity/tile_matrix.h"
#include "radiosity/transport.h"

namespace interglow::radiosity {

struct Assembly {
  TileMatrix exchange;             ///< A_i F_ij [mm²]
  TransportReport report;          ///< counts, methods, times; sums are left to the caller
  Eigen::VectorXd error_estimate;  ///< of each element's row of form factors (TransportReport::error_estimate_max)
};

/// Descends the tree of element clusters against itself. A pair of clusters is dropped as a whole when no member can
/// face the other's box, or when a convex blocker covers all lines between their boxes; the blockers that can reach
/// into the shaft between them are handed down and thinned out on the way. Pairs without blockers get the unoccluded
/// factor, others the visible share. Cost O(N log N + facing pairs); parallel over pairs of clusters, same bits for any
/// number of threads.
Assembly assemble(const Elements& elements, const TransportParams& params, const Progress& progress);

}  // namespace interglow::radiosity
