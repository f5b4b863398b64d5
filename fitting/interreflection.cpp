// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/interreflection.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "diagnostics/error.h"

namespace interglow::fitting {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();

/// Squared distance along one line to the nearest place with its own start value: min over q of (p - q)² + start[q].
/// Lower envelope of parabolas [felzenszwalb-huttenlocher-2012].
void distance_along_line(const std::vector<double>& start, std::vector<double>& squared) {
  const int count = static_cast<int>(start.size());
  std::vector<int> root;     // places whose parabolas form the envelope
  std::vector<double> from;  // where each begins to be the lowest
  for (int q = 0; q < count; ++q) {
    if (std::isinf(start[static_cast<std::size_t>(q)])) continue;
    double cross = -kInfinite;
    while (!root.empty()) {
      const int v = root.back();
      cross =
          (start[static_cast<std::size_t>(q)] + double(q) * q - start[static_cast<std::size_t>(v)] - double(v) * v) /
          (2.0 * (q - v));
      if (cross > from.back()) break;
      root.pop_back();
      from.pop_back();
      cross = -kInfinite;
    }
    root.push_back(q);
    from.push_back(cross);
  }
  if (root.empty()) {
    std::fill(squared.begin(), squared.end(), kInfinite);
    return;
  }
  std::size_t piece = 0;
  for (int p = 0; p < count; ++p) {
    while (piece + 1 < root.size() && from[piece + 1] < p) ++piece;
    const double step = p - root[piece];
    squared[static_cast<std::size_t>(p)] = step * step + start[static_cast<std::size_t>(root[piece])];
  }
}

/// Squared distance to the nearest pixel whose flag equals `kind`.
std::vector<double> squared_distance(const std::vector<std::uint8_t>& region, int width, int height, bool kind) {
  const auto w = static_cast<std::size_t>(width);
  const auto h = static_cast<std::size_t>(height);
  std::vector<double> squared(w * h);
  std::vector<double> line(h);
  std::vector<double> along(h);
  for (std::size_t x = 0; x < w; ++x) {
    for (std::size_t y = 0; y < h; ++y) line[y] = (region[y * w + x] != 0) == kind ? 0.0 : kInfinite;
    distance_along_line(line, along);
    for (std::size_t y = 0; y < h; ++y) squared[y * w + x] = along[y];
  }
  line.resize(w);
  along.resize(w);
  for (std::size_t y = 0; y < h; ++y) {
    std::copy_n(squared.begin() + static_cast<std::ptrdiff_t>(y * w), w, line.begin());
    distance_along_line(line, along);
    std::copy_n(along.begin(), w, squared.begin() + static_cast<std::ptrdiff_t>(y * w));
  }
  return squared;
}

/// Sums of the four maps over some pixels.
struct Sums {
  double captured_direct = 0.0;
  double captured_indirect = 0.0;
  double simulated_direct = 0.0;
  double simulated_indirect = 0.0;
  std::size_t pixels = 0;

  void add(const Sums& other) {
    captured_direct += other.captured_direct;
    captured_indirect += other.captured_indirect;
    simulated_direct += other.simulated_direct;
    simulated_indirect += other.simulated_indirect;
    pixels += other.pixels;
  }
  bool defined() const { return captured_direct > 0.0 && simulated_direct > 0.0 && simulated_indirect > 0.0; }
  double ratio() const { return captured_indirect / captured_direct / (simulated_indirect / simulated_direct); }
};

void check(const ShadingMaps& captured, const ShadingMaps& simulated, const std::vector<std::uint8_t>& region,
           const RegionParams& params) {
  const image::ScalarMap& first = captured.direct;
  for (const image::ScalarMap* map : {&captured.indirect, &simulated.direct, &simulated.indirect}) {
    if (map->width != first.width || map->height != first.height) {
      throw InvalidParams(fmt::format("shading maps of {} × {} and {} × {} pixels; expected one size.", first.width,
                                      first.height, map->width, map->height));
    }
  }
  if (region.size() != first.value.size())
    throw InvalidParams(fmt::format("region: {} flags for {} pixels.", region.size(), first.value.size()));
  if (params.tile_px < 1) throw InvalidParams(fmt::format("tile_px: {}; expected at least 1.", params.tile_px));
}

}  // namespace

