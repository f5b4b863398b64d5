// SPDX-License-Identifier: GPL-3.0-or-later
/// From spectra to tristimulus values.
#pragma once

#include <Eigen/Core>

#include "spectral/wavelength_grid.h"

namespace interglow::spectral {

/// Weights of each band in X, Y and Z: the mean of the colour-matching function over the band times the band width
/// [nm]. For values that are constant within a band, XYZ = weights^T values is the exact integral.
using TristimulusWeights = Eigen::Matrix<double, Eigen::Dynamic, 3>;

/// Of the CIE 1931 standard observer (2 degrees), from the shipped 1 nm table; 0 outside 360 to 830 nm.
/// @throws InvalidInput if the shipped tables are not found.
TristimulusWeights cie1931_weights(const WavelengthGrid& grid);

/// X, Y, Z of one value a band, in the unit of the values times nm (no factor of 683 lm/W).
inline Eigen::Vector3d tristimulus(const TristimulusWeights& weights, const Eigen::VectorXd& values) {
  return weights.transpose() * values;
}

/// k = 1 / Σ E ȳ Δλ: scaled by it, a surface that reflects all of the irradiance E has Y = 1 (its radiosity E, or its
/// radiance E/π times π).
/// @throws InvalidParams if the light has no luminance in these bands.
double reference_white_scale(const TristimulusWeights& weights, const Eigen::VectorXd& irradiance);

}  // namespace interglow::spectral
