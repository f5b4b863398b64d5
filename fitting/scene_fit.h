// SPDX-License-Identifier: GPL-3.0-or-later
/// Fits light, camera, blur, w/w′ and photometry of a scene to a capture.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "diagnostics/progress.h"
#include "fitting/capture.h"
#include "fitting/compression.h"
#include "fitting/fit_data.h"
#include "fitting/fit_params.h"
#include "fitting/forward_model.h"
#include "fitting/minimizer.h"

namespace interglow::fitting {

struct SceneFit {
  FitState state;
  std::vector<int> free;  ///< shared parameters
  std::vector<FitStage> stages;
  bool converged = false;
  double cost = 0.0;          ///< robust cost at the end, over residuals
  double chi_square = 0.0;    ///< mean squared weighted residual
  double robust_share = 0.0;  ///< share of residuals that count linearly
  std::size_t residuals = 0;
  bool noise_known = true;     ///< otherwise the weights come from the scatter of the residuals
  FitData data;                ///< at full size
  CompressedBands compressed;  ///< at the end, right side: residuals; robust weights included
  /// CompressedAt's, at the end.
  std::vector<Eigen::MatrixXd> half_triangle;
  Eigen::MatrixXd score_scatter;
  double score_freedom = 0.0;
};

/// Silhouettes; then small pictures, at first with a wide lamp; then full size (minimizer.h). In every step the
/// residuals are compressed tile by tile (photometric_residuals.h); gains and offsets of the bands are eliminated
/// exactly.
///
/// @param start  from ForwardModel::initial_state(); gains need not be known
/// @throws InvalidParams; InvalidInput if the capture does not fit the scene's camera and bands, or is dark; Cancelled
/// Same bits for any number of threads.
SceneFit fit_scene(const ForwardModel& model, const Capture& capture, const FitState& start, const FitParams& params,
                   const Progress& progress = {});

}  // namespace interglow::fitting
