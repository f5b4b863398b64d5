// SPDX-License-Identifier: GPL-3.0-or-later
#include "image/comparison_files.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace interglow::image {
namespace {

/// The smallest 1, 2 or 5 times a power of ten that 99 % of the values do not exceed; 1 if there is none above 0.
double scale_of(const ScalarMap& map) {
  std::vector<float> values;
  std::copy_if(map.value.begin(), map.value.end(), std::back_inserter(values),
               [](float v) { return std::isfinite(v); });
  if (values.empty()) return 1.0;
  const auto rank = values.begin() + static_cast<std::ptrdiff_t>(0.99 * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), rank, values.end());
  const auto value = static_cast<double>(*rank);
  if (!(value > 0.0)) return 1.0;
  const double decade = std::pow(10.0, std::floor(std::log10(value)));
  for (const double step : {1.0, 2.0, 5.0}) {
    if (value <= step * decade) return step * decade;
  }
  return 10.0 * decade;
}

}  // namespace

std::vector<WrittenMap> write_comparison_maps(const std::filesystem::path& folder, const ImageComparison& comparison,
                                              const Attributes& attributes) {
  struct Map {
    const ScalarMap& values;
    std::string name;
    std::string quantity;
  };
  const std::array<Map, 4> maps = {Map{comparison.spectral_angle_deg_map, "spectral_angle", "spectral angle [deg]"},
                                   Map{comparison.delta_srgb_map, "delta_srgb", "sRGB difference [1]"},
                                   Map{comparison.ciede2000_map, "ciede2000", "CIEDE2000 [1]"},
                                   Map{comparison.relative_rmse_map, "relative_rmse", "RMSE over the mean [1]"}};
  std::vector<WrittenMap> written;
  ChannelImage all{maps[0].values.width, maps[0].values.height, {}, {}, attributes, {}};
  all.value.resize(maps.size() * maps[0].values.value.size());
  for (std::size_t m = 0; m < maps.size(); ++m) {
    const Map& map = maps[m];
    const double highest = scale_of(map.values);
    written.push_back({folder / (map.name + ".png"), map.quantity, highest});
    write_map_png(written.back().file, map.values, 0.0, highest, MapColours::kCubehelix, attributes);
    all.channel.push_back(map.name);
    for (std::size_t p = 0; p < map.values.value.size(); ++p) all.value[maps.size() * p + m] = map.values.value[p];
  }
  write_exr_channels(folder / "maps.exr", all);
  return written;
}

}  // namespace interglow::image
