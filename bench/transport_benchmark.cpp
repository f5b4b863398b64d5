// SPDX-License-Identifier: GPL-3.0-or-later
// Time, memory and closure of Transport::build: a closed cube, a closed box with two turned cubes, with a lumpy solid
// and with a scanned bunny (examples/bunny_in_corner/fetch gets it), and two touching half cylinders;
// products with 1 and 71 columns; and rays of Visibility beside the raw rate of Embree on the same rays. Closed scenes
// must close within the tolerance and within the reported estimate, and estimates keep within the tolerance, before
// anything is timed. Counters: elements,
// error_estimate (largest of a row), pairs per second of processor time (all N (N - 1) / 2), closure_max, closure_rms,
// partial pairs, megabytes.
//   transport_benchmark --benchmark_out=transport.json --benchmark_out_format=json
#include <benchmark/benchmark.h>
#include <embree3/rtcore.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <optional>
#include <random>
#include <utility>
#include <vector>

#include "mesh/remesh.h"
#include "mesh/repair.h"
#include "mesh/scan_file.h"
#include "radiosity/transport.h"
#include "radiosity/visibility.h"
#include "tests/radiosity/scenes.h"

namespace {

using namespace interglow;
using Eigen::Vector3d;
using radiosity::Elements;
using radiosity::make_elements;
using radiosity::RowMatrix;
using radiosity::Transport;
using radiosity::testing::box_with_two_cubes;
using radiosity::testing::cube;
using radiosity::testing::lumpy_solid;
using radiosity::testing::lumpy_solid_in_box;
using radiosity::testing::object;

Elements closed_cube(int n) {
  scene::Scene scene;
  scene.objects.push_back(object("cube", cube(1.0, n, true)));
  return make_elements(scene);
}

/// Radius 20, length 50, touching at x = 0, fronts outside; 2n x n quads cut in two.
Elements half_cylinders(int n) {
  scene::Scene scene;
  for (const double centre : {-20.0, 20.0}) {
    mesh::PatchMesh mesh;
    for (int a = 0; a <= 2 * n; ++a) {
      const double t = 3.14159265358979323846 * a / (2 * n);
      for (int k = 0; k <= n; ++k)
        mesh.points.emplace_back(centre - 20.0 * std::cos(t), 50.0 * k / n, 20.0 * std::sin(t));
    }
    for (int a = 0; a < 2 * n; ++a) {
      for (int k = 0; k < n; ++k) {
        const int at = a * (n + 1) + k;
        mesh.faces.push_back({at, at + n + 1, at + n + 2, -1});
        mesh.faces.push_back({at, at + n + 2, at + 1, -1});
      }
    }
    mesh.closed = true;  // nobody sees the inside
    scene.objects.push_back(object(centre < 0 ? "left" : "right", std::move(mesh)));
  }
  return make_elements(scene);
}

/// The bunny remeshed to about `patches`, in the middle of a closed box of side 100. Empty without the scan, or if it
/// has holes.
std::optional<Elements> bunny_in_box(int n, int patches) {
  const std::filesystem::path scan = INTERGLOW_SOURCE_DIR "/examples/bunny_in_corner/scans/bunny00.off";
  if (!std::filesystem::exists(scan)) return std::nullopt;
  mesh::RemeshInput bunny;
  bunny.name = "bunny";
  bunny.scan = mesh::repair(mesh::read_scan(scan, {.mm_per_unit = 60.0}).mesh).mesh;
  bunny.params.patches = patches;
  mesh::PatchMesh surface = std::move(mesh::remesh({&bunny, 1})[0].patches);
  if (!surface.closed) return std::nullopt;
  Vector3d low = surface.points[0];
  Vector3d high = low;
  for (const Vector3d& p : surface.points) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  for (Vector3d& p : surface.points) p += Vector3d(50, 50, 50) - 0.5 * (low + high);
  scene::Scene scene;
  scene.objects.push_back(object("box", cube(100.0, n, true, Vector3d(50, 50, 50))));
  scene.objects.push_back(object("bunny", std::move(surface)));
  return make_elements(scene);
}

enum class Closed { kNo, kYes };

void build(benchmark::State& state, const Elements& elements, double tolerance, Closed closed) {
  const radiosity::TransportParams params{.tolerance = tolerance};
  {
    const Transport transport = Transport::build(elements, params);
    const radiosity::TransportReport& report = transport.report();
    if (closed == Closed::kYes && !(report.closure_max <= tolerance && report.closure_rms <= 0.5 * tolerance))
      state.SkipWithError("the closed scene does not close within the tolerance");
    if (closed == Closed::kYes && !(report.closure_max <= report.error_estimate_max))
      state.SkipWithError("the closed scene does not close within the reported estimate");
    if (!(report.error_estimate_max <= tolerance)) state.SkipWithError("the estimate exceeds the tolerance");
    if (closed == Closed::kNo && !(report.max_row_sum <= 1.0 + tolerance))
      state.SkipWithError("a row of form factors sums to more than 1");
    state.counters["closure_max"] = report.closure_max;
    state.counters["error_estimate"] = report.error_estimate_max;
    state.counters["closure_rms"] = report.closure_rms;
    state.counters["elements"] = static_cast<double>(report.elements);
    state.counters["partial"] = static_cast<double>(report.partially_visible_pairs);
    state.counters["megabytes"] = 1e-6 * static_cast<double>(report.bytes);
    state.counters["tolerance"] = tolerance;
  }
  const double pairs = 0.5 * static_cast<double>(elements.size()) * static_cast<double>(elements.size() - 1);
  for (auto _ : state) benchmark::DoNotOptimize(Transport::build(elements, params));
  state.counters["pairs_per_cpu_s"] = benchmark::Counter(pairs, benchmark::Counter::kIsIterationInvariantRate);
}

void BM_Cube(benchmark::State& state) {
  build(state, closed_cube(static_cast<int>(state.range(0))), 1e-4, Closed::kYes);
}
BENCHMARK(BM_Cube)->Arg(8)->Arg(16)->Arg(32)->Arg(64)->Iterations(1)->MeasureProcessCPUTime()->Unit(
    benchmark::kMillisecond);

void BM_BoxWithTwoCubes(benchmark::State& state) {
  build(state, make_elements(box_with_two_cubes(static_cast<int>(state.range(0)), static_cast<int>(state.range(1)))),
        std::pow(10.0, -static_cast<double>(state.range(2))), Closed::kYes);
}
BENCHMARK(BM_BoxWithTwoCubes)
    ->Args({11, 5, 4})
    ->Args({22, 10, 3})
    ->Args({22, 10, 4})
    ->Args({35, 16, 4})
    ->Args({48, 22, 4})
    ->Iterations(1)
    ->MeasureProcessCPUTime()
    ->Unit(benchmark::kMillisecond);

void BM_LumpySolidInBox(benchmark::State& state) {
  build(state, make_elements(lumpy_solid_in_box(static_cast<int>(state.range(0)), static_cast<int>(state.range(1)))),
        1e-3, Closed::kYes);
}
BENCHMARK(BM_LumpySolidInBox)
    ->Args({8, 8})
    ->Args({16, 12})
    ->Iterations(1)
    ->MeasureProcessCPUTime()
    ->Unit(benchmark::kMillisecond);

void BM_BunnyInBox(benchmark::State& state) {
  const auto elements = bunny_in_box(12, static_cast<int>(state.range(0)));
  if (!elements) return state.SkipWithError("no closed bunny: run examples/bunny_in_corner/fetch");
  build(state, *elements, std::pow(10.0, -static_cast<double>(state.range(1))), Closed::kYes);
}
BENCHMARK(BM_BunnyInBox)
    ->Args({1000, 3})
    ->Args({2000, 3})
    ->Args({4000, 3})
    ->Args({8000, 3})
    ->Iterations(1)
    ->MeasureProcessCPUTime()
    ->Unit(benchmark::kMillisecond);

void BM_HalfCylinders(benchmark::State& state) {
  build(state, half_cylinders(static_cast<int>(state.range(0))), std::pow(10.0, -static_cast<double>(state.range(1))),
        Closed::kNo);
}
BENCHMARK(BM_HalfCylinders)
    ->Args({16, 4})
    ->Args({32, 4})
    ->Args({45, 3})
    ->Args({45, 4})
    ->Args({64, 4})
    ->Iterations(1)
    ->MeasureProcessCPUTime()
    ->Unit(benchmark::kMillisecond);

void BM_Apply(benchmark::State& state) {
  const Elements elements = half_cylinders(45);
  const Transport transport = Transport::build(elements, {.tolerance = 1e-3});
  const RowMatrix x = RowMatrix::Ones(elements.size(), state.range(0));
  const RowMatrix y = transport.apply(x);
  if ((y.col(0) - transport.row_sums()).cwiseAbs().maxCoeff() > 1e-14)
    state.SkipWithError("the product differs from the row sums");
  for (auto _ : state) benchmark::DoNotOptimize(transport.apply(x));
  state.counters["GFLOP/s"] =
      benchmark::Counter(4e-9 * static_cast<double>(transport.report().stored_pairs * state.range(0)),
                         benchmark::Counter::kIsIterationInvariantRate);
}
BENCHMARK(BM_Apply)->Arg(1)->Arg(8)->Arg(71)->UseRealTime()->Unit(benchmark::kMillisecond);

/// Segments between random points of random faces: what sampling asks.
std::vector<radiosity::Segment> random_segments(const Elements& elements, int count) {
  std::mt19937_64 random(11);
  std::uniform_int_distribution<Eigen::Index> any(0, elements.size() - 1);
  std::vector<radiosity::Segment> segments;
  while (static_cast<int>(segments.size()) < count) {
    const Eigen::Index i = any(random);
    const Eigen::Index j = any(random);
    const Vector3d line = (elements.centroid.row(j) - elements.centroid.row(i)).transpose();
    if (elements.normal.row(i).dot(line) <= 0.0 || elements.normal.row(j).dot(line) >= 0.0) continue;
    segments.push_back({elements.centroid.row(i).transpose(), elements.centroid.row(j).transpose(),
                        elements.face[static_cast<std::size_t>(i)], elements.face[static_cast<std::size_t>(j)]});
  }
  return segments;
}

/// Embree alone: the same triangles and segments, packets of 16, no filter; ends pulled in by 1e-4 in place of
/// identity.
struct RawEmbree {
  RTCDevice device = rtcNewDevice(nullptr);
  RTCScene scene = rtcNewScene(device);
  explicit RawEmbree(const radiosity::Faces& faces) {
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                                 3 * sizeof(float), faces.points.size()));
    for (const Vector3d& p : faces.points) {
      for (int k = 0; k < 3; ++k) *vertices++ = static_cast<float>(p[k]);
    }
    auto* indices = static_cast<unsigned*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                                   3 * sizeof(unsigned), faces.corners.size()));
    for (const mesh::Face& f : faces.corners) {
      for (std::size_t k = 0; k < 3; ++k) *indices++ = static_cast<unsigned>(f[k]);
    }
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    rtcReleaseGeometry(geometry);
    rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
    rtcCommitScene(scene);
  }
  ~RawEmbree() {
    rtcReleaseScene(scene);
    rtcReleaseDevice(device);
  }
  RawEmbree(const RawEmbree&) = delete;
  RawEmbree& operator=(const RawEmbree&) = delete;

  int blocked(const std::vector<radiosity::Segment>& segments) const {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    alignas(64) std::array<int, 16> valid;
    valid.fill(-1);
    int count = 0;
    for (std::size_t first = 0; first + 16 <= segments.size(); first += 16) {
      alignas(64) RTCRay16 ray;
      for (unsigned lane = 0; lane < 16; ++lane) {
        const radiosity::Segment& segment = segments[first + lane];
        const Eigen::Vector3f from = segment.from.cast<float>();
        const Eigen::Vector3f line = (segment.to - segment.from).cast<float>();
        ray.org_x[lane] = from.x();
        ray.org_y[lane] = from.y();
        ray.org_z[lane] = from.z();
        ray.dir_x[lane] = line.x();
        ray.dir_y[lane] = line.y();
        ray.dir_z[lane] = line.z();
        ray.tnear[lane] = 1e-4F;
        ray.tfar[lane] = 1.0F - 1e-4F;
        ray.time[lane] = 0.0F;
        ray.mask[lane] = ~0U;
        ray.id[lane] = lane;
        ray.flags[lane] = 0;
      }
      rtcOccluded16(valid.data(), scene, &context, &ray);
      for (unsigned lane = 0; lane < 16; ++lane) count += ray.tfar[lane] < 0.0F ? 1 : 0;
    }
    return count;
  }
};

