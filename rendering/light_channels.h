// SPDX-License-Identifier: GPL-3.0-or-later
/// The spectral dimensions of the light that a picture gathers.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "radiosity/elements.h"
#include "radiosity/solution.h"
#include "scene/scene.h"

namespace interglow::rendering {

/// A matrix of spectra as coefficients times few spectra: a = coefficient × spectrum.
struct Factors {
  radiosity::RowMatrix coefficient;  ///< rows x rank
  radiosity::RowMatrix spectrum;     ///< rank x bands, orthonormal rows
};

/// Truncated where what is left is below 1e-7 of the largest singular value. Cost O(rows × bands²).
Factors factorise(const radiosity::RowMatrix& a);

/// Columns of the gather, in this order: modes of the reflected source, modes of the luminescent source, one for each
/// emitting object (1 on its front), and, with a sky, one that is 1 everywhere (what hides the sky).
struct LightChannels {
  int reflected = 0;
  int luminescent = 0;
  std::vector<int> emitters;  ///< objects
  bool sky = false;
  radiosity::RowMatrix source;                                    ///< elements x channels
  radiosity::RowMatrix reflected_spectrum, luminescent_spectrum;  ///< modes x bands
  Eigen::VectorXd strength;      ///< of each element's sources: irradiance summed over the bands [W m^-2]
  Eigen::VectorXd weight;        ///< of each channel, the same for a unit of the channel
  double mean_irradiance = 0.0;  ///< of the lit surfaces (flux-weighted), summed over the bands [W m^-2]

  Eigen::Index size() const { return source.cols(); }
  int first_emitter() const { return reflected + luminescent; }
  int sky_channel() const { return first_emitter() + static_cast<int>(emitters.size()); }
};

LightChannels light_channels(const scene::Scene& scene, const radiosity::Elements& elements,
                             const radiosity::Solution& solution);

}  // namespace interglow::rendering
