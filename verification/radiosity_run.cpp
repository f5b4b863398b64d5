// SPDX-License-Identifier: GPL-3.0-or-later
#include "verification/radiosity_run.h"

#include <fmt/format.h>

#include "diagnostics/error.h"
#include "radiosity/direct_light.h"
#include "radiosity/discretisation_error.h"
#include "radiosity/error_estimate.h"
#include "verification/check_scene.h"
#include "verification/stopwatch.h"

namespace interglow::verification {
namespace {

/// Sources as they would be on infinitely small patches, the estimated change taken kDiscretisationSafety times.
radiosity::Solution with_estimated_error(radiosity::Solution solution, const scene::Scene& scene,
                                         const radiosity::Elements& elements, const radiosity::Transport& transport,
                                         const Progress& progress) {
  const auto& materials = scene.materials;
  const auto& material = elements.material;
  const radiosity::IrradianceError error =
      radiosity::discretisation_error(elements, transport, materials, solution, progress);
  solution.reflected_source +=
      radiosity::kDiscretisationSafety * radiosity::reflect(error.reflected, materials, material);
  if (solution.luminescent_source.size() > 0 && error.luminescent.size() > 0) {
    solution.luminescent_source += radiosity::kDiscretisationSafety *
                                   (radiosity::reflect(error.luminescent, materials, material) +
                                    radiosity::luminesce(error.reflected + error.luminescent, materials, material));
  }
  return solution;
}

}  // namespace

RadiosityRun run_radiosity(const scene::Scene& scene, const RadiosityParams& params, const Progress& progress,
                           const std::function<bool(const RadiosityRun&)>& wants_estimate) {
  RadiosityRun run;
  run.patches = patch_count(scene);
  const Stopwatch transport_time;
  const radiosity::Elements elements = radiosity::make_elements(scene);
  const auto transport = radiosity::Transport::build(elements, params.transport, progress);
  run.transport = transport.report();
  run.seconds_transport = transport_time.seconds();

  const Stopwatch light_time;
  const auto lights = radiosity::direct_light(scene, elements, transport, progress);
  const auto direct = radiosity::total(lights, elements.size(), scene.grid.size());
  const auto solution = radiosity::solve(transport, scene.materials, elements.material, direct, params.solve, progress);
  if (!solution.converged) {
    throw NumericalFailure(
        fmt::format("The solve did not converge: relative residual {:.2e} after {} products, wanted {:.2e}. Raise "
                    "solve.max_iterations or solve.tolerance.",
                    solution.relative_residual, solution.iterations, params.solve.tolerance));
  }
  run.iterations = solution.iterations;
  run.relative_residual = solution.relative_residual;
  run.energy = radiosity::energy_balance(scene, elements, transport, solution);
  run.seconds_light = light_time.seconds();

  const Stopwatch render_time;
  run.images = rendering::render(scene, elements, solution, params.render, progress);
  run.seconds_render = render_time.seconds();
  if (!wants_estimate || !wants_estimate(run)) return run;
  const Stopwatch estimate_time;
  run.estimate =
      solution.reflected_source.size() > 0
          ? rendering::render(scene, elements, with_estimated_error(solution, scene, elements, transport, progress),
                              params.render, progress)
          : run.images;
  run.seconds_estimate = estimate_time.seconds();
  return run;
}

}  // namespace interglow::verification
