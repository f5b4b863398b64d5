// SPDX-License-Identifier: GPL-3.0-or-later
/// Pictures by the path tracer in independent parts, so that the noise of whatever is made of them is known.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "radiosity/direct_light.h"
#include "scene/scene.h"

namespace interglow::test {

struct TracedLight {
  /// Radiance, pixels x bands; one matrix a part. The parts are independent of one another, pixels within one too.
  std::vector<radiosity::RowMatrix> direct, indirect;

  int parts() const { return static_cast<int>(direct.size()); }
};

/// @param paths  of each pixel, in all parts together; at least 4 a part
TracedLight trace_light(const scene::Scene& scene, int parts, int paths, std::uint64_t seed);

/// As 32-bit floats, for studies that are run again. @throws InvalidInput if the file cannot be written
void write_traced_light(const std::filesystem::path& path, const TracedLight& light);

/// Nothing (no parts) if there is no file of that size.
TracedLight read_traced_light(const std::filesystem::path& path, int parts, Eigen::Index pixels, Eigen::Index bands);

}  // namespace interglow::test
