// SPDX-License-Identifier: GPL-3.0-or-later
/// The deterministic side of a check: form factors, solution, picture, and what they cost.
#pragma once

#include <cstddef>

#include "diagnostics/progress.h"
#include "radiosity/solution.h"
#include "radiosity/transport.h"
#include "rendering/render.h"
#include "scene/scene.h"

namespace interglow::verification {

struct RadiosityParams {
  radiosity::TransportParams transport;
  radiosity::SolveParams solve;
  rendering::RenderParams render;
};

struct RadiosityRun {
  rendering::RenderedImages images;
  radiosity::TransportReport transport;
  radiosity::EnergyBalance energy;
  std::size_t patches = 0;
  int iterations = 0;
  double relative_residual = 0.0;
  double seconds_transport = 0.0;
  double seconds_light = 0.0;  ///< direct light and solve
  double seconds_render = 0.0;

  double seconds() const { return seconds_transport + seconds_light + seconds_render; }
};

/// @throws NumericalFailure if the solve did not converge, and whatever the steps throw
RadiosityRun run_radiosity(const scene::Scene& scene, const RadiosityParams& params, const Progress& progress = {});

}  // namespace interglow::verification
