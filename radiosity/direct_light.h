// SPDX-License-Identifier: GPL-3.0-or-later
/// Irradiance straight from the light sources.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "diagnostics/progress.h"
#include "radiosity/elements.h"
#include "radiosity/transport.h"
#include "scene/scene.h"

namespace interglow::radiosity {

/// One light: E⁰(i, λ) = geometric_factor(i) spectrum(λ). Spectrally every light of a scene is rank one, which the
/// solver uses.
struct LightTerm {
  std::string name;
  Eigen::VectorXd
      geometric_factor;      ///< one value an element: mean visible cosine (beam), sky share, or ΣF to the emitter
  Eigen::VectorXd spectrum;  ///< normal irradiance, π × radiance, or exitance [W m^-2 nm^-1]
};

/// Mean over each element of cosθ times the visible share of the beam: the lit part of the element is found exactly, in
/// double precision, by cutting the shadows of what lies nearer to the light out of it. A light with a half-angle is
/// the mean over 32 directions spread over its disk; the share of the disk seen from a penumbra is then resolved to a
/// thirty-second at a point, and better in the mean over an element. @throws InvalidParams if the direction is not a
/// unit vector Cost O(elements log elements + pieces that shadows cut elements into × their blockers), for each
/// direction.
LightTerm directional_term(const scene::DirectionalLight& light, const Elements& elements,
                           const Progress& progress = {});

/// All lights of the scene: beams, sky (1 - Σ_j F_ij), and emitting surfaces (F M).
std::vector<LightTerm> direct_light(const scene::Scene& scene, const Elements& elements, const Transport& transport,
                                    const Progress& progress = {});

/// Σ_k geometric_factor_k spectrum_kᵀ, elements x bands.
RowMatrix total(const std::vector<LightTerm>& terms, Eigen::Index elements, Eigen::Index bands);

}  // namespace interglow::radiosity
