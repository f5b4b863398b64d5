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

/// A direction along which light travels, and its share of the light. It includes 1 / cos of the angle to the axis, so
/// that a surface facing the axis receives 1.
struct BeamDirection {
  Eigen::Vector3d direction;
  double weight;
};

/// Directions that stand for a uniform disk about an axis: 4 rings at the Gauss-Legendre nodes of r² times 8 directions,
/// turned from ring to ring; exact for polynomials up to degree 7 across the disk. The axis alone for half_angle_rad 0.
std::vector<BeamDirection> disk_directions(const Eigen::Vector3d& axis, double half_angle_rad);

/// 8 directions on one ring at r² = 1/2: exact for polynomials up to degree 3 across the disk.
std::vector<BeamDirection> ring_directions(const Eigen::Vector3d& axis, double half_angle_rad);

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