std::vector<float> signed_distance_px(const std::vector<std::uint8_t>& region, int width, int height) {
  if (width < 0 || height < 0 || region.size() != static_cast<std::size_t>(width) * static_cast<std::size_t>(height))
    throw InvalidParams(fmt::format("region: {} flags for {} × {} pixels.", region.size(), width, height));
  const std::vector<double> to_inside = squared_distance(region, width, height, true);
  const std::vector<double> to_outside = squared_distance(region, width, height, false);
  std::vector<float> signed_distance(region.size());
  for (std::size_t p = 0; p < region.size(); ++p) {
    signed_distance[p] =
        static_cast<float>(region[p] != 0 ? 0.5 - std::sqrt(to_outside[p]) : std::sqrt(to_inside[p]) - 0.5);
  }
  return signed_distance;
}

InterreflectionRatio interreflection_ratio(const ShadingMaps& captured, const ShadingMaps& simulated,
                                           const std::vector<std::uint8_t>& region, const RegionParams& params) {
  check(captured, simulated, region, params);
  const int width = captured.direct.width;
  const int height = captured.direct.height;
  const std::vector<float> distance = signed_distance_px(region, width, height);
  const int tiles_across = (width + params.tile_px - 1) / params.tile_px;
  const int tiles_down = (height + params.tile_px - 1) / params.tile_px;

  // Sums by tile, added up in order.
  const auto tile_sums = [&](double radius_px) {
    std::vector<Sums> tiles(static_cast<std::size_t>(tiles_across) * static_cast<std::size_t>(tiles_down));
    for (std::size_t p = 0; p < region.size(); ++p) {
      if (!(static_cast<double>(distance[p]) <= radius_px)) continue;
      const Sums pixel{static_cast<double>(captured.direct.value[p]), static_cast<double>(captured.indirect.value[p]),
                       static_cast<double>(simulated.direct.value[p]), static_cast<double>(simulated.indirect.value[p]),
                       1};
      if (!std::isfinite(pixel.captured_direct + pixel.captured_indirect + pixel.simulated_direct +
                         pixel.simulated_indirect))
        continue;
      const std::size_t row = p / static_cast<std::size_t>(width) / static_cast<std::size_t>(params.tile_px);
      const std::size_t column = p % static_cast<std::size_t>(width) / static_cast<std::size_t>(params.tile_px);
      tiles[row * static_cast<std::size_t>(tiles_across) + column].add(pixel);
    }
    return tiles;
  };
  const auto total = [](const std::vector<Sums>& tiles) {
    Sums sum;
    for (const Sums& tile : tiles) sum.add(tile);
    return sum;
  };
  const auto figures = [](double radius_px, const Sums& sum) {
    return RegionRatio{radius_px, sum.pixels, sum.captured_indirect / sum.captured_direct,
                       sum.simulated_indirect / sum.simulated_direct, sum.ratio()};
  };

  const std::vector<Sums> tiles = tile_sums(0.0);
  const Sums all = total(tiles);
  if (all.pixels == 0) throw InvalidInput("the region has no pixel with shading terms in both images; enlarge it.");
  if (!all.defined()) {
    throw InvalidInput(fmt::format(
        "w / w' is undefined over the region: mean f_1 is {:.3g} in the captured and {:.3g} in the simulated image, "
        "mean "
        "f_2 of the simulated one {:.3g}; all must be above 0. Choose lit pixels where the objects are close.",
        all.captured_direct / static_cast<double>(all.pixels), all.simulated_direct / static_cast<double>(all.pixels),
        all.simulated_indirect / static_cast<double>(all.pixels)));
  }
  InterreflectionRatio result;
  result.region = figures(0.0, all);
  for (const double radius_px : params.radius_px) {
    const Sums sum = total(tile_sums(radius_px));
    if (sum.defined()) result.curve.push_back(figures(radius_px, sum));
  }
  result.lowest = result.highest = result.region.ratio;
  for (const RegionRatio& point : result.curve) {
    result.lowest = std::min(result.lowest, point.ratio);
    result.highest = std::max(result.highest, point.ratio);
  }
  std::vector<double> without;
  for (const Sums& tile : tiles) {
    if (tile.pixels == 0) continue;
    ++result.tiles;
    const Sums rest{all.captured_direct - tile.captured_direct, all.captured_indirect - tile.captured_indirect,
                    all.simulated_direct - tile.simulated_direct, all.simulated_indirect - tile.simulated_indirect,
                    all.pixels - tile.pixels};
    if (rest.defined()) without.push_back(rest.ratio());
  }
  double mean = 0.0;
  for (const double value : without) mean += value / static_cast<double>(without.size());
  double squares = 0.0;
  for (const double value : without) squares += (value - mean) * (value - mean);
  const auto count = static_cast<double>(without.size());
  result.tile_sd =
      without.size() > 1 ? std::sqrt((count - 1.0) / count * squares) : std::numeric_limits<double>::quiet_NaN();
  return result;
}

}  // namespace interglow::fitting
