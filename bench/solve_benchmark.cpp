// SPDX-License-Identifier: GPL-3.0-or-later
// Time of the bispectral solve for N elements and 71 bands, all bounces, two fluorescent materials, one lamp: the
// spherical cap scene below has dense, smooth form factors, so that a product costs 2 N² operations a column. Counters:
// columns multiplied by F in all (bands × iterations would be multiplied by a solver that takes band by band), and the
// time of one product of the same block size.
#include <benchmark/benchmark.h>

#include <cmath>
#include <map>
#include <memory>
#include <stdexcept>

#include "radiosity/solution.h"

namespace {

using namespace interglow;
using radiosity::RowMatrix;
using Vector = Eigen::VectorXd;

constexpr Eigen::Index kBands = 71;

/// The inside of two thirds of a sphere in N equal patches, F_ij = 2 / 3 / N exactly, times a smooth symmetric
/// modulation that gives the exchange rank 9; two materials in alternation.
struct Case {
  radiosity::Transport transport;
  std::vector<spectral::Material> materials;
  std::vector<int> element_material;
  RowMatrix direct;
};

spectral::Material fluorescent(double edge_nm, double peak_nm) {
  spectral::Material material{"fluorescent", {Vector(kBands), Eigen::MatrixXd::Zero(kBands, kBands)}};
  for (Eigen::Index b = 0; b < kBands; ++b) {
    const double nm = 350.0 + 5.0 * static_cast<double>(b);
    material.donaldson.reflectance[b] = 0.05 + 0.8 / (1.0 + std::exp((edge_nm - nm) / 12.0));
    for (Eigen::Index m = 0; m < b; ++m) {
      const double from = 350.0 + 5.0 * static_cast<double>(m);
      // Not a product: the emission moves with the excitation by a tenth, as measured matrices do.
      const double shift = (nm - peak_nm - 0.1 * (from - 450.0)) / 20.0;
      material.donaldson.luminescence(b, m) =
          0.03 * std::exp(-shift * shift) / (1.0 + std::exp((from - edge_nm) / 8.0));
    }
  }
  return material;
}

const Case& smooth_case(Eigen::Index n) {
  static std::map<Eigen::Index, std::unique_ptr<Case>> cases;
  std::unique_ptr<Case>& entry = cases[n];
  if (entry) return *entry;
  Eigen::MatrixXd waves(n, 9);
  std::vector<int> element_material;
  for (Eigen::Index i = 0; i < n; ++i) {
    element_material.push_back(static_cast<int>(i % 2));
    for (Eigen::Index k = 0; k < 9; ++k)
      waves(i, k) =
          std::cos(3.14159265 * static_cast<double>(k) * (static_cast<double>(i) + 0.5) / static_cast<double>(n));
  }
  const Vector weight = Vector::LinSpaced(9, 0.0, 8.0).unaryExpr([](double k) { return std::pow(0.3, k); });
  Eigen::MatrixXd F = waves * weight.asDiagonal() * waves.transpose();
  F = (F + F.transpose()).eval() / (3.0 * static_cast<double>(n));
  entry = std::make_unique<Case>(Case{radiosity::Transport::from_form_factors(F.cwiseMax(0.0), Vector::Ones(n)),
                                      {fluorescent(560, 610), fluorescent(480, 530)},
                                      element_material,
                                      RowMatrix()});
  Vector lamp(kBands);
  for (Eigen::Index b = 0; b < kBands; ++b) lamp[b] = 1.0 + 0.5 * std::sin(0.2 * static_cast<double>(b));
  entry->direct = waves.col(1).cwiseAbs() * lamp.transpose();
  return *entry;
}

radiosity::Solution solved(const Case& scene, std::optional<int> bounces) {
  return radiosity::solve(scene.transport, scene.materials, scene.element_material, scene.direct, {.bounces = bounces});
}

/// |H - E - F D H| by one more product over all 71 bands.
void check(const Case& scene, const radiosity::Solution& solution) {
  const RowMatrix H = solution.direct + solution.reflected + solution.luminescent;
  const RowMatrix B = radiosity::reflect(H, scene.materials, scene.element_material) +
                      radiosity::luminesce(H, scene.materials, scene.element_material);
  const double error = (solution.direct + scene.transport.apply(B) - H).norm() / H.norm();
  if (!(error < 1e-9)) throw std::runtime_error("the solution does not satisfy its equation");
}

void all_bounces(benchmark::State& state) {
  const Case& scene = smooth_case(state.range(0));
  radiosity::Solution solution = solved(scene, {});
  check(scene, solution);
  for (auto _ : state) {
    solution = solved(scene, {});
    benchmark::DoNotOptimize(solution.reflected.data());
  }
  state.counters["products"] = solution.iterations;
  state.counters["columns"] = static_cast<double>(solution.columns);
  state.counters["residual"] = solution.relative_residual;
  state.SetComplexityN(state.range(0));
}

void one_bounce(benchmark::State& state) {
  const Case& scene = smooth_case(state.range(0));
  for (auto _ : state) benchmark::DoNotOptimize(solved(scene, 1).reflected.data());
  state.SetComplexityN(state.range(0));
}

/// What one iteration of a solver that takes all 71 bands costs at least.
void product_with_71_columns(benchmark::State& state) {
  const Case& scene = smooth_case(state.range(0));
  for (auto _ : state) benchmark::DoNotOptimize(scene.transport.apply(scene.direct).data());
  state.SetComplexityN(state.range(0));
}

}  // namespace

BENCHMARK(all_bounces)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->RangeMultiplier(2)
    ->Range(2048, 8192)
    ->Complexity();
BENCHMARK(one_bounce)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->RangeMultiplier(2)
    ->Range(2048, 8192)
    ->Complexity();
BENCHMARK(product_with_71_columns)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->RangeMultiplier(2)
    ->Range(2048, 8192)
    ->Complexity();
BENCHMARK_MAIN();
