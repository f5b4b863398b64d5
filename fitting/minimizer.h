// SPDX-License-Identifier: GPL-3.0-or-later
/// Least squares over the shared parameters of a fit, by Ceres.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "diagnostics/progress.h"
#include "fitting/fit_params.h"
#include "fitting/forward_model.h"

namespace interglow::fitting {

/// A sum of squares at a state, compressed.
struct Linearisation {
  double cost = 0.0;  ///< Σ ρ of all residuals (data - prediction)
  /// Triangle of (derivatives of the prediction, residuals) with robust weights: free + 1 columns; 0 x 0 if derivatives
  /// were not asked for.
  Eigen::MatrixXd triangle;
};

/// Sets what else belongs to the state (gains and offsets). May throw InvalidParams for a state that cannot be, which
/// makes the step shorter.
using Linearise = std::function<Linearisation(FitState& state, bool with_derivatives)>;

/// How a stage of a fit ended.
struct FitStage {
  std::string name;
  int width = 0;
  int iterations = 0;
  double cost_before = 0.0;  ///< Σ ρ and priors over the number of residuals (1 if the noise explains them)
  double cost = 0.0;
  bool converged = false;
  std::string end;  ///< why it stopped
};

struct MinimizerParams {
  std::string name;         ///< of the stage
  int most_iterations = 1;  ///< steps tried; at least 1
  /// Relative fall of the cost that ends the search.
  double tolerance = 1e-9;
  /// Of the trust region: 1 / damping, relative to the columns' squares. Small ones creep along directions that are
  /// nearly alike (distance and focal length), large ones overshoot from afar.
  double first_radius = 1e3;
  double residuals = 1.0;  ///< number, for the stage's costs
  std::vector<Prior> priors{};
  /// Where light, pose, focal length and w are believed to be, each to one plausible range (plausible_ranges). Where
  /// the data determine a parameter to a tenth of its range, as is asked of those called determined, this moves it by
  /// less than a tenth of its standard deviation; a direction that they leave open stays where it was.
  std::optional<FitState> believed{};
};

/// Levenberg-Marquardt in Ceres. One residual block holds the triangle: cost, gradient and Gauss-Newton matrix are
/// those of all residuals, and one constant residual makes the cost exactly the robust one. The light is on a sphere,
/// the camera's turn on unit quaternions; blur, w, focal length and scales have bounds; priors are residual blocks.
///
/// @param free  whole groups of SharedParameter: both tilts of the light, all three turns, …
/// @throws Cancelled, and what `linearise` throws at the start
/// Deterministic: Ceres on one thread.
FitStage minimize(FitState& state, const std::vector<int>& free, const Linearise& linearise,
                  const MinimizerParams& params, const Progress& progress = {});

}  // namespace interglow::fitting
