// SPDX-License-Identifier: GPL-3.0-or-later
// Time by part and peak memory of one joint fit with its uncertainty.
// The last line tells whether two runs, on other numbers of processors (taskset), have the same bits.
//   fit_benchmark [--side 512] [--bands 61] [--around 16] [--along 8]
//   fit_benchmark --scene SCENE --capture CAPTURE
#include <fmt/format.h>
#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <ctime>
#include <optional>
#include <random>
#include <string>

#include "fitting/capture_file.h"
#include "fitting/scene_fit.h"
#include "fitting/uncertainty.h"
#include "scene/scene_builder.h"
#include "tests/fitting/fit_scenes.h"

namespace {

using namespace interglow;

/// Prints what the last part took.
class Clock {
 public:
  void lap(const std::string& part) {
    const auto now = std::chrono::steady_clock::now();
    const double cpu = static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    fmt::print("{:24} {:7.1f} s  {:7.1f} s CPU  peak {:.2f} GB\n", part,
               std::chrono::duration<double>(now - begin_).count(), cpu - cpu_,
               static_cast<double>(usage.ru_maxrss) / (1024.0 * 1024.0));
    std::fflush(stdout);
    begin_ = now;
    cpu_ = cpu;
  }

 private:
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
  double cpu_ = 0.0;
};

struct Problem {
  scene::Scene scene;
  radiosity::TransportParams transport{};
  fitting::Capture capture;
  std::optional<fitting::FitState> start;  ///< empty: that of the scene
};

/// Half cylinders captured by a model with other, finer faces; 2 degrees and 2 % off.
Problem simulated(const test::FitSceneParams& scene) {
  Problem problem;
  problem.scene = test::half_cylinders(scene);
  test::FitSceneParams fine = scene;
  fine.around += 3;
  const fitting::ForwardModel model(test::half_cylinders(fine),
                                    {.mesh = fitting::FitMeshParams{.most_turn_deg = 2.5, .contact_halvings = 3}});
  fitting::FitState truth = model.initial_state();
  truth.blur_px = 0.8;
  truth.w = 1.2;
  truth.gain.setConstant(1e4);
  fitting::Capture& capture = problem.capture;
  capture.image = fitting::picture(model, truth, model.evaluate(truth, {}));
  capture.use.assign(static_cast<std::size_t>(scene.side_px) * static_cast<std::size_t>(scene.side_px), 1);
  capture.value_per_count.assign(static_cast<std::size_t>(scene.bands), 1.0F);
  capture.noise = {1.5, 0.25, 1.0, 0.0};
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  for (float& value : capture.image.value) {
    const double counts = static_cast<double>(value);
    value = static_cast<float>(std::round(counts + std::sqrt(2.25 + 0.25 * std::max(counts, 0.0)) * normal(random)));
  }
  Eigen::VectorXd step = Eigen::VectorXd::Zero(fitting::shared_count(model.scene()));
  step.segment<3>(fitting::kTurnX) << 0.02, -0.02, 0.02;
  step.segment<2>(fitting::kLightU) << 0.05, -0.04;
  step[fitting::kShiftZ] = 0.02 * truth.camera.pivot_in_camera.z();
  step[fitting::kW] = -0.2;
  problem.start = fitting::moved(truth, step);
  problem.start->blur_px = 0.0;
  problem.start->gain.setOnes();
  return problem;
}

Problem from_files(const std::string& scene, const std::string& capture) {
  const scene::SceneDescription description = scene::read_scene_file(scene);
  Problem problem;
  problem.scene = scene::build_scene(description).scene;
  problem.transport = {.tolerance = description.solve.form_factor_tolerance, .black_sides = false};
  problem.capture = fitting::read_capture(capture);
  return problem;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("One joint fit");
  test::FitSceneParams size{.around = 16, .along = 8, .bands = 61, .side_px = 512, .fluorescent = true};
  std::string scene_file;
  std::string capture_file;
  app.add_option("--side", size.side_px);
  app.add_option("--bands", size.bands);
  app.add_option("--around", size.around);
  app.add_option("--along", size.along);
  CLI::Option* of_scene = app.add_option("--scene", scene_file);
  app.add_option("--capture", capture_file)->needs(of_scene);
  CLI11_PARSE(app, argc, argv);

  Clock clock;
  const Problem problem = scene_file.empty() ? simulated(size) : from_files(scene_file, capture_file);
  clock.lap("capture");
  const fitting::ForwardParams forward{.transport = problem.transport};
  const fitting::ForwardModel model(problem.scene, forward);
  const fitting::ForwardModel coarse(problem.scene, fitting::coarser(forward));
  const fitting::ForwardModel coarsest(problem.scene, fitting::coarser(fitting::coarser(forward)));
  clock.lap("form factors");
  for (const fitting::ForwardModel* one : {&model, &coarse, &coarsest}) {
    fmt::print("  {} elements, {:.1f} million pairs that exchange light, {} modes\n", one->elements().size(),
               1e-6 * static_cast<double>(one->transport().report().stored_pairs), one->spectra().modes());
    std::fflush(stdout);
  }
  std::string part;
  const Progress progress{
      .report =
          [&](std::string_view stage, double) {
            if (stage == "light" || stage == "camera derivatives" || stage == "form factors of points" || stage == part)
              return;
            if (!part.empty()) clock.lap(part);
            part = stage;
          },
      .cancelled = {}};
  const fitting::FitParams params{.small_pictures = &coarse};
  const fitting::SceneFit fit =
      fitting::fit_scene(model, problem.capture, problem.start.value_or(model.initial_state()), params, progress);
  clock.lap(part);
  for (const fitting::FitStage& stage : fit.stages)
    fmt::print("  {} at {} px: {} iterations, {:.4g} to {:.4g}, {}\n", stage.name, stage.width, stage.iterations,
               stage.cost_before, stage.cost, stage.end);
  const fitting::Uncertainty found = fitting::examine(model, fit, params, {.coarser = &coarse, .coarsest = &coarsest});
  clock.lap("uncertainty");
  const fitting::ParameterEstimate& w = *found.find(fitting::kW);
  fmt::print("w {:.5f} ± {:.5f}, of which the patches' width took {:.5f} ± {:.5f}; χ² {:.4f}\n", w.value, w.sd,
             w.mesh_shift, w.mesh_sd, fit.chi_square);
  std::uint64_t bits = 0;
  for (const double value : found.covariance.reshaped())
    bits = (std::rotl(bits, 7) ^ std::bit_cast<std::uint64_t>(value)) * 0x9e3779b97f4a7c15u;
  for (const double value : {found.state.w, found.state.blur_px, found.state.gain.sum(), found.state.offset.sum()})
    bits = (std::rotl(bits, 7) ^ std::bit_cast<std::uint64_t>(value)) * 0x9e3779b97f4a7c15u;
  fmt::print("a number from all bits of the covariance and of w, blur, gains and offsets: {:016x}\n", bits);
}
