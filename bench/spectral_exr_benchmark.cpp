// SPDX-License-Identifier: GPL-3.0-or-later
// Writing and reading a spectral image of the size of the camera's, 512 x 512 pixels with 61 bands, and the preview.
#include <benchmark/benchmark.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>

#include "image/preview.h"
#include "image/spectral_exr.h"

namespace {

using namespace interglow::image;

/// A disk with smooth shading on black, as rendered objects are.
SpectralImage disk(int size, int bands) {
  SpectralImage image{size, size, Eigen::VectorXd::LinSpaced(bands, 400, 700), {}};
  image.value.resize(static_cast<std::size_t>(size) * static_cast<std::size_t>(size) * static_cast<std::size_t>(bands));
  for (int row = 0; row < size; ++row) {
    for (int column = 0; column < size; ++column) {
      const double x = 2.0 * column / size - 1.0;
      const double y = 2.0 * row / size - 1.0;
      if (x * x + y * y > 0.64) continue;
      for (int band = 0; band < bands; ++band) {
        image.pixel(row, column)[band] = static_cast<float>(0.1 * (1.0 + 0.5 * std::sin(0.1 * band)) *
                                                            (1.0 + 0.5 * std::cos(3.0 * x) * std::sin(4.0 * y)));
      }
    }
  }
  return image;
}

std::filesystem::path benchmark_file() {
  return std::filesystem::temp_directory_path() / ("interglow_benchmark_" + std::to_string(::getpid()) + ".exr");
}

void write_spectral(benchmark::State& state) {
  const SpectralImage image = disk(static_cast<int>(state.range(0)), 61);
  const RgbImage preview = make_preview(image);
  write_spectral_exr(benchmark_file(), image, preview);
  if (read_spectral_exr(benchmark_file()).image.value != image.value)
    state.SkipWithError("the file differs from the image");
  for (auto _ : state) write_spectral_exr(benchmark_file(), image, preview);
  state.counters["MB"] = static_cast<double>(std::filesystem::file_size(benchmark_file())) / 1e6;
  std::filesystem::remove(benchmark_file());
}
BENCHMARK(write_spectral)->Arg(512)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime()->UseRealTime();

void read_spectral(benchmark::State& state) {
  write_spectral_exr(benchmark_file(), disk(static_cast<int>(state.range(0)), 61));
  for (auto _ : state) benchmark::DoNotOptimize(read_spectral_exr(benchmark_file()));
  std::filesystem::remove(benchmark_file());
}
BENCHMARK(read_spectral)->Arg(512)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime()->UseRealTime();

void preview(benchmark::State& state) {
  const SpectralImage image = disk(static_cast<int>(state.range(0)), 61);
  for (auto _ : state) benchmark::DoNotOptimize(make_preview(image));
}
BENCHMARK(preview)->Arg(512)->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
