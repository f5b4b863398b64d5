// SPDX-License-Identifier: GPL-3.0-or-later
/// Speed against error: from patches to pixels on the half-cylinders of another renderer (512 x 512 pixels, 61 bands,
/// all bounces).
///
/// Each row: patches to pixels in memory (elements, form factors, direct light, solve, picture with all components) at
/// a growing patch count and accuracy, the error against the reference image outside a 2-pixel band at silhouettes, and
/// the time in units of the raw rate of Embree's occlusion rays measured in the same run. Reading and writing files is
/// not counted.
#include <benchmark/benchmark.h>
#include <embree3/rtcore.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <array>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <limits>

#include "image/spectral_exr.h"
#include "radiosity/direct_light.h"
#include "radiosity/solution.h"
#include "radiosity/transport.h"
#include "rendering/render.h"
#include "tests/rendering/mitsuba_scene.h"

namespace {

using namespace interglow;
using Clock = std::chrono::steady_clock;

constexpr int kBands = 61;
const std::filesystem::path kFolder = std::filesystem::path(INTERGLOW_TEST_DATA) / "mitsuba" / "half_cylinders";

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

/// Occlusion rays per second of all cores, between points spread over the scene's own triangles, in packets of 16 that
/// share an origin.
double raw_ray_rate() {
  const scene::Scene scene = test::mitsuba_scene(kFolder, 1);
  RTCDevice device = rtcNewDevice(nullptr);
  RTCScene tree = rtcNewScene(device);
  std::vector<Eigen::Vector3f> points;
  std::vector<std::array<unsigned, 3>> triangles;
  for (const scene::Object& object : scene.objects) {
    const auto first = static_cast<unsigned>(points.size());
    for (const Eigen::Vector3d& p : object.patches.points) points.push_back(p.cast<float>());
    for (const mesh::Face& f : object.patches.faces) {
      triangles.push_back({first + static_cast<unsigned>(f[0]), first + static_cast<unsigned>(f[1]),
                           first + static_cast<unsigned>(f[2])});
    }
  }
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* vertices = static_cast<float*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, points.size()));
  for (std::size_t p = 0; p < points.size(); ++p) std::copy(points[p].data(), points[p].data() + 3, vertices + 3 * p);
  auto* indices = static_cast<unsigned*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, triangles.size()));
  for (std::size_t t = 0; t < triangles.size(); ++t)
    std::copy(triangles[t].begin(), triangles[t].end(), indices + 3 * t);
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(tree, geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(tree);

  constexpr std::size_t kPackets = 250000;
  const auto start = Clock::now();
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, kPackets, 1000),
                    [&](const tbb::blocked_range<std::size_t>& range) {
                      RTCIntersectContext context;
                      rtcInitIntersectContext(&context);
                      for (std::size_t k = range.begin(); k < range.end(); ++k) {
                        alignas(64) RTCRay16 rays;
                        alignas(64) std::array<int, 16> valid;
                        valid.fill(-1);
                        const Eigen::Vector3f& from = points[(k * 7919) % points.size()];
                        for (std::size_t lane = 0; lane < 16; ++lane) {
                          const Eigen::Vector3f along = points[(k * 104729 + lane * 33) % points.size()] - from;
                          rays.org_x[lane] = from.x();
                          rays.org_y[lane] = from.y();
                          rays.org_z[lane] = from.z();
                          rays.dir_x[lane] = along.x();
                          rays.dir_y[lane] = along.y();
                          rays.dir_z[lane] = along.z();
                          rays.tnear[lane] = 1e-4F;
                          rays.tfar[lane] = 1.0F - 1e-4F;
                          rays.time[lane] = 0.0F;
                          rays.mask[lane] = ~0U;
                          rays.id[lane] = 0;
                          rays.flags[lane] = 0;
                        }
                        rtcOccluded16(valid.data(), tree, &context, &rays);
                        benchmark::DoNotOptimize(rays);
                      }
                    });
  const double seconds = seconds_since(start);
  rtcReleaseScene(tree);
  rtcReleaseDevice(device);
  return 16.0 * kPackets / seconds;
}

/// Arguments: quads joined along the axis (32 / merge quads a facet), gather tolerance in units of 1e-4.
void patches_to_pixels(benchmark::State& state) {
  const scene::Scene scene = test::half_cylinder_strips(kFolder, kBands, static_cast<int>(state.range(0)), true);
  const double tolerance = 1e-4 * static_cast<double>(state.range(1));
  const image::SpectralImage reference = image::read_spectral_exr(kFolder / "ref_path.exr").image;
  static const double kRayRate = raw_ray_rate();

  double transport_seconds = 0.0;
  double solve_seconds = 0.0;
  double render_seconds = 0.0;
  double total_seconds = 0.0;
  Eigen::Index patches = 0;
  rendering::RenderedImages images;
  for (auto _ : state) {
    const auto start = Clock::now();
    const radiosity::Elements elements = radiosity::make_elements(scene);
    const radiosity::Transport transport = radiosity::Transport::build(elements, {.tolerance = 0.1 * tolerance});
    transport_seconds = seconds_since(start);
    const radiosity::RowMatrix direct =
        radiosity::total(radiosity::direct_light(scene, elements, transport), elements.size(), scene.grid.size());
    const radiosity::Solution solution =
        radiosity::solve(transport, scene.materials, elements.material, direct, {.tolerance = 0.1 * tolerance});
    solve_seconds = seconds_since(start) - transport_seconds;
    images = rendering::render(scene, elements, solution, {.gather_tolerance = tolerance});
    total_seconds = seconds_since(start);
    render_seconds = total_seconds - solve_seconds - transport_seconds;
    patches = elements.size();
  }
  const test::Difference difference =
      test::compare(images.total, reference, test::inside_silhouettes(images.object, 512, 512));
  state.counters["patches"] = static_cast<double>(patches);
  state.counters["rms_percent"] = 100.0 * difference.rms;
  state.counters["bias_percent"] = 100.0 * difference.bias;
  state.counters["s_transport"] = transport_seconds;
  state.counters["s_direct_solve"] = solve_seconds;
  state.counters["s_render"] = render_seconds;
  state.counters["gather_points"] = static_cast<double>(images.report.gather_points);
  state.counters["Mrays_per_s_raw"] = 1e-6 * kRayRate;
  state.counters["time_in_Mrays"] = 1e-6 * kRayRate * total_seconds;
}

BENCHMARK(patches_to_pixels)
    ->ArgNames({"merge", "tolerance_e4"})
    ->Args({32, 100})
    ->Args({16, 100})
    ->Args({8, 30})
    ->Args({8, 100})
    ->Args({4, 30})
    ->Args({2, 30})
    ->Args({1, 30})
    ->Args({1, 10})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

}  // namespace

BENCHMARK_MAIN();
