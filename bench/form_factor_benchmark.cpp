// SPDX-License-Identifier: GPL-3.0-or-later
// Unoccluded pairs a second: all facing pairs of the unit cube with n x n quads a face, one core. A sample of the
// values is compared with the contour integral at round-off before anything is timed; the largest error found is a
// counter, so that
//   form_factor_benchmark --benchmark_out=form_factors.json --benchmark_out_format=json
// gives the points of a plot of error against time.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "radiosity/form_factor_batch.h"
#include "tests/radiosity/form_factor_shapes.h"

namespace {

using namespace interglow::radiosity;

struct Cube {
  std::vector<Polygon> patches;
  FormFactorBatch batch;
  std::uint32_t face;  ///< patches a face
  explicit Cube(int n) : patches(test::cube(n, false)), batch(patches), face(static_cast<std::uint32_t>(n * n)) {}

  /// Patches of the faces before that of `i`: each facing pair once.
  std::vector<std::uint32_t> partners(std::uint32_t i) const {
    std::vector<std::uint32_t> list(i / face * face);
    for (std::uint32_t j = 0; j < list.size(); ++j) list[j] = j;
    return list;
  }
};

/// Largest error of F over every 97th patch against every 31st of its partners.
double largest_error(const Cube& cube, double tolerance) {
  double worst = 0;
  for (std::uint32_t i = cube.face; i < cube.batch.size(); i += 97) {
    const std::vector<std::uint32_t> partners = cube.partners(i);
    std::vector<FormFactor> results(partners.size());
    cube.batch.exchange_areas(i, partners, tolerance, results);
    for (std::size_t k = i % 31; k < partners.size(); k += 31) {
      const double exact = exchange_area(cube.patches[i], cube.patches[partners[k]], 0.0).value;
      worst = std::max(worst, std::abs(results[k].value - exact) / cube.batch.area(i));
    }
  }
  return worst;
}

/// Largest |row sum - 1|, every pair computed once for both of its rows.
double largest_row_error(const Cube& cube, double tolerance) {
  std::vector<double> row(cube.batch.size(), 0.0);
  std::vector<FormFactor> results(cube.batch.size());
  for (std::uint32_t i = 0; i < cube.batch.size(); ++i) {
    const std::vector<std::uint32_t> partners = cube.partners(i);
    cube.batch.exchange_areas(i, partners, tolerance, {results.data(), partners.size()});
    for (std::uint32_t j = 0; j < partners.size(); ++j) {
      row[i] += results[j].value;
      row[j] += results[j].value;
    }
  }
  double worst = 0;
  for (std::size_t i = 0; i < row.size(); ++i) worst = std::max(worst, std::abs(row[i] / cube.batch.area(i) - 1));
  return worst;
}

/// Arguments: patches per edge; tolerance 10^-second.
void batch_of_cube(benchmark::State& state) {
  const Cube cube(static_cast<int>(state.range(0)));
  const double tolerance = std::pow(10.0, -static_cast<double>(state.range(1)));
  const double error = largest_error(cube, tolerance);
  if (error > tolerance) return state.SkipWithError("an error is above the tolerance");
  std::vector<std::vector<std::uint32_t>> partners;
  for (std::uint32_t i = 0; i < cube.batch.size(); ++i) partners.push_back(cube.partners(i));
  std::vector<FormFactor> results(cube.batch.size());
  double pairs = 0, contour = 0;
  for (auto _ : state) {
    for (std::uint32_t i = 0; i < cube.batch.size(); ++i) {
      cube.batch.exchange_areas(i, partners[i], tolerance, {results.data(), partners[i].size()});
      pairs += static_cast<double>(partners[i].size());
      for (std::size_t k = 0; k < partners[i].size(); ++k)
        contour += results[k].method == FormFactorMethod::kContourQuadrature;
    }
    benchmark::DoNotOptimize(results.data());
  }
  state.SetLabel(cube.batch.instruction_set());
  state.counters["pairs/s"] = benchmark::Counter(pairs, benchmark::Counter::kIsRate);
  state.counters["contour_share"] = contour / pairs;
  state.counters["largest_error"] = error;
  state.counters["row_error"] = largest_row_error(cube, tolerance);
}
BENCHMARK(batch_of_cube)->ArgsProduct({{8, 16, 32}, {4, 6, 8, 10, 12, 14}})->Unit(benchmark::kMillisecond);
BENCHMARK(batch_of_cube)->Args({64, 4})->Args({64, 10})->Unit(benchmark::kMillisecond)->Iterations(1);

/// The contour integral alone, pair by pair, on every 7th patch of a cube with n = 8: what the choice of rules saves.
void contour_of_cube(benchmark::State& state) {
  const Cube cube(8);
  const double tolerance = std::pow(10.0, -static_cast<double>(state.range(0)));
  double pairs = 0, error = 0;
  for (std::uint32_t i = cube.face; i < cube.batch.size(); i += 41)
    for (std::uint32_t j : cube.partners(i))
      error = std::max(error, std::abs(exchange_area(cube.patches[i], cube.patches[j], tolerance / cube.face).value -
                                       exchange_area(cube.patches[i], cube.patches[j], 0.0).value) *
                                  cube.face);
  if (error > tolerance) return state.SkipWithError("an error is above the tolerance");
  for (auto _ : state)
    for (std::uint32_t i = cube.face; i < cube.batch.size(); i += 7)
      for (std::uint32_t j : cube.partners(i)) {
        benchmark::DoNotOptimize(exchange_area(cube.patches[i], cube.patches[j], tolerance / cube.face).value);
        ++pairs;
      }
  state.counters["pairs/s"] = benchmark::Counter(pairs, benchmark::Counter::kIsRate);
  state.counters["largest_error"] = error;
}
BENCHMARK(contour_of_cube)->DenseRange(4, 14, 2)->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
