// SPDX-License-Identifier: GPL-3.0-or-later
// Time of the bispectral solve on two touching half-cylinders, 71 bands, two fluorescent materials, one oblique lamp,
// form factors by Transport::build (not timed). Counters: columns multiplied by F in all, to compare with 71 columns an
// iteration, the number of products, and the largest residual of a band. Every solution is checked against its equation
// first.
#include <benchmark/benchmark.h>

#include <cmath>
#include <map>
#include <memory>
#include <stdexcept>

#include "radiosity/direct_light.h"
#include "radiosity/elements.h"
#include "radiosity/solution.h"

namespace {

using namespace interglow;
using radiosity::RowMatrix;
using Vector = Eigen::VectorXd;

constexpr Eigen::Index kBands = 71;

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

/// Radius 20 mm, length 40 mm, axis at x = center, twice as many quads around as along.
mesh::PatchMesh half_cylinder(double center_mm, int along) {
  mesh::PatchMesh mesh;
  const int around = 2 * along;
  for (int a = 0; a <= around; ++a) {
    const double t = 3.14159265358979 * a / around;
    for (int k = 0; k <= along; ++k)
      mesh.points.emplace_back(center_mm - 20.0 * std::cos(t), 40.0 * k / along, 20.0 * std::sin(t));
  }
  for (int a = 0; a < around; ++a) {
    for (int k = 0; k < along; ++k) {
      const int at = a * (along + 1) + k;
      mesh.faces.push_back({at, at + along + 1, at + along + 2, at + 1});
    }
  }
  return mesh;
}

const Case& half_cylinders(int along) {
  static std::map<int, std::unique_ptr<Case>> cases;
  std::unique_ptr<Case>& entry = cases[along];
  if (entry) return *entry;
  scene::Scene scene;
  scene.grid = spectral::WavelengthGrid::uniform(350, 700, 5);
  scene.materials = {fluorescent(560, 610), fluorescent(480, 530)};
  for (int k = 0; k < 2; ++k) {
    scene::Object object;
    object.name = k == 0 ? "left" : "right";
    object.patches = half_cylinder(k == 0 ? -20.0 : 20.0, along);
    object.material = k;
    scene.objects.push_back(object);
  }
  Vector lamp(kBands);
  for (Eigen::Index b = 0; b < kBands; ++b) lamp[b] = 1.0 + 0.5 * std::sin(0.2 * static_cast<double>(b));
  const scene::DirectionalLight light{"lamp", Eigen::Vector3d(0.3, 0.1, -1.0).normalized(), lamp, 0.0};
  const radiosity::Elements elements = radiosity::make_elements(scene);
  const radiosity::LightTerm term = radiosity::directional_term(light, elements);
  entry = std::make_unique<Case>(Case{radiosity::Transport::build(elements, {.tolerance = 1e-3, .occlusion = false}), scene.materials,
                                      elements.material, radiosity::total({term}, elements.size(), kBands)});
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
  const Case& scene = half_cylinders(static_cast<int>(state.range(0)));
  radiosity::Solution solution = solved(scene, {});
  check(scene, solution);
  for (auto _ : state) {
    solution = solved(scene, {});
    benchmark::DoNotOptimize(solution.reflected.data());
  }
  state.counters["products"] = solution.iterations;
  state.counters["columns"] = static_cast<double>(solution.columns);
  state.counters["residual"] = solution.relative_residual;
  state.counters["fronts"] = static_cast<double>(scene.transport.size() / 2);
}

void one_bounce(benchmark::State& state) {
  const Case& scene = half_cylinders(static_cast<int>(state.range(0)));
  for (auto _ : state) benchmark::DoNotOptimize(solved(scene, 1).reflected.data());
  state.counters["fronts"] = static_cast<double>(scene.transport.size() / 2);
}

/// What one iteration of a solver that takes all 71 bands costs at least.
void product_with_71_columns(benchmark::State& state) {
  const Case& scene = half_cylinders(static_cast<int>(state.range(0)));
  for (auto _ : state) benchmark::DoNotOptimize(scene.transport.apply(scene.direct).data());
  state.counters["fronts"] = static_cast<double>(scene.transport.size() / 2);
}

}  // namespace

// 4 along² quads with two sides each: 2k to 16k fronts.
BENCHMARK(all_bounces)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->MeasureProcessCPUTime()
    ->Arg(22)
    ->Arg(32)
    ->Arg(45)
    ->Arg(64);
BENCHMARK(one_bounce)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->MeasureProcessCPUTime()
    ->Arg(22)
    ->Arg(32)
    ->Arg(45)
    ->Arg(64);
BENCHMARK(product_with_71_columns)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->MeasureProcessCPUTime()
    ->Arg(22)
    ->Arg(32)
    ->Arg(45)
    ->Arg(64);
BENCHMARK_MAIN();
