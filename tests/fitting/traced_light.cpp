// SPDX-License-Identifier: GPL-3.0-or-later
#include "traced_light.h"

#include <fstream>
#include <string>

#include "cross_check/path_tracer.h"
#include "files/atomic_file.h"

namespace interglow::test {
namespace {

using cross_check::Channel;
using radiosity::RowMatrix;
using RowMatrixF = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

RowMatrix values_of(const image::SpectralImage& image) {
  const Eigen::Index pixels = Eigen::Index{image.width} * image.height;
  return Eigen::Map<const RowMatrixF>(image.value.data(), pixels, image.bands()).cast<double>();
}

}  // namespace

TracedLight trace_light(const scene::Scene& scene, int parts, int paths, std::uint64_t seed) {
  TracedLight light;
  for (int part = 0; part < parts; ++part) {
    // Two batches, as estimates need.
    cross_check::PathTracer tracer(
        scene, {.samples_per_batch = paths / (2 * parts),
                .seed = seed * static_cast<std::uint64_t>(parts) + static_cast<std::uint64_t>(part)});
    tracer.add_batches(2);
    const RowMatrix total = values_of(tracer.estimate(Channel::kTotal).mean);
    light.direct.push_back(values_of(tracer.estimate(Channel::kRe).mean) +
                           values_of(tracer.estimate(Channel::kLe).mean));
    light.indirect.push_back(total - light.direct.back());
  }
  return light;
}

void write_traced_light(const std::filesystem::path& path, const TracedLight& light) {
  std::string bytes;
  for (const auto* component : {&light.direct, &light.indirect}) {
    for (const RowMatrix& part : *component) {
      const RowMatrixF narrow = part.cast<float>();
      bytes.append(reinterpret_cast<const char*>(narrow.data()),
                   static_cast<std::size_t>(narrow.size()) * sizeof(float));
    }
  }
  files::write_text_atomically(path, bytes);
}

TracedLight read_traced_light(const std::filesystem::path& path, int parts, Eigen::Index pixels, Eigen::Index bands) {
  TracedLight light;
  const auto part_bytes = pixels * bands * static_cast<Eigen::Index>(sizeof(float));
  std::error_code missing;
  const auto size = std::filesystem::file_size(path, missing);
  if (missing || size != static_cast<std::uintmax_t>(2 * parts * part_bytes)) return light;
  std::ifstream in(path, std::ios::binary);
  RowMatrixF narrow(pixels, bands);
  for (auto* component : {&light.direct, &light.indirect}) {
    for (int part = 0; part < parts && in.read(reinterpret_cast<char*>(narrow.data()), part_bytes); ++part)
      component->push_back(narrow.cast<double>());
  }
  return in ? light : TracedLight{};
}

}  // namespace interglow::test
