// SPDX-License-Identifier: GPL-3.0-or-later
// Time by part and peak memory of one joint fit with its uncertainty.
//   fit_benchmark [--side 512] [--bands 61] [--around 16] [--along 8]
#include <fmt/format.h>
#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <random>

#include "fitting/scene_fit.h"
#include "fitting/uncertainty.h"
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

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("One joint fit");
  test::FitSceneParams scene{.around = 16, .along = 8, .bands = 61, .side_px = 512, .fluorescent = true};
  app.add_option("--side", scene.side_px);
  app.add_option("--bands", scene.bands);
  app.add_option("--around", scene.around);
  app.add_option("--along", scene.along);
  CLI11_PARSE(app, argc, argv);

  Clock clock;
  fitting::Capture capture;
  fitting::FitState truth;
  {
    test::FitSceneParams fine = scene;
    fine.around += 3;
    const fitting::ForwardModel model(test::half_cylinders(fine),
                                      {.mesh = fitting::FitMeshParams{.most_turn_deg = 2.5, .contact_halvings = 3}});
    truth = model.initial_state();
    truth.blur_px = 0.8;
    truth.w = 1.2;
    truth.gain.setConstant(1e4);
    capture.image = fitting::picture(model, truth, model.evaluate(truth, {}));
  }
  capture.use.assign(static_cast<std::size_t>(scene.side_px) * static_cast<std::size_t>(scene.side_px), 1);
  capture.value_per_count.assign(static_cast<std::size_t>(scene.bands), 1.0F);
  capture.noise = {1.5, 0.25, 1.0, 0.0};
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  for (float& value : capture.image.value) {
    const double counts = static_cast<double>(value);
    value = static_cast<float>(std::round(counts + std::sqrt(2.25 + 0.25 * std::max(counts, 0.0)) * normal(random)));
  }
  clock.lap("capture");

  const fitting::ForwardModel model(test::half_cylinders(scene), {});
  clock.lap("form factors");
  Eigen::VectorXd step = Eigen::VectorXd::Zero(fitting::shared_count(model.scene()));
  step.segment<3>(fitting::kTurnX) << 0.02, -0.02, 0.02;
  step.segment<2>(fitting::kLightU) << 0.05, -0.04;
  step[fitting::kShiftZ] = 0.02 * truth.camera.pivot_in_camera.z();
  step[fitting::kW] = -0.2;
  fitting::FitState start = fitting::moved(truth, step);
  start.blur_px = 0.0;
  start.gain.setOnes();
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
  const fitting::FitParams params;
  const fitting::SceneFit fit = fitting::fit_scene(model, capture, start, params, progress);
  clock.lap(part);
  for (const fitting::FitStage& stage : fit.stages)
    fmt::print("  {} at {} px: {} iterations, {:.4g} to {:.4g}, {}\n", stage.name, stage.width, stage.iterations,
               stage.cost_before, stage.cost, stage.end);
  const fitting::ForwardModel coarse(test::half_cylinders(scene), fitting::coarser({}));
  const fitting::Uncertainty found = fitting::examine(model, fit, params, {.coarser = &coarse});
  clock.lap("uncertainty");
  fmt::print("w {:.5f} ± {:.5f} (truth {:.5f}), χ² {:.4f}\n", fit.state.w, found.find(fitting::kW)->sd, truth.w,
             fit.chi_square);
}
