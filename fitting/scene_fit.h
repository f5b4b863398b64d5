// SPDX-License-Identifier: GPL-3.0-or-later
/// Fits light, camera, blur, w/w′ and photometry of a scene to a capture.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "diagnostics/progress.h"
#include "fitting/capture.h"
#include "fitting/compression.h"
#include "fitting/forward_model.h"

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
  double principal_sigma_px = 5.0;  ///< of the principal point about the middle; above 0
  double distortion_sigma = 0.1;    ///< of the radial term about 0; above 0
  /// Residuals beyond this many standard deviations count linearly (Huber). At least 1.
  double huber_sigmas = 4.0;
  /// Relative standard deviation of the model that is added to the noise: mesh, form factors and interpolation are
  /// not exact. In [0, 1].
  double model_sigma = 0.002;
  /// Begin with silhouettes and small pictures; off: start at full size, for starts that are near.
  bool staged = true;
  int most_iterations = 40;  ///< at full size; at least 1
};

void validate(const FitParams& params);  ///< Throws InvalidParams, naming field, value and range.

/// Shared parameters that are free, in the order of SharedParameter.
std::vector<int> free_parameters(const scene::Scene& scene, const FitParams& params);

/// How a stage ended.
struct FitStage {
  std::string name;
  int width = 0;
  int iterations = 0;
  double cost_before = 0.0;  ///< robust cost over residuals (1 if the noise explains them)
  double cost = 0.0;
  std::string end;  ///< why it stopped
};

/// Weighted residuals of one picture size, ready to be compressed.
struct FitData {
  image::SpectralImage image;
  std::vector<std::uint8_t> use;
  /// Standard deviation of each value (pixels × bands), as `image.value`.
  std::vector<float> sigma;
  std::size_t residuals = 0;
};

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
  /// The same of the tiles of even and of odd number alone (a chequered pattern of 16 × 16 pixels), shared parameters.
  std::vector<Eigen::MatrixXd> half_triangle;
  /// Σ over the tiles of score scoreᵀ of the shared parameters (the middle of the sandwich), priors included: holds for
  /// residuals that are correlated within a tile.
  Eigen::MatrixXd score_scatter;
};

/// Staged Levenberg-Marquardt: silhouettes; then small pictures with a wide lamp; then full size. In every step the
/// residuals are compressed tile by tile (TileQr); gains and offsets of the bands are eliminated exactly.
///
/// @param start  from ForwardModel::initial_state(); gains need not be known
/// @throws InvalidParams; InvalidInput if the capture does not fit the scene's camera and bands, or is dark
/// Same bits for any number of threads.
SceneFit fit_scene(const ForwardModel& model, const Capture& capture, const FitState& start, const FitParams& params,
                   const Progress& progress = {});

/// Compresses residuals and derivatives at a state, with further right sides: pictures (pixels × channels, as
/// Evaluation::channels) whose change of the residuals is appended after the residual column.
struct CompressedAt {
  CompressedBands all;
  std::vector<Eigen::MatrixXd> half_triangle;
  Eigen::MatrixXd score_scatter;
  double cost = 0.0;
  double chi_square = 0.0;
  double robust_share = 0.0;
};
CompressedAt compress(const ForwardModel& model, const FitData& data, const FitState& state,
                      const Evaluation& evaluation, const std::vector<int>& free, const FitParams& params,
                      const std::vector<radiosity::RowMatrix>& right_sides = {}, bool with_halves = false);

/// Weighted residuals' robust cost per residual; gains and offsets as in the state.
double robust_cost(const ForwardModel& model, const FitData& data, const FitState& state, const Evaluation& evaluation,
                   const FitParams& params);

/// Gains and offsets of the free ones that fit best, by weighted least squares band by band.
void fit_bands(const ForwardModel& model, const FitData& data, const Evaluation& evaluation, const FitParams& params,
               FitState& state);

/// Rows of priors on the shared parameters at a state: (free + 1) columns, the last is the right side.
Eigen::MatrixXd prior_rows(const FitState& state, const LensCamera& like, const std::vector<int>& free,
                           const FitParams& params);

}  // namespace interglow::fitting
