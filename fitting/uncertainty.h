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
  /// A parameter, or a direction in their space, is not determined if its standard deviation is above this share of the
  /// plausible range (plausible_ranges): by default 1 degree for the light. In (0, 1].
  double weak_share = 0.1;
  bool profile = true;  ///< of w: six more pictures
  /// Models of the same scene with patches twice as wide (`coarser`) and again. What they change is extrapolated to
  /// patches of no width (Richardson), and the fit corrected by that. With the first alone the order is taken to be 2
  /// in the width and may be 1; without it the model is taken as exact.
  const ForwardModel* coarser = nullptr;
  const ForwardModel* coarsest = nullptr;
};

/// Turns twice as large, a quarter of the faces at most, and one halving less at contacts.
ForwardParams coarser(const ForwardParams& params);

/// One free shared parameter.
struct ParameterEstimate {
  int parameter = 0;
  std::string name;
  std::string unit;
  double value = 0.0;  ///< steps from the state for directions and turns: 0
  bool determined = true;
  /// Sandwich form; what the data leave open counts with the plausible range.
  double sd = 0.0;
  double model_sd = 0.0;                ///< if the weights were the whole truth
  double mesh_shift = 0.0;              ///< of the fit by the width of the patches; taken off `value`
  double mesh_sd = 0.0;                 ///< of mesh_shift; in sd
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
  /// The fit's, less what the width of the patches moved it by; gains and offsets are the fit's.
  FitState state;
  std::vector<ParameterEstimate> parameters;
  std::vector<WeakDirection> weak;
  /// What the scene itself leaves open, whatever the capture, and what the capture holds too little of.
  std::vector<std::string> notes;
  /// (H + B)⁻¹ (S + B) (H + B)⁻¹: H curvature, S covariance of the score (not below what the weights say), B the belief
  /// of one plausible range with which the fit began. Nothing is inverted that is singular, and what is not determined
  /// keeps the plausible range, with all that it makes uncertain.
  /// Plus what is uncertain of the shift that the width of the patches made.
  Eigen::MatrixXd covariance;
  Eigen::MatrixXd correlation;
  std::optional<WProfile> profile;
  /// The light mirrored about the plane of the normals, if the capture fits it nearly as well.
  std::optional<Eigen::Vector3d> twin_light;
  double twin_rise = 0.0;

  const ParameterEstimate* find(int parameter) const;
};

/// @param fit  at its optimum. Cost: an SVD, up to seven pictures, with coarser models one with all derivatives.
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
