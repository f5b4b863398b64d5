// SPDX-License-Identifier: GPL-3.0-or-later
#include "verification/radiosity_run.h"

#include <fmt/format.h>

#include "diagnostics/error.h"
#include "radiosity/direct_light.h"
#include "verification/check_scene.h"
#include "verification/stopwatch.h"

namespace interglow::verification {

RadiosityRun run_radiosity(const scene::Scene& scene, const RadiosityParams& params, const Progress& progress) {
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
  return run;
}

}  // namespace interglow::verification
