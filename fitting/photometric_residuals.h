// SPDX-License-Identifier: GPL-3.0-or-later
/// Residuals of a capture against a model's picture: gains and offsets of the bands that fit best, the robust cost, and
/// residuals and derivatives compressed to triangles.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "fitting/compression.h"
#include "fitting/fit_data.h"
#include "fitting/fit_params.h"
#include "fitting/forward_model.h"

namespace interglow::fitting {

/// Sets the free ones of gain and offset, band by band, to those of least robust cost, which is convex in them: weights
/// and weighted least squares in turn until they move less than a thousandth of their standard deviation.
///
/// @return Σ ρ(residual) over all values, ρ(r) = r² up to h = huber_sigmas and h (2 |r| - h) beyond
/// Cost O(rounds × pixels × channels × bands), two rounds where nothing is robust. Same bits for any number of threads.
double fit_bands(const ForwardModel& model, const FitData& data, const Evaluation& evaluation, const FitParams& params,
                 FitState& state);

/// Residuals and derivatives at a state, compressed.
struct CompressedAt {
  CompressedBands all;  ///< columns own, shared, residual, right sides; rows times the root of the robust weights
  /// The same of the tiles of even and of odd number alone (a chequered pattern of tiles), shared parameters.
  std::vector<Eigen::MatrixXd> half_triangle;
  /// The middle of the sandwich: covariance of the shared parameters' score Σ Jᵀ r, from the scores of small squares
  /// (some 12 to 24 across the picture, 2 to 16 px wide) and of their neighbours with weights that fall to 0 at two
  /// squares' distance (Conley, Journal of Econometrics 92, 1999). Priors included. Holds for residuals that are larger
  /// than the noise or correlated over a square.
  Eigen::MatrixXd score_scatter;
  /// Independent squares that a variance so estimated is worth.
  double score_freedom = 0.0;
  double cost = 0.0;          ///< Σ ρ
  double chi_square = 0.0;    ///< mean squared residual
  double robust_share = 0.0;  ///< of residuals that count linearly
};

/// Tile by tile, band by band: sqrt(weight) / sigma × (own columns, gain × derivatives, residual, gain × right sides).
///
/// @param right_sides  pictures (pixels × channels, as Evaluation::channels) whose change of the residuals is appended
///                     after the residual column
/// Cost O(pixels × bands × columns²). Same bits for any number of threads.
CompressedAt compress(const ForwardModel& model, const FitData& data, const FitState& state,
                      const Evaluation& evaluation, const std::vector<int>& free, const FitParams& params,
                      const std::vector<radiosity::RowMatrix>& right_sides = {}, bool with_halves = false);

}  // namespace interglow::fitting
