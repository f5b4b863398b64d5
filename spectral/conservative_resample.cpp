// SPDX-License-Identifier: GPL-3.0-or-later
#include "spectral/conservative_resample.h"

#include <algorithm>
#include <cassert>
#include <vector>

namespace interglow::spectral {
namespace {

/// Within one band, x in [0, 1]: left + x (right - left + curvature (1 - x)).
struct Parabola {
  double left;
  double right;
  double curvature;

  /// Integral from 0 to x.
  double integral(double x) const { return x * (left + x * (0.5 * (right - left) + curvature * (0.5 - x / 3.0))); }
};

/// Value at the edge between bands i and i + 1: slope of the quartic through the cumulated table at the five edges
/// around it where there are four, the width-weighted mean otherwise; never beyond the two means.
double edge_value(const Eigen::VectorXd& edges, const Eigen::VectorXd& mean, Eigen::Index i) {
  const auto width = [&](Eigen::Index band) { return edges[band + 1] - edges[band]; };
  const double h1 = width(i);
  const double h2 = width(i + 1);
  double value = (h2 * mean[i] + h1 * mean[i + 1]) / (h1 + h2);
  if (i >= 1 && i + 2 < mean.size()) {
    const double h0 = width(i - 1);
    const double h3 = width(i + 2);
    // Newton's divided differences of the cumulated table at edges i+1, i, i+2, i-1 and i+3.
    const double second = (mean[i + 1] - mean[i]) / (h1 + h2);
    const double second_left = (mean[i] - mean[i - 1]) / (h0 + h1);
    const double second_right = (mean[i + 2] - mean[i + 1]) / (h2 + h3);
    const double third_left = (second - second_left) / (h0 + h1 + h2);
    const double third_right = (second_right - second) / (h1 + h2 + h3);
    const double fourth = (third_right - third_left) / (h0 + h1 + h2 + h3);
    // Derivative at edge i+1 of the quartic in Newton form on the nodes i, i+1, i+2, i-1, i+3.
    value = mean[i] + h1 * second - h1 * h2 * third_left - h1 * h2 * (h0 + h1) * fourth;
  }
  return std::clamp(value, std::min(mean[i], mean[i + 1]), std::max(mean[i], mean[i + 1]));
}

std::vector<Parabola> parabolas(const Eigen::VectorXd& edges, const Eigen::VectorXd& mean) {
  const Eigen::Index n = mean.size();
  std::vector<Parabola> bands(static_cast<std::size_t>(n));
  for (Eigen::Index i = 0; i < n; ++i) {
    const double a = mean[i];
    double left = i > 0 ? edge_value(edges, mean, i - 1) : a;
    double right = i + 1 < n ? edge_value(edges, mean, i) : a;
    if ((right - a) * (a - left) <= 0.0) {
      left = right = a;
    } else {
      const double difference = right - left;
      const double lean = difference * (a - 0.5 * (left + right));
      if (lean > difference * difference / 6.0) left = 3.0 * a - 2.0 * right;
      if (lean < -difference * difference / 6.0) right = 3.0 * a - 2.0 * left;
    }
    bands[static_cast<std::size_t>(i)] = {left, right, 6.0 * (a - 0.5 * (left + right))};
  }
  return bands;
}

}  // namespace

Eigen::VectorXd resample_means(const Eigen::VectorXd& edges, const Eigen::VectorXd& mean,
                               const Eigen::VectorXd& new_edges) {
  assert(edges.size() == mean.size() + 1 && new_edges.size() > 0);
  const std::vector<Parabola> bands = parabolas(edges, mean);
  Eigen::VectorXd result = Eigen::VectorXd::Zero(new_edges.size() - 1);
  Eigen::Index old_band = 0;
  for (Eigen::Index band = 0; band < result.size(); ++band) {
    const double lower = new_edges[band];
    const double upper = new_edges[band + 1];
    while (old_band < mean.size() && edges[old_band + 1] <= lower) ++old_band;
    double integral = 0.0;
    for (Eigen::Index i = old_band; i < mean.size() && edges[i] < upper; ++i) {
      const double width = edges[i + 1] - edges[i];
      const double from = std::max(0.0, (lower - edges[i]) / width);
      const double to = std::min(1.0, (upper - edges[i]) / width);
      if (from == 0.0 && to == 1.0) {
        integral += width * mean[i];  // exact, whatever the rounding of the parabola
      } else if (to > from) {
        const Parabola& parabola = bands[static_cast<std::size_t>(i)];
        integral += width * (parabola.integral(to) - parabola.integral(from));
      }
    }
    result[band] = integral / (upper - lower);
  }
  return result;
}

}  // namespace interglow::spectral
