// SPDX-License-Identifier: GPL-3.0-or-later
#include "spectral/colour.h"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "diagnostics/error.h"

namespace interglow::spectral {

Eigen::Vector3d linear_srgb(const Eigen::Vector3d& xyz) {
  static const Eigen::Matrix3d kLinearSrgbFromXyz{
      {3.2404542, -1.5371385, -0.4985314}, {-0.9692660, 1.8760108, 0.0415560}, {0.0556434, -0.2040259, 1.0572252}};
  return kLinearSrgbFromXyz * xyz;
}

double encoded_srgb(double linear) {
  const double v = std::clamp(linear, 0.0, 1.0);
  return v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1.0 / 2.4) - 0.055;
}

double decoded_srgb(double encoded) {
  const double v = std::clamp(encoded, 0.0, 1.0);
  return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
}

Eigen::Matrix3d bradford_adaptation(const Eigen::Vector3d& from_white, const Eigen::Vector3d& to_white) {
  static const Eigen::Matrix3d kConesFromXyz{
      {0.8951, 0.2664, -0.1614}, {-0.7502, 1.7135, 0.0367}, {0.0389, -0.0685, 1.0296}};
  const Eigen::Vector3d from = kConesFromXyz * from_white;
  const Eigen::Vector3d to = kConesFromXyz * to_white;
  if (!(from.minCoeff() > 0.0) || !(to.minCoeff() > 0.0)) {
    throw InvalidParams(fmt::format(
        "chromatic adaptation: white {:.4g}, {:.4g}, {:.4g} (XYZ) has no positive cone response; expected a light with "
        "power over the visible range. Leave the adaptation out.",
        from_white[0], from_white[1], from_white[2]));
  }
  return kConesFromXyz.inverse() * to.cwiseQuotient(from).asDiagonal() * kConesFromXyz;
}

Eigen::Vector3d cielab(const Eigen::Vector3d& xyz, const Eigen::Vector3d& white) {
  const auto f = [](double t) {
    constexpr double kDelta = 6.0 / 29.0;
    return t > kDelta * kDelta * kDelta ? std::cbrt(t) : t / (3.0 * kDelta * kDelta) + 4.0 / 29.0;
  };
  const double x = f(xyz[0] / white[0]);
  const double y = f(xyz[1] / white[1]);
  const double z = f(xyz[2] / white[2]);
  return {116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)};
}

}  // namespace interglow::spectral
