// SPDX-License-Identifier: GPL-3.0-or-later
/// Reflection and luminescence of a diffuse material, bispectrally.
#pragma once

#include <Eigen/Core>
#include <string>

#include "diagnostics/error.h"
#include "spectral/wavelength_grid.h"

namespace interglow::spectral {

/// The Donaldson matrix as an operator on spectral irradiance, B = D H, on one grid for excitation and emission:
///
///     B(λ) = S(λ) H(λ) + Σ_μ D_L(λ, μ) H(μ)
///
/// Rows are emission, columns excitation (CIE and ASTM tables are the transpose; readers convert). D_L is the
/// bispectral luminescent radiance factor β_L,λ(μ) [1/nm] times the excitation band width Δμ, hence dimensionless; its
/// diagonal is 0 (same-band luminescence is part of S). Entries above the diagonal (μ > λ) are anti-Stokes.
struct DonaldsonMatrix {
  Eigen::VectorXd reflectance;   ///< S, one value a band, in [0, 1]
  Eigen::MatrixXd luminescence;  ///< D_L, bands x bands; 0 x 0 if the material does not luminesce

  bool luminesces() const { return luminescence.size() > 0; }
  Eigen::Index bands() const { return reflectance.size(); }
};

/// A named diffuse material.
struct Material {
  std::string name;
  DonaldsonMatrix donaldson;
};

/// What an excitation column emits: Σ_λ D(λ, μ) Δλ / Δμ, the radiated over the absorbed power of band μ, reflection
/// included; at most 1 for a passive material.
Eigen::VectorXd emitted_over_received(const DonaldsonMatrix& donaldson, const WavelengthGrid& grid);

/// Checks finite, S in [0, 1], sizes; returns warnings that name sample, column and excess where a noisy measurement
/// emits more energy than it receives, or has negative entries beyond rounding.
/// @throws InvalidInput for what cannot be used.
Warnings validate(const Material& material, const WavelengthGrid& grid);

}  // namespace interglow::spectral
