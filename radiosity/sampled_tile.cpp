// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/sampled_tile.h"

#include <algorithm>
#include <cmath>

#include "radiosity/form_factor.h"

namespace interglow::radiosity {
namespace {

constexpr double kMostLines = 65536.0;
/// A survey is this share of the lines that are wanted, if those are worth one.
constexpr double kOfSurvey = 0.125;
constexpr double kWorthASurvey = 64.0;
/// Draws of a pair with few lines, and lines of each of many draws.
constexpr int kFewDraws = 2;
constexpr double kLinesOfManyDraws = 8.0;
/// Lines that are traced together.
constexpr std::size_t kTogether = 8192;
/// Numbers of the draws: a round has its own.
constexpr std::uint64_t kPilotDraw = 0;
constexpr std::uint64_t kSurveyDraw = 1;
constexpr std::uint64_t kRoundDraws = 1024;
constexpr std::uint64_t kDrawsOfARound = 16;

}  // namespace

void TileSampler::add(const SampledTile& tile, std::size_t at, std::uint64_t draw, int draws, int lines) {
  const auto columns = static_cast<std::size_t>(tile.columns);
  const int i = element(tile.row_first + static_cast<int>(at / columns));
  const int j = element(tile.column_first + static_cast<int>(at % columns));
  drawn_.push_back({at, draws});
  for (int k = 0; k < draws; ++k) {
    lines_.add(std::min(i, j), std::max(i, j), draw + static_cast<std::uint64_t>(k), lines);
    ends_.push_back(lines_.size());
  }
}

void TileSampler::trace(SampledTile& tile) {
  lines_.trace();
  std::size_t first = 0;
  std::size_t number = 0;
  for (const Drawn& drawn : drawn_) {
    const std::size_t start = first;
    LineSums sums;
    double mean = 0.0;
    double squares = 0.0;
    for (int k = 0; k < drawn.draws; ++k, ++number) {
      const LineSums one = lines_.sums(first, ends_[number]);
      first = ends_[number];
      sums = sums + one;
      const double move = one.share() - mean;  // Welford
      mean += move / (k + 1);
      squares += move * (one.share() - mean);
    }
    SampledPair& pair = tile.pair[drawn.at];
    pair.share = static_cast<float>(sums.share());
    pair.lines = static_cast<std::int32_t>(first - start);
    pair.draws = static_cast<std::uint8_t>(drawn.draws);
    pair.agree = sums.agree();
    pair.variance = static_cast<float>(!pair.agree ? sums.variance() : sums.worth() > 0.0 ? 1.0 / sums.worth() : 0.0);
    pair.draws_variance =
        pair.agree || drawn.draws < 2 ? 0.0F : static_cast<float>(squares / (drawn.draws * (drawn.draws - 1)));
  }
  drawn_.clear();
  ends_.clear();
  lines_.clear();
}

void TileSampler::draw_pilot(SampledTile& tile) {
  for (std::size_t at = 0; at < tile.pair.size(); ++at) {
    if (tile.values[at] > 0.0) add(tile, at, kPilotDraw, 1, kPilotLines);
  }
  trace(tile);
  find_deviations(tile);
}

double TileSampler::wanted(const SampledTile& tile, std::size_t at, const Eigen::VectorXd& lines_per_spread) const {
  const auto columns = static_cast<std::size_t>(tile.columns);
  const int i = element(tile.row_first + static_cast<int>(at / columns));
  const int j = element(tile.column_first + static_cast<int>(at % columns));
  return std::min(kMostLines, static_cast<double>(tile.pair[at].deviation) * tile.values[at] *
                                  std::max(lines_per_spread[i], lines_per_spread[j]));
}

void TileSampler::draw_survey(SampledTile& tile, const Eigen::VectorXd& lines_per_spread) {
  for (std::size_t at = 0; at < tile.pair.size(); ++at) {
    if (!(tile.values[at] > 0.0)) continue;
    const double lines = wanted(tile, at, lines_per_spread);
    if (lines < kWorthASurvey) continue;
    add(tile, at, kSurveyDraw, 1, static_cast<int>(kOfSurvey * lines));
    if (lines_.size() >= kTogether) trace(tile);
  }
  trace(tile);
  find_deviations(tile);
}

void TileSampler::draw(SampledTile& tile, const Eigen::VectorXd& lines_per_spread, int round) {
  for (std::size_t at = 0; at < tile.pair.size(); ++at) {
    if (!(tile.values[at] > 0.0)) continue;
    const double lines = wanted(tile, at, lines_per_spread);
    if (round > 0 && lines <= tile.pair[at].lines) continue;
    const int draws = lines > kManyDraws * kLinesOfManyDraws ? kManyDraws : kFewDraws;
    add(tile, at, kRoundDraws + static_cast<std::uint64_t>(round) * kDrawsOfARound, draws,
        std::max(1, static_cast<int>(std::ceil(lines / draws))));
    if (lines_.size() >= kTogether) trace(tile);
  }
  trace(tile);
  const double in_doubt = share_in_doubt(tile) / kOfLattice;
  for (SampledPair& pair : tile.pair) {
    const double variance =
        pair.agree ? in_doubt * pair.variance : std::max<double>(pair.variance, pair.draws_variance / kOfLattice);
    // Without a line that carries something anything is possible.
    pair.deviation = pair.lines > 0 ? static_cast<float>(std::sqrt(pair.lines * variance)) : 0.5F;
  }
}

void TileSampler::find_deviations(SampledTile& tile) {
  struct Mean {
    double sum = 0.5;  // one line more, that is in doubt
    double count = 1.0;
    void add(double share) {
      sum += kPilotLines * share;
      count += kPilotLines;
    }
    double value() const { return sum / count; }
  };
  const auto columns = static_cast<std::size_t>(tile.columns);
  std::vector<Mean> of_row(static_cast<std::size_t>(tile.rows)), of_column(columns);
  for (std::size_t at = 0; at < tile.pair.size(); ++at) {
    if (!(tile.values[at] > 0.0)) continue;
    of_row[at / columns].add(tile.pair[at].share);
    of_column[at % columns].add(tile.pair[at].share);
  }
  for (std::size_t at = 0; at < tile.pair.size(); ++at) {
    if (!(tile.values[at] > 0.0)) continue;
    SampledPair& pair = tile.pair[at];
    const double around = 0.5 * (of_row[at / columns].value() + of_column[at % columns].value());
    const double p = (pair.lines * static_cast<double>(pair.share) + around) / (pair.lines + 1);
    pair.deviation = static_cast<float>(std::sqrt(p * (1.0 - p)));
  }
}

double TileSampler::share_in_doubt(const SampledTile& tile) {
  std::int64_t agreeing = 0;
  for (const SampledPair& pair : tile.pair) agreeing += pair.agree ? pair.lines : 0;
  return 0.5 / static_cast<double>(std::max<std::int64_t>(1, agreeing));
}

void TileSampler::find_spread(const SampledTile& tile, std::vector<RowSpread>& spread) const {
  const auto rows = static_cast<std::size_t>(tile.rows);
  const auto columns = static_cast<std::size_t>(tile.columns);
  std::vector<RowSpread> of_sides(rows + columns);  // rows, then columns
  for (std::size_t at = 0; at < tile.pair.size(); ++at) {
    if (!(tile.values[at] > 0.0)) continue;
    const double deviation = static_cast<double>(tile.pair[at].deviation) * tile.values[at];
    const double variance = kOfLattice * deviation * deviation / std::max(1, tile.pair[at].lines);
    for (const std::size_t side : {at / columns, rows + at % columns}) {
      of_sides[side].deviation += deviation;
      of_sides[side].squares += deviation * deviation;
      of_sides[side].variance += variance;
    }
  }
  for (std::size_t side = 0; side < rows + columns; ++side) {
    if (!(of_sides[side].deviation > 0.0)) continue;
    const int e = element(side < rows ? tile.row_first + static_cast<int>(side)
                                      : tile.column_first + static_cast<int>(side - rows));
    const double area = problem_.elements.area_mm2[e];
    spread.push_back({e, of_sides[side].deviation / area, of_sides[side].squares / (area * area),
                      of_sides[side].variance / (area * area)});
  }
}

void TileSampler::find_errors(const SampledTile& tile, std::vector<RowError>& errors) const {
  const auto rows = static_cast<std::size_t>(tile.rows);
  const auto columns = static_cast<std::size_t>(tile.columns);
  std::vector<RowError> of_sides(rows + columns);  // rows, then columns; of exchange areas
  const double in_doubt = share_in_doubt(tile);
  for (std::size_t at = 0; at < tile.pair.size(); ++at) {
    const double exchange = tile.values[at];
    if (!(exchange > 0.0)) continue;
    const SampledPair& pair = tile.pair[at];
    const double square = exchange * exchange;
    RowError error;
    if (pair.lines == 0) {
      error.bound = 0.5 * exchange;
    } else if (pair.agree) {
      error.in_doubt = in_doubt * square * static_cast<double>(pair.variance);
    } else {
      error.variance = square * static_cast<double>(pair.variance);
      error.draws_variance = square * static_cast<double>(pair.draws_variance);
      error.draws_squares = error.draws_variance * error.draws_variance / (pair.draws + 1);
    }
    of_sides[at / columns] += error;
    of_sides[rows + at % columns] += error;
  }
  for (std::size_t side = 0; side < rows + columns; ++side) {
    RowError& error = of_sides[side];
    error.element = element(side < rows ? tile.row_first + static_cast<int>(side)
                                        : tile.column_first + static_cast<int>(side - rows));
    errors.push_back(error.over(problem_.elements.area_mm2[error.element]));
  }
}

bool TileSampler::finish(SampledTile& tile, TransportReport& counts) {
  bool any_seen = false;
  for (std::size_t at = 0; at < tile.pair.size(); ++at) {
    if (!(tile.values[at] > 0.0)) continue;
    const SampledPair& pair = tile.pair[at];
    tile.values[at] *= static_cast<double>(pair.share);
    any_seen = any_seen || pair.share > 0.0F;
    auto method = static_cast<FormFactorMethod>(pair.method);
    if (pair.share == 0.0F) {
      method = FormFactorMethod::kBlocked;
      ++counts.blocked_pairs;
    } else if (!pair.agree || pair.lines == 0) {
      method = FormFactorMethod::kOccluded;
      ++counts.partially_visible_pairs;
    }
    ++counts.pairs_by_method[static_cast<std::size_t>(method)];
  }
  if (any_seen && tile.row_first == tile.column_first) {
    const auto columns = static_cast<std::size_t>(tile.columns);
    for (std::size_t r = 0; r < columns; ++r) {
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
