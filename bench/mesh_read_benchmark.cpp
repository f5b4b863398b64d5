// SPDX-License-Identifier: GPL-3.0-or-later
// Reading and repairing scans: a wavy sheet of n x n points, bytes in memory, MB/s by format; repair in triangles/s.
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <stdexcept>
#include <string>

#include "mesh/repair.h"
#include "mesh/scan_file.h"

namespace {

using namespace interglow::mesh;

TriangleMesh sheet(int n) {
  TriangleMesh mesh;
  for (int y = 0; y < n; ++y) {
    for (int x = 0; x < n; ++x) mesh.points.emplace_back(0.5 * x, 0.5 * y, std::sin(0.05 * x) * std::cos(0.07 * y));
  }
  for (int y = 0; y + 1 < n; ++y) {
    for (int x = 0; x + 1 < n; ++x) {
      const int i = y * n + x;
      mesh.triangles.push_back({i, i + 1, i + n + 1});
      mesh.triangles.push_back({i, i + n + 1, i + n});
    }
  }
  return mesh;
}

template <class T>
void append(std::string& bytes, T value) {
  const auto raw = std::bit_cast<std::array<char, sizeof(T)>>(value);
  bytes.append(raw.data(), raw.size());
}

std::string obj(const TriangleMesh& mesh) {
  std::string text;
  const auto out = std::back_inserter(text);
  for (const auto& p : mesh.points) fmt::format_to(out, "v {:.6f} {:.6f} {:.6f}\n", p.x(), p.y(), p.z());
  for (const auto& [a, b, c] : mesh.triangles) fmt::format_to(out, "f {} {} {}\n", a + 1, b + 1, c + 1);
  return text;
}

std::string off(const TriangleMesh& mesh) {
  std::string text = fmt::format("OFF\n{} {} 0\n", mesh.points.size(), mesh.triangles.size());
  const auto out = std::back_inserter(text);
  for (const auto& p : mesh.points) fmt::format_to(out, "{:.6f} {:.6f} {:.6f}\n", p.x(), p.y(), p.z());
  for (const auto& [a, b, c] : mesh.triangles) fmt::format_to(out, "3 {} {} {}\n", a, b, c);
  return text;
}

std::string ply(const TriangleMesh& mesh, bool binary) {
  std::string bytes = fmt::format(
      "ply\nformat {} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nelement face {}\n"
      "property list uchar int vertex_indices\nend_header\n",
      binary ? "binary_little_endian" : "ascii", mesh.points.size(), mesh.triangles.size());
  const auto out = std::back_inserter(bytes);
  for (const auto& p : mesh.points) {
    if (binary) {
      for (const double x : p) append(bytes, static_cast<float>(x));
    } else {
      fmt::format_to(out, "{:.6f} {:.6f} {:.6f}\n", p.x(), p.y(), p.z());
    }
  }
  for (const auto& t : mesh.triangles) {
    if (binary) {
      bytes += '\3';
      for (const int corner : t) append(bytes, corner);
    } else {
      fmt::format_to(out, "3 {} {} {}\n", t[0], t[1], t[2]);
    }
  }
  return bytes;
}

std::string stl(const TriangleMesh& mesh) {
  std::string bytes(80, ' ');
  append(bytes, static_cast<std::uint32_t>(mesh.triangles.size()));
  for (const auto& t : mesh.triangles) {
    bytes.append(12, '\0');
    for (const int corner : t) {
      for (const double x : mesh.points[corner]) append(bytes, static_cast<float>(x));
    }
    bytes.append(2, '\0');
  }
  return bytes;
}

void read(benchmark::State& state, const std::string& name) {
  const TriangleMesh mesh = sheet(static_cast<int>(state.range(0)));
  const std::string bytes = name == "s.obj"   ? obj(mesh)
                            : name == "s.off" ? off(mesh)
                            : name == "s.stl" ? stl(mesh)
                                              : ply(mesh, name == "binary.ply");
  const ScanFile scan = read_scan_bytes(bytes, name);
  if (scan.mesh.points.size() != mesh.points.size() || scan.mesh.triangles.size() != mesh.triangles.size()) {
    throw std::runtime_error(name + " was read wrongly");
  }
  for (auto _ : state) benchmark::DoNotOptimize(read_scan_bytes(bytes, name));
  state.SetBytesProcessed(static_cast<std::int64_t>(state.iterations() * bytes.size()));
  state.counters["points"] = static_cast<double>(mesh.points.size());
}

void repair_sheet(benchmark::State& state) {
  const TriangleMesh mesh = sheet(static_cast<int>(state.range(0)));
  for (auto _ : state) benchmark::DoNotOptimize(repair(mesh));
  state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations() * mesh.triangles.size()));
  state.SetComplexityN(static_cast<std::int64_t>(mesh.triangles.size()));
}

}  // namespace

BENCHMARK_CAPTURE(read, obj, "s.obj")->Arg(110)->Arg(708)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(read, ply_binary, "binary.ply")->Arg(110)->Arg(708)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(read, ply_ascii, "ascii.ply")->Arg(110)->Arg(708)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(read, stl_binary, "s.stl")->Arg(110)->Arg(708)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(read, off, "s.off")->Arg(110)->Arg(708)->Unit(benchmark::kMillisecond);
BENCHMARK(repair_sheet)->RangeMultiplier(2)->Range(88, 708)->Complexity()->Unit(benchmark::kMillisecond);

BENCHMARK_MAIN();
