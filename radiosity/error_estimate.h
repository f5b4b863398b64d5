// SPDX-License-Identifier: GPL-3.0-or-later
/// The errors that a run reports with its result.
#pragma once

#include "diagnostics/progress.h"
#include "radiosity/elements.h"
#include "radiosity/solution.h"
#include "radiosity/transport.h"
#include "scene/scene.h"

namespace interglow::radiosity {

/// Error of the radiosity of one component, relative to its area-weighted mean over all elements and bands.
struct ComponentError {
  double mean = 0.0;     ///< of the mean: what the means of the objects are off by, added without regard to sign
  double element = 0.0;  ///< RMS over the elements, and so about over the pixels
};

/// Errors of the radiosity of each component and of their sum, and some of what they are made of. Direct light (re, le)
/// is a mean over elements that is exact but for `faceting` and, of skies and emitting surfaces, the form factors.
struct ErrorEstimate {
  ComponentError total, re, rr, le, li, rl;
  ComponentError form_factors;  ///< part of rr, li, rl: row errors of the form factors, amplified by interreflection
  double residual = 0.0;        ///< part of rr, li, rl: residual of the solve, amplified by interreflection
  /// Mean share of area that flat faces lack against the surface whose normals they carry: error of irradiances per
  /// area, and of the light that a hollow face would send to itself.
  double faceting = 0.0;
  double assessed_share = 1.0;  ///< as in IrradianceError
};

/// Factor on the discretisation part of reported errors: near edges and contacts the order seen is below 2.
inline constexpr double kDiscretisationSafety = 2.0;

/// discretisation_error() times kDiscretisationSafety, the errors of form factors and the residual added.
/// Cost: that of discretisation_error().
ErrorEstimate estimate_errors(const scene::Scene& scene, const Elements& elements, const Transport& transport,
                              const Solution& solution, const Progress& progress = {});

}  // namespace interglow::radiosity
