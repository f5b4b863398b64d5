// SPDX-License-Identifier: GPL-3.0-or-later
/// The few spectra that interreflected light is made of, and the materials as small matrices on them.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "radiosity/transport.h"
#include "scene/scene.h"

namespace interglow::fitting {

/// Indirect irradiance as coefficients times `spectrum`. Every bounce multiplies a spectrum by the Donaldson matrix of
/// some material, so all bounces of a lamp's light lie in the span of the products of these matrices with the lamp's
/// spectrum, whose singular values fall fast. What the lamp's spectrum and its first reflections lose is smaller by
/// 100, as most of the picture is made of them. A reflectance that is higher by the same in all bands adds nothing to
/// the span.
struct SpectralReduction {
  radiosity::RowMatrix spectrum;  ///< modes x bands of the grid, orthonormal rows
  Eigen::RowVectorXd light;       ///< the lamp's spectrum per unit of direct irradiance factor, as modes
  /// Per material: what leaves it per unit of direct irradiance factor (1 x modes), and per unit of each mode that
  /// arrives (modes x modes), as modes.
  std::vector<Eigen::RowVectorXd> from_direct;
  std::vector<Eigen::MatrixXd> from_indirect;
  /// Radiance in the camera's bands per unit of each mode that leaves a surface: modes x camera bands.
  radiosity::RowMatrix palette;
  Eigen::VectorXd wavelength_nm;  ///< of the camera's bands

  Eigen::Index modes() const { return spectrum.rows(); }
  Eigen::Index bands() const { return wavelength_nm.size(); }
};

/// @param light      spectrum of the only light, on the scene's grid
/// @param tolerance  what is left out of a bounce, relative to the largest spectrum of one bounce
/// Cost O(bounces × materials × modes × bands²).
SpectralReduction reduce_spectra(const scene::Scene& scene, const Eigen::VectorXd& light, double tolerance);

}  // namespace interglow::fitting
