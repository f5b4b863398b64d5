// SPDX-License-Identifier: GPL-3.0-or-later
#include "image/png.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "diagnostics/error.h"
#include "spectral/colour.h"

namespace interglow::image {
namespace {

std::uint8_t byte_of(double unit) { return static_cast<std::uint8_t>(std::lround(255.0 * std::clamp(unit, 0.0, 1.0))); }

/// Cubehelix with its usual start 0.5, rotations -1.5, hue 1 and gamma 1.
std::array<std::uint8_t, 3> cubehelix(double level) {
  const double angle = 2.0 * std::numbers::pi * (0.5 / 3.0 + 1.0 - 1.5 * level);
  const double amplitude = 0.5 * level * (1.0 - level);
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  return {byte_of(level + amplitude * (-0.14861 * c + 1.78277 * s)),
          byte_of(level + amplitude * (-0.29227 * c - 0.90649 * s)), byte_of(level + amplitude * (1.97294 * c))};
}

}  // namespace

void write_png(const std::filesystem::path& path, const RgbImage& rgb, const Attributes& attributes) {
  std::vector<std::uint8_t> bytes(rgb.value.size());
  std::transform(rgb.value.begin(), rgb.value.end(), bytes.begin(),
                 [](float linear) { return byte_of(spectral::encoded_srgb(static_cast<double>(linear))); });
  write_png_bytes(path, rgb.width, rgb.height, 3, bytes, attributes);
}

void write_map_png(const std::filesystem::path& path, const ScalarMap& map, double lowest, double highest,
                   MapColours colours, const Attributes& attributes) {
  if (!(lowest < highest) || !std::isfinite(lowest) || !std::isfinite(highest)) {
    throw InvalidParams(fmt::format("map {}: range {} to {}; expected two finite numbers, the lowest first.",
                                    path.string(), lowest, highest));
  }
  const auto level = [&](float value) {
    return std::clamp((static_cast<double>(value) - lowest) / (highest - lowest), 0.0, 1.0);
  };
  if (colours == MapColours::kGrey) {
    std::vector<std::uint16_t> words(map.value.size());
    std::transform(map.value.begin(), map.value.end(), words.begin(), [&](float value) {
      return std::isnan(value) ? std::uint16_t{0} : static_cast<std::uint16_t>(std::lround(65535.0 * level(value)));
    });
    write_png_words(path, map.width, map.height, 1, words, attributes);
    return;
  }
  std::vector<std::uint8_t> bytes;
  bytes.reserve(4 * map.value.size());
  for (const float value : map.value) {
    const bool valid = !std::isnan(value);
    const auto rgb = cubehelix(valid ? level(value) : 0.0);
    bytes.insert(bytes.end(), rgb.begin(), rgb.end());
    bytes.push_back(valid ? 255 : 0);
  }
  write_png_bytes(path, map.width, map.height, 4, bytes, attributes);
}

}  // namespace interglow::image
