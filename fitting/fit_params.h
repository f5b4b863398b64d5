// SPDX-License-Identifier: GPL-3.0-or-later
/// What a fit moves, under which priors, and when it stops.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "fitting/forward_model.h"
#include "scene/scene.h"

namespace interglow::fitting {

struct FitParams {
  bool light = true;
  bool pose = true;
  bool focal = true;
  bool principal = false;
  bool distortion = false;
  bool blur = true;
  bool w = true;
  bool reflectance = false;  ///< scale of each material's Donaldson matrix, under the prior below
  bool gain = true;          ///< one a band
  bool offset = true;        ///< one a band
  /// Standard deviation of the prior on reflectance scales [1]; above 0.
  double reflectance_sigma = 0.02;
  /// What is added to each material's reflectance in all bands, under the prior below.
  bool reflectance_offset = false;
  /// Standard deviation of the prior on reflectance offsets [1]; above 0.
  double reflectance_offset_sigma = 0.02;
  double principal_sigma_px = 5.0;  ///< of the principal point about the start's; above 0
  double distortion_sigma = 0.1;    ///< of the radial term about 0; above 0
  /// Residuals beyond this many standard deviations count linearly (Huber). At least 1.
  double huber_sigmas = 4.0;
  /// Relative standard deviation of the model that is added to the noise: mesh, form factors and interpolation are
  /// not exact. In [0, 1].
  double model_sigma = 0.002;
  /// Begin with silhouettes and small pictures; off: start at full size, for starts that are near.
  bool staged = true;
  int most_iterations = 40;  ///< at full size; at least 1
  /// A model of the same scene with wider patches (`coarser`), for silhouettes and small pictures; unset: the model
  /// itself.
  const ForwardModel* small_pictures = nullptr;
};

void validate(const FitParams& params);  ///< Throws InvalidParams, naming field, value and range.

/// Shared parameters that are free, in the order of SharedParameter.
std::vector<int> free_parameters(const scene::Scene& scene, const FitParams& params);

/// A normal prior on one free parameter.
struct Prior {
  std::size_t free = 0;  ///< index into the free parameters
  double mean = 0.0;     ///< of the state's value
  double sigma = 1.0;
};

/// @param state  tells how many materials there are
/// @param like  the camera about whose principal point the prior stands
std::vector<Prior> priors(const FitState& state, const LensCamera& like, const std::vector<int>& free,
                          const FitParams& params);

/// Value in a state of a parameter that is a number: all but light tilts and turns, which give 0. Focal length: its
/// logarithm.
double value_of(const FitState& state, int parameter);

/// By how much a start may be off, in the parameters' units: light and turns 10 degrees, shifts 10 % of the distance,
/// focal length 10 %, principal point 5 % of the width, blur 1 px, w 0.5, distortion, scales and offsets of
/// reflectances 0.1.
Eigen::VectorXd plausible_ranges(const FitState& state, const std::vector<int>& free);

/// Rows of the priors for least squares at a state: (free + 1) columns, the last is the right side.
Eigen::MatrixXd prior_rows(const FitState& state, const LensCamera& like, const std::vector<int>& free,
                           const FitParams& params);

}  // namespace interglow::fitting
