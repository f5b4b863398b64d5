// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/row_budget.h"

#include <algorithm>
#include <cmath>

namespace interglow::radiosity {
namespace {

/// Standard deviation of one line [mm²].
double spread(const SampledPair& pair) {
  const double share = pair.whole > 0.0 ? pair.seen / pair.whole : 0.5;
  // Lines that agree so far may still be wrong about the rest.
  const double in_doubt = LineSampler::kDoubt / std::sqrt(std::max(1, pair.lines));
  return pair.exchange * std::max(std::sqrt(share * (1.0 - share)), in_doubt);
}

}  // namespace

void share_budget(const Elements& elements, const Eigen::VectorXd& budget,
                  std::span<std::vector<UnsettledPair>> lists) {
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(elements.size());
  for (const std::vector<UnsettledPair>& list : lists) {
    for (const UnsettledPair& unsettled : list) {
      const double s = spread(unsettled.pair);
      for (const int e : {unsettled.pair.i, unsettled.pair.j}) sum[e] += s / elements.area_mm2[e];
    }
  }
  for (std::vector<UnsettledPair>& list : lists) {
    for (UnsettledPair& unsettled : list) {
      SampledPair& pair = unsettled.pair;
      const auto share = [&](int e) { return elements.area_mm2[e] * budget[e] / sum[e]; };
      pair.tolerance = std::sqrt(std::min(share(pair.i), share(pair.j)) * spread(pair));
    }
  }
}

}  // namespace interglow::radiosity
