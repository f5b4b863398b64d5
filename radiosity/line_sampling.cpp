// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/line_sampling.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

namespace interglow::radiosity {

using Eigen::Vector3d;

void LineSampler::clear() {
  segments_.clear();
  weights_.clear();
}

void LineSampler::trace() {
  blocked_.resize(segments_.size());
  visibility_.blocked(segments_, blocked_);
}

/// Points of a rank-1 lattice in four dimensions (powers of the root of x^5 = x + 1), shifted from pair to pair.
bool LineSampler::add_line(int i, int j, int number) {
  constexpr std::array<double, 4> kStep = {0.8566748838545029, 0.733891856627126, 0.6287067210378087,
                                           0.5385972572236101};
  std::array<double, 4> x;
  for (std::size_t k = 0; k < 4; ++k) {
    const double turn = 0.5 + (number + 1) * kStep[k] + i * kStep[(k + 1) % 4] + j * kStep[(k + 2) % 4];
    x[k] = turn - std::floor(turn);
  }
  const auto at = [](const Polygon& polygon, double u, double v, double& weight) -> Vector3d {
    const auto& [a, b, c, d] = polygon.corner;
    if (polygon.corners == 3) {
      if (u + v > 1.0) {
        u = 1.0 - u;
        v = 1.0 - v;
      }
      return a + u * (b - a) + v * (c - a);
    }
    weight *= ((1 - v) * (b - a) + v * (c - d)).cross((1 - u) * (d - a) + u * (c - b)).norm();
    return (1 - u) * ((1 - v) * a + v * d) + u * ((1 - v) * b + v * c);
  };
  // Of a quad the Jacobian over its area: 1 on average, as for a triangle.
  double weight = 1.0;
  for (const int e : {i, j}) {
    if (tree_.polygon(e).corners == 4) weight /= elements_.area_mm2[e];
  }
  const Vector3d p = at(tree_.polygon(i), x[0], x[1], weight);
  const Vector3d q = at(tree_.polygon(j), x[2], x[3], weight);
  const Vector3d line = q - p;
  const double cosines =
      std::max(0.0, elements_.normal.row(i).dot(line)) * std::max(0.0, -elements_.normal.row(j).dot(line));
  if (cosines <= 0.0) return false;
  const double squared = line.squaredNorm();
  weights_.push_back(weight * cosines / (squared * squared));
  segments_.push_back({p, q, elements_.face[static_cast<std::size_t>(i)], elements_.face[static_cast<std::size_t>(j)]});
  return true;
}

void LineSampler::sample(std::vector<SampledPair>& pairs, int fewest, int most) {
  constexpr std::size_t kTogether = 4096;
  active_.clear();
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    if (pairs[k].lines == 0 || !settle(pairs[k])) active_.push_back(static_cast<int>(k));
  }
  for (int goal = fewest; goal <= most && !active_.empty(); goal *= 2) {
    std::size_t kept = 0;
    for (std::size_t first = 0; first < active_.size();) {
      clear();
      ends_.clear();
      std::size_t end = first;
      for (; end < active_.size() && segments_.size() < kTogether; ++end) {
        SampledPair& pair = pairs[static_cast<std::size_t>(active_[end])];
        for (; pair.lines < goal; ++pair.lines) add_line(pair.i, pair.j, pair.lines);
        ends_.push_back(segments_.size());
      }
      trace();
      std::size_t segment = 0;
      for (std::size_t k = first; k < end; ++k) {
        SampledPair& pair = pairs[static_cast<std::size_t>(active_[k])];
        for (; segment < ends_[k - first]; ++segment) {
          pair.whole += weights_[segment];
          if (blocked_[segment] == 0) pair.seen += weights_[segment];
        }
        if (!settle(pair)) active_[kept++] = active_[k];
      }
      first = end;
    }
    active_.resize(kept);
  }
}

/// The result of the lines so far; true if it meets the tolerance.
bool LineSampler::settle(SampledPair& pair) {
  // Lines that carry nothing tell nothing.
  const double share = pair.whole > 0.0 ? pair.seen / pair.whole : 0.5;
  pair.result.touched = share < 1.0;
  pair.result.covered = share == 0.0;
  pair.result.hidden = (1.0 - share) * pair.exchange;
  // A lattice does better than the spread of independent samples.
  pair.result.error_estimate = pair.exchange * (std::sqrt(share * (1.0 - share) / pair.lines) + kDoubt / pair.lines);
  if (!(pair.whole > 0.0)) pair.result.error_estimate = 0.5 * pair.exchange;
  return pair.result.error_estimate <= pair.tolerance;
}

}  // namespace interglow::radiosity
