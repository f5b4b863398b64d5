// SPDX-License-Identifier: GPL-3.0-or-later
/// How sure a fit is, and what it does not know.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "diagnostics/progress.h"
#include "fitting/forward_model.h"
#include "fitting/scene_fit.h"

namespace interglow::fitting {

struct UncertaintyParams {
  /// A direction in the space of parameters is not determined if its standard deviation is above this share of the
  /// plausible ranges (light and turns 0.2 rad, distance and focal length 10 %, blur 1 px, w 0.5, …). In (0, 1].
  double weak_share = 0.1;
  bool profile = true;  ///< of w: six more pictures
};

/// One free shared parameter.
struct ParameterEstimate {
  int parameter = 0;
  std::string name;
  std::string unit;
  double value = 0.0;  ///< steps from the state for directions and turns: 0
  bool determined = true;
  double sd = 0.0;                      ///< sandwich form; meaningless unless determined
  double model_sd = 0.0;                ///< if the weights were the whole truth
  double half_difference_sigmas = 0.0;  ///< of the two chequered halves of the picture, in its standard deviation
};

/// A direction that the data leave open.
struct WeakDirection {
  std::string sentence;
  Eigen::VectorXd step;   ///< one a free parameter, in their units, one plausible range long
  double sd_share = 0.0;  ///< standard deviation over the plausible range; infinite: the data say nothing
};

/// Profile likelihood of w: cost with everything else refitted to first order, for given w.
struct WProfile {
  std::vector<double> w;
  std::vector<double> rise;  ///< of χ² over its smallest, divided by the sandwich's inflation
  double low = 0.0;          ///< 95 % interval: where the rise is 3.84
  double high = 0.0;
};

struct Uncertainty {
  std::vector<ParameterEstimate> parameters;
  std::vector<WeakDirection> weak;
  Eigen::MatrixXd covariance;  ///< sandwich, of the determined subspace
  Eigen::MatrixXd correlation;
  std::optional<WProfile> profile;
  /// The light mirrored about the plane of the normals, if the capture fits it nearly as well.
  std::optional<Eigen::Vector3d> twin_light;
  double twin_rise = 0.0;

  const ParameterEstimate* find(int parameter) const;
};

/// @param fit  at its optimum. Cost: an SVD, and up to seven pictures.
Uncertainty examine(const ForwardModel& model, const SceneFit& fit, const FitParams& fit_params,
                    const UncertaintyParams& params = {}, const Progress& progress = {});

/// Directions of the range-scaled space that triangle (and priors) determine to `weak_share`, as columns; their
/// singular values in `strength`.
struct Subspace {
  Eigen::MatrixXd strong;  ///< free x strong
  Eigen::VectorXd strength;
  Eigen::MatrixXd weak;  ///< free x weak
  Eigen::VectorXd weak_strength;
};
Subspace split_directions(const Eigen::MatrixXd& triangle, const Eigen::VectorXd& ranges, double least_strength);

}  // namespace interglow::fitting
