// SPDX-License-Identifier: GPL-3.0-or-later
#include "cli/run_pipeline.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <ctime>
#include <numeric>
#include <utility>

#include "diagnostics/error.h"
#include "radiosity/direct_light.h"
#include "rendering/paper_images.h"

namespace interglow::cli {
namespace {

double wall_s() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }
double processor_s() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// Whether the direct light of any element is found through form factors.
bool needs_form_factors(const scene::Scene& scene) {
  return scene.sky || std::any_of(scene.objects.begin(), scene.objects.end(),
                                  [](const scene::Object& object) { return object.emits(); });
}

}  // namespace

StageTimes::Stopwatch::Stopwatch(StageTimes& all, std::string name)
    : times(all), stage(std::move(name)), wall_start_s(wall_s()), processor_start_s(processor_s()) {}

StageTimes::Stopwatch::~Stopwatch() {
  times.stages_.push_back({stage, wall_s() - wall_start_s, processor_s() - processor_start_s});
}

double StageTimes::total_wall_s() const {
  return std::accumulate(stages_.begin(), stages_.end(), 0.0,
                         [](double sum, const Stage& s) { return sum + s.wall_s; });
}

double StageTimes::total_processor_s() const {
  return std::accumulate(stages_.begin(), stages_.end(), 0.0,
                         [](double sum, const Stage& s) { return sum + s.processor_s; });
}

RunOutcome run_scene(const scene::SceneDescription& description, const Progress& progress) {
  RunOutcome outcome;
  StageTimes& times = outcome.times;
  outcome.built = times.measure("scene", [&] { return scene::build_scene(description, progress); });
  const scene::Scene& scene = outcome.built.scene;
  outcome.elements = times.measure("elements", [&] { return radiosity::make_elements(scene); });
  const radiosity::Elements& elements = outcome.elements;

  const scene::SolveDescription& solve = description.solve;
  const radiosity::TransportParams transport_params{.tolerance = solve.form_factor_tolerance,
                                                    .occlusion = solve.occlusion,
                                                    .smooth_closure = solve.smooth_closure,
                                                    .black_sides = scene.sky.has_value()};
  const auto transport = times.measure("form_factors", [&] {
    if (solve.bounces != 0 || needs_form_factors(scene))
      return radiosity::Transport::build(elements, transport_params, progress);
    // Light of beams that does not bounce travels between no two elements: as if all were black.
    radiosity::Elements black = elements;
    std::fill(black.material.begin(), black.material.end(), -1);
    return radiosity::Transport::build(black, transport_params, progress);
  });
  outcome.transport = transport.report();
  if (outcome.transport.error_estimate_max > solve.form_factor_tolerance) {
    outcome.built.warnings.push_back(fmt::format(
        "form_factor_tolerance: {:g} was not met everywhere: the estimated error of a row of form factors is "
        "{:.2g} at most.",
        solve.form_factor_tolerance, outcome.transport.error_estimate_max));
  }

  const auto direct = times.measure("direct_light", [&] {
    const auto terms = radiosity::direct_light(scene, elements, transport, progress);
    return radiosity::total(terms, elements.size(), scene.grid.size());
  });
  const radiosity::SolveParams solve_params{
      .bounces = solve.bounces, .tolerance = solve.tolerance, .max_iterations = solve.max_iterations};
  outcome.solution = times.measure("solve", [&] {
    return radiosity::solve(transport, scene.materials, elements.material, direct, solve_params, progress);
  });
  if (!outcome.solution.converged) {
    throw NumericalFailure(
        fmt::format("The solve did not converge: relative residual {:.2e} after {} iterations, wanted {:.2e}. Raise "
                    "solve.max_iterations or solve.tolerance.",
                    outcome.solution.relative_residual, outcome.solution.iterations, solve.tolerance));
  }
  outcome.balance = times.measure(
      "energy_balance", [&] { return radiosity::energy_balance(scene, elements, transport, outcome.solution); });
  outcome.error = times.measure("error_estimate", [&] {
    return radiosity::estimate_errors(scene, elements, transport, outcome.solution, progress);
  });

  const rendering::RenderParams render_params{.samples_per_side = description.render.samples_per_side,
                                              .gather_tolerance = description.render.gather_tolerance};
  outcome.images = times.measure(
      "render", [&] { return rendering::render(scene, elements, outcome.solution, render_params, progress); });
  times.measure("shading_terms", [&] {
    outcome.contact = rendering::contact_ratio(scene, elements, outcome.images, description.output.contact_region_mm);
    if (solve.model == scene::LightModel::kPaper) outcome.images = rendering::paper_images(scene, outcome.images);
  });
  return outcome;
}

}  // namespace interglow::cli
