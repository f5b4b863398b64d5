// SPDX-License-Identifier: GPL-3.0-or-later
#include "spectral/spectral_metrics.h"

#include <cassert>
#include <cmath>
#include <numbers>

namespace interglow::spectral {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;

/// Hue angle in [0, 2π), 0 for grey.
double hue_of(double a, double b) {
  if (a == 0.0 && b == 0.0) return 0.0;
  const double angle = std::atan2(b, a);
  return angle < 0.0 ? angle + 2.0 * std::numbers::pi : angle;
}

/// c^7 / (c^7 + 25^7), the weight of neutral colours.
double chroma_weight(double chroma) {
  const double c7 = std::pow(chroma, 7);
  return std::sqrt(c7 / (c7 + 6103515625.0));
}

/// Difference and mean of two hues (eq. 10 and 14 of Sharma et al.); undefined hues count as 0.
struct HuePair {
  double difference;
  double mean;
};
HuePair hue_pair(double h1, double h2, bool grey) {
  constexpr double kPi = std::numbers::pi;
  if (grey) return {0.0, h1 + h2};
  double difference = h2 - h1;
  double mean = 0.5 * (h1 + h2);
  if (std::abs(difference) > kPi) mean += h1 + h2 < 2.0 * kPi ? kPi : -kPi;
  if (difference > kPi) difference -= 2.0 * kPi;
  if (difference < -kPi) difference += 2.0 * kPi;
  return {difference, mean};
}

}  // namespace

std::optional<double> spectral_angle(const Eigen::Ref<const Eigen::VectorXd>& a,
                                     const Eigen::Ref<const Eigen::VectorXd>& b) {
  assert(a.size() == b.size());
  const double norm_a = a.norm();
  const double norm_b = b.norm();
  if (!(norm_a > 0.0) || !(norm_b > 0.0)) return std::nullopt;
  // Half the angle from the difference and the sum of the unit vectors: arccos would lose half of the digits near 0.
  double difference = 0.0;
  double sum = 0.0;
  for (Eigen::Index i = 0; i < a.size(); ++i) {
    const double x = a[i] / norm_a;
    const double y = b[i] / norm_b;
    difference += (x - y) * (x - y);
    sum += (x + y) * (x + y);
  }
  return 2.0 * std::atan2(std::sqrt(difference), std::sqrt(sum));
}

double ciede2000(const Eigen::Vector3d& lab_a, const Eigen::Vector3d& lab_b) {
  const double mean_chroma = 0.5 * (std::hypot(lab_a[1], lab_a[2]) + std::hypot(lab_b[1], lab_b[2]));
  const double stretch = 1.0 + 0.5 * (1.0 - chroma_weight(mean_chroma));
  const double a1 = stretch * lab_a[1];
  const double a2 = stretch * lab_b[1];
  const double c1 = std::hypot(a1, lab_a[2]);
  const double c2 = std::hypot(a2, lab_b[2]);
  const HuePair hue = hue_pair(hue_of(a1, lab_a[2]), hue_of(a2, lab_b[2]), c1 * c2 == 0.0);

  const double dL = lab_b[0] - lab_a[0];
  const double dC = c2 - c1;
  const double dH = 2.0 * std::sqrt(c1 * c2) * std::sin(0.5 * hue.difference);
  const double L = 0.5 * (lab_a[0] + lab_b[0]);
  const double C = 0.5 * (c1 + c2);
  const double T = 1.0 - 0.17 * std::cos(hue.mean - 30.0 * kDegree) + 0.24 * std::cos(2.0 * hue.mean) +
                   0.32 * std::cos(3.0 * hue.mean + 6.0 * kDegree) - 0.20 * std::cos(4.0 * hue.mean - 63.0 * kDegree);
  const double lightness = (L - 50.0) * (L - 50.0);
  const double sL = 1.0 + 0.015 * lightness / std::sqrt(20.0 + lightness);
  const double sC = 1.0 + 0.045 * C;
  const double sH = 1.0 + 0.015 * C * T;
  const double around_blue = (hue.mean / kDegree - 275.0) / 25.0;
  const double rotation = -2.0 * chroma_weight(C) * std::sin(60.0 * kDegree * std::exp(-around_blue * around_blue));
  const double l = dL / sL;
  const double c = dC / sC;
  const double h = dH / sH;
  return std::sqrt(l * l + c * c + h * h + rotation * c * h);
}

double root_mean_square_difference(const Eigen::Ref<const Eigen::VectorXd>& a,
                                   const Eigen::Ref<const Eigen::VectorXd>& b) {
  assert(a.size() == b.size() && a.size() > 0);
  return std::sqrt((a - b).squaredNorm() / static_cast<double>(a.size()));
}

}  // namespace interglow::spectral