void BM_RaysBesideEmbree(benchmark::State& state) {
  scene::Scene scene;
  scene.objects.push_back(object("solid", lumpy_solid(static_cast<int>(state.range(0)))));
  mesh::PatchMesh box;
  const mesh::PatchMesh walls = cube(100.0, 16, true, Vector3d(50, 50, 50));
  box.points = walls.points;
  box.closed = true;
  for (const mesh::Face& f : walls.faces) {
    box.faces.push_back({f[0], f[1], f[2], -1});
    box.faces.push_back({f[0], f[2], f[3], -1});
  }
  scene.objects.push_back(object("box", std::move(box)));
  const Elements elements = make_elements(scene);
  const std::vector<radiosity::Segment> segments = random_segments(elements, 1 << 16);
  const radiosity::Visibility visibility(elements.faces);
  const RawEmbree raw(elements.faces);
  std::vector<char> result(segments.size());
  visibility.blocked(segments, result);
  const auto ours = std::count(result.begin(), result.end(), 1);
  const int theirs = raw.blocked(segments);
  // Grazing segments, whose ends were pulled in, may differ.
  if (std::abs(static_cast<double>(ours - theirs)) > 0.002 * static_cast<double>(segments.size()))
    state.SkipWithError("the rays disagree");
  const auto seconds = [] {
    timespec now{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
  };
  double ours_s = 0.0;
  double raw_s = 0.0;
  for (auto _ : state) {
    const double start = seconds();
    visibility.blocked(segments, result);
    const double middle = seconds();
    benchmark::DoNotOptimize(raw.blocked(segments));
    ours_s += middle - start;
    raw_s += seconds() - middle;
  }
  const double rays = static_cast<double>(segments.size()) * static_cast<double>(state.iterations());
  state.counters["Mrays/s"] = 1e-6 * rays / ours_s;
  state.counters["Embree_Mrays/s"] = 1e-6 * rays / raw_s;
  state.counters["ratio"] = raw_s / ours_s;
}
BENCHMARK(BM_RaysBesideEmbree)->Arg(16)->Arg(48)->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
