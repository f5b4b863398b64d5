// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/affine_search.h"

#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "fitting/spline_image.h"

namespace interglow::fitting {
namespace {

constexpr double kTurnStepDeg = 6.0;  // 3° off at 16 px from the middle are 0.8 px, within reach of the descent
constexpr double kScaleStep = 1.12;   // likewise 0.9 px
constexpr double kLeastOverlap = 1.0 / 3.0;

struct Candidate {
  double correlation = -1.0;
  Affine map;
};

/// The moving image turned and scaled about the middles, at all whole shifts of the search.
struct Turned {
  int reach_x = 0;
  int reach_y = 0;
  int width = 0;
  std::vector<double> value;
  std::vector<char> inside;
};

Turned turn(const SplineImage& moving, const image::ScalarMap& fixed, const Affine& map, int reach_x, int reach_y) {
  Turned turned{reach_x, reach_y, fixed.width + 2 * reach_x, {}, {}};
  for (int y = -reach_y; y < fixed.height + reach_y; ++y) {
    for (int x = -reach_x; x < fixed.width + reach_x; ++x) {
      const Eigen::Vector2d at = map({x, y});
      const bool inside = moving.contains(at.x(), at.y());
      turned.inside.push_back(inside ? 1 : 0);
      turned.value.push_back(inside ? moving.sample(at.x(), at.y()).value : 0.0);
    }
  }
  return turned;
}

double correlation(const image::ScalarMap& fixed, const Turned& turned, int dx, int dy) {
  double n = 0.0, sf = 0.0, sm = 0.0, sff = 0.0, smm = 0.0, sfm = 0.0;
  for (int y = 0; y < fixed.height; ++y) {
    const std::size_t from =
        static_cast<std::size_t>(y + turned.reach_y + dy) * static_cast<std::size_t>(turned.width) +
        static_cast<std::size_t>(turned.reach_x + dx);
    const float* row = fixed.value.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(fixed.width);
    for (int x = 0; x < fixed.width; ++x) {
      const std::size_t m = from + static_cast<std::size_t>(x);
      if (turned.inside[m] == 0) continue;
      const auto f = static_cast<double>(row[x]);
      const double v = turned.value[m];
      n += 1.0;
      sf += f;
      sm += v;
      sff += f * f;
      smm += v * v;
      sfm += f * v;
    }
  }
  if (n < kLeastOverlap * fixed.width * fixed.height) return -1.0;
  const double variances = (sff - sf * sf / n) * (smm - sm * sm / n);
  return variances > 0.0 ? (sfm - sf * sm / n) / std::sqrt(variances) : -1.0;
}

/// 1, s, 1/s, s², … up to the limit.
std::vector<double> steps(double limit, double step) {
  std::vector<double> values{0.0};
  const int count = static_cast<int>(std::ceil(limit / step - 1e-9));
  for (int k = 1; k <= count; ++k) {
    values.push_back(k * limit / count);
    values.push_back(-k * limit / count);
  }
  return values;
}

}  // namespace

std::vector<Affine> search_affine(const image::ScalarMap& fixed, const image::ScalarMap& moving,
                                  const AffineParams& params, std::size_t most) {
  const SplineImage spline(moving, 3);
  const Eigen::Vector2d fixed_middle((fixed.width - 1) / 2.0, (fixed.height - 1) / 2.0);
  const Eigen::Vector2d moving_middle((moving.width - 1) / 2.0, (moving.height - 1) / 2.0);
  const int reach_x = static_cast<int>(std::ceil(params.search_shift * fixed.width));
  const int reach_y = static_cast<int>(std::ceil(params.search_shift * fixed.height));
  std::vector<Candidate> candidates;
  for (const double turn_deg : steps(params.search_turn_deg, kTurnStepDeg)) {
    for (const double log_scale : steps(std::log(params.search_scale), std::log(kScaleStep))) {
      Candidate candidate;
      candidate.map.linear =
          std::exp(log_scale) * Eigen::Rotation2Dd(turn_deg * std::numbers::pi / 180.0).toRotationMatrix();
      candidate.map.shift = moving_middle - candidate.map.linear * fixed_middle;
      candidates.push_back(candidate);
    }
  }
  tbb::parallel_for(std::size_t{0}, candidates.size(), [&](std::size_t c) {
    Candidate& candidate = candidates[c];
    const Turned turned = turn(spline, fixed, candidate.map, reach_x, reach_y);
    Eigen::Vector2d best_shift = Eigen::Vector2d::Zero();
    for (int dy = -reach_y; dy <= reach_y; ++dy) {
      for (int dx = -reach_x; dx <= reach_x; ++dx) {
        const double value = correlation(fixed, turned, dx, dy);
        if (value > candidate.correlation) {
          candidate.correlation = value;
          best_shift = {dx, dy};
        }
      }
    }
    candidate.map.shift += candidate.map.linear * best_shift;
  });
  std::erase_if(candidates, [](const Candidate& candidate) { return candidate.correlation <= 0.0; });
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.correlation > b.correlation; });
  std::vector<Affine> best;
  for (const Candidate& candidate : candidates) {
    if (best.size() < most) best.push_back(candidate.map);
  }
  return best;
}

}  // namespace interglow::fitting
