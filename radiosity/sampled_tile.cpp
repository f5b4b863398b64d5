// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/sampled_tile.h"

#include <algorithm>
#include <cmath>

namespace interglow::radiosity {
namespace {

constexpr int kFewestLines = 1;  // of each half
constexpr double kMostLines = 16384.0;
/// Lines that are traced together.
constexpr std::size_t kTogether = 8192;
constexpr std::uint64_t kPilotDraw = 0;
constexpr std::uint64_t kFreshDraw = 1;

}  // namespace

TileSampler::Pair TileSampler::pair_at(const SampledTile& tile, std::size_t at) const {
  const int i = element(tile.row_first + static_cast<int>(at) / tile.columns);
  const int j = element(tile.column_first + static_cast<int>(at) % tile.columns);
  return {static_cast<int>(at), std::min(i, j), std::max(i, j)};
}

void TileSampler::draw_pilot(SampledTile& tile) {
  const auto size = static_cast<std::size_t>(tile.rows * tile.columns);
  tile.pilot.assign(size, 0);
  pairs_.clear();
  lines_.clear();
  for (std::size_t at = 0; at < size; ++at) {
    if (!(tile.values[at] > 0.0)) continue;
    Pair pair = pair_at(tile, at);
    lines_.add(pair.i, pair.j, kPilotDraw, kPilotLines);
    pair.end = lines_.size();
    pairs_.push_back(pair);
  }
  lines_.trace();
  std::size_t first = 0;
  for (const Pair& pair : pairs_) {
    tile.pilot[static_cast<std::size_t>(pair.at)] =
        static_cast<std::uint8_t>(std::lround(kPilotScale * lines_.sums(first, pair.end).share()));
    first = pair.end;
  }
}

void TileSampler::find_deviations(const SampledTile& tile) {
  struct Mean {
    double sum = 0.5;  // one line more, that is in doubt
    double count = 1.0;
    void add(double share) {
      sum += kPilotLines * share;
      count += kPilotLines;
    }
    double value() const { return sum / count; }
  };
  const auto rows = static_cast<std::size_t>(tile.rows);
  const auto columns = static_cast<std::size_t>(tile.columns);
  std::vector<Mean> of_row(rows), of_column(columns);
  const auto share = [&](std::size_t at) { return tile.pilot[at] / static_cast<double>(kPilotScale); };
  for (std::size_t at = 0; at < rows * columns; ++at) {
    if (!(tile.values[at] > 0.0)) continue;
    of_row[at / columns].add(share(at));
    of_column[at % columns].add(share(at));
  }
  deviation_.assign(rows * columns, 0.0);
  for (std::size_t at = 0; at < rows * columns; ++at) {
    if (!(tile.values[at] > 0.0)) continue;
    const double around = 0.5 * (of_row[at / columns].value() + of_column[at % columns].value());
    const double p = (kPilotLines * share(at) + around) / (kPilotLines + 1);
    deviation_[at] = std::sqrt(p * (1.0 - p));
  }
}

void TileSampler::find_spread(const SampledTile& tile, std::vector<RowSpread>& spread) {
  find_deviations(tile);
  const auto columns = static_cast<std::size_t>(tile.columns);
  std::vector<double> of_row(static_cast<std::size_t>(tile.rows), 0.0);
  std::vector<double> of_column(columns, 0.0);
  for (std::size_t at = 0; at < deviation_.size(); ++at) {
    const double deviation = deviation_[at] * tile.values[at];
    of_row[at / columns] += deviation;
    of_column[at % columns] += deviation;
  }
  const auto append = [&](int first, const std::vector<double>& sums) {
    for (std::size_t k = 0; k < sums.size(); ++k) {
      const int e = element(first + static_cast<int>(k));
      if (sums[k] > 0.0) spread.push_back({e, sums[k] / problem_.elements.area_mm2[e]});
    }
  };
  append(tile.row_first, of_row);
  append(tile.column_first, of_column);
}

bool TileSampler::settle(SampledTile& tile, const Eigen::VectorXd& lines_per_spread, std::vector<RowError>& errors,
                         TransportReport& counts) {
  find_deviations(tile);
  const auto rows = static_cast<std::size_t>(tile.rows);
  const auto columns = static_cast<std::size_t>(tile.columns);
  std::vector<RowError> of_sides(rows + columns);  // rows, then columns; of exchange areas
  std::size_t agreeing_lines = 0;
  bool any_seen = false;
  const auto finish = [&] {
    lines_.trace();
    std::size_t first = 0;
    for (const Pair& pair : pairs_) {
      const auto at = static_cast<std::size_t>(pair.at);
      const LineSums one = lines_.sums(first, pair.middle);
      const LineSums two = lines_.sums(pair.middle, pair.end);
      const LineSums sums = one + two;
      const std::size_t n = pair.end - first;
      first = pair.end;
      const double exchange = tile.values[at];
      const double share = sums.share();
      const bool agree = n > 0 && sums.agree();
      tile.values[at] = exchange * share;
      any_seen = any_seen || share > 0.0;
      auto method = static_cast<FormFactorMethod>(tile.method[at]);
      if (share == 0.0) {
        method = FormFactorMethod::kBlocked;
        ++counts.blocked_pairs;
      } else if (!agree) {
        method = FormFactorMethod::kOccluded;
        ++counts.partially_visible_pairs;
      }
      ++counts.pairs_by_method[static_cast<std::size_t>(method)];
      RowError error;
      if (n == 0) {
        error.bound = 0.5 * exchange;
      } else if (agree) {
        agreeing_lines += n;
        error.in_doubt = exchange * exchange / sums.worth();  // still times the share in doubt
      } else {
        const double half_difference = 0.5 * exchange * (one.share() - two.share());
        error.variance = exchange * exchange * sums.variance();
        error.halves_variance = half_difference * half_difference;
        error.halves_squares = error.halves_variance * error.halves_variance;
      }
      of_sides[at / columns] += error;
      of_sides[rows + at % columns] += error;
    }
    pairs_.clear();
    lines_.clear();
  };
  pairs_.clear();
  lines_.clear();
  for (std::size_t at = 0; at < rows * columns; ++at) {
    if (!(tile.values[at] > 0.0)) continue;
    Pair pair = pair_at(tile, at);
    const double wanted =
        deviation_[at] * tile.values[at] * std::max(lines_per_spread[pair.i], lines_per_spread[pair.j]);
    const int half = std::max(kFewestLines, static_cast<int>(std::ceil(0.5 * std::min(kMostLines, wanted))));
    lines_.add(pair.i, pair.j, kFreshDraw, half);
    pair.middle = lines_.size();
    lines_.add(pair.i, pair.j, kFreshDraw + 1, half);
    pair.end = lines_.size();
    pairs_.push_back(pair);
    if (lines_.size() >= kTogether) finish();
  }
  finish();
  const double in_doubt = 0.5 / static_cast<double>(std::max<std::size_t>(1, agreeing_lines));
  for (std::size_t side = 0; side < rows + columns; ++side) {
    const int e = element(side < rows ? tile.row_first + static_cast<int>(side)
                                      : tile.column_first + static_cast<int>(side - rows));
    RowError& error = of_sides[side];
    error.element = e;
    error.in_doubt *= in_doubt;
    errors.push_back(error.over(problem_.elements.area_mm2[e]));
  }
  if (any_seen && tile.row_first == tile.column_first) {
    for (std::size_t r = 0; r < rows; ++r) {
      for (std::size_t c = 0; c < r; ++c) {
        double& lower = tile.values[r * columns + c];
        double& upper = tile.values[c * columns + r];
        lower = upper = lower + upper;  // one of them is 0
      }
    }
  }
  return any_seen;
}

}  // namespace interglow::radiosity
