// SPDX-License-Identifier: GPL-3.0-or-later
// Registration of 12-bit pictures of 256² with 4 DN of noise at an exactly known position: time, error, and from how
// many of 200 far starts it arrives (turn ±10°, scales ±10 %, shift ±20 px, gain 0.9, offset 40 DN).
#include <benchmark/benchmark.h>

#include <algorithm>
#include <random>
#include <vector>

#include "fitting/affine_registration.h"
#include "tests/fitting/registration_scenes.h"

namespace interglow::fitting {
namespace {

constexpr int kSize = 256;

/// Argument 0: number of starts; 1: reach in percent of the above ranges; 2: spots of texture on the cylinders, or
/// -1 for pictures that are all texture.
void register_far(benchmark::State& state) {
  std::vector<double> errors;
  for (auto _ : state) {
    std::mt19937 random(2026);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    errors.clear();
    const double reach = static_cast<double>(state.range(1)) / 100.0;
    for (unsigned trial = 0; trial < static_cast<unsigned>(state.range(0)); ++trial) {
      state.PauseTiming();
      const double turn = 10 * reach * uniform(random);
      const double sx = 1 + 0.1 * reach * uniform(random), sy = 1 + 0.1 * reach * uniform(random);
      const double tx = 20 * reach * uniform(random), ty = 20 * reach * uniform(random);
      const Affine truth = about_middle(kSize, turn, sx, sy, tx, ty);
      const bool texture = state.range(2) < 0;
      const Scene scene = texture ? texture_scene(kSize, 1000 + trial)
                                  : cylinders_scene(kSize, 1000 + trial, static_cast<int>(state.range(2)));
      const image::ScalarMap fixed = take_picture(scene, kSize, {}, 4.0, 2 * trial);
      const image::ScalarMap moving = take_picture(scene, kSize, inverse(truth), 4.0, 2 * trial + 1, 0.9, 40.0);
      state.ResumeTiming();
      const AffineRegistration found = register_affine(fixed, moving);
      errors.push_back(corner_rms_px(found.moving_from_fixed, truth, kSize, kSize));
    }
  }
  std::sort(errors.begin(), errors.end());
  const auto arrived = std::count_if(errors.begin(), errors.end(), [](double error) { return error < 0.05; });
  state.counters["arrived_share"] = static_cast<double>(arrived) / static_cast<double>(errors.size());
  state.counters["median_corner_rms_px"] = errors[errors.size() / 2];
  state.counters["p95_corner_rms_px"] = errors[errors.size() * 95 / 100];
  state.counters["largest_corner_rms_px"] = errors.back();
}
BENCHMARK(register_far)
    ->Args({200, 100, 40})
    ->Args({200, 100, 0})
    ->Args({20, 30, -1})
    ->Iterations(1)
    ->Unit(benchmark::kSecond);

}  // namespace
}  // namespace interglow::fitting

BENCHMARK_MAIN();
