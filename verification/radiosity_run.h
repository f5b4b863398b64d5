// SPDX-License-Identifier: GPL-3.0-or-later
/// The deterministic side of a check: form factors, solution, picture, and what they cost.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>

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
  /// The same with sources changed by what infinitely small patches are estimated to change them by, times
  /// radiosity::kDiscretisationSafety: its difference from `images` bounds the discretisation error where no picture
  /// from other patches does.
  std::optional<rendering::RenderedImages> estimate;
  radiosity::TransportReport transport;
  radiosity::EnergyBalance energy;
  std::size_t patches = 0;
  int iterations = 0;
  double relative_residual = 0.0;
  double seconds_transport = 0.0;
  double seconds_light = 0.0;  ///< direct light and solve
  double seconds_render = 0.0;
  double seconds_estimate = 0.0;  ///< not in seconds()

  double seconds() const { return seconds_transport + seconds_light + seconds_render; }
};

/// @param wants_estimate  asked when all else is done; empty: no estimate
/// @throws NumericalFailure if the solve did not converge, and whatever the steps throw
RadiosityRun run_radiosity(const scene::Scene& scene, const RadiosityParams& params, const Progress& progress = {},
                           const std::function<bool(const RadiosityRun&)>& wants_estimate = {});

}  // namespace interglow::verification
