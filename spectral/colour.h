// SPDX-License-Identifier: GPL-3.0-or-later
/// Tristimulus values to sRGB and CIELAB.
#pragma once

#include <Eigen/Core>

namespace interglow::spectral {

/// White of CIE standard illuminant D65, 2 degree observer, Y = 1: the white of sRGB.
inline const Eigen::Vector3d kD65White{0.95047, 1.0, 1.08883};

/// Linear sRGB from XYZ with Y = 1 for white (IEC 61966-2-1 primaries, D65), not clipped: fluorescent colours leave
/// 0..1 on both sides.
Eigen::Vector3d linear_srgb(const Eigen::Vector3d& xyz);

/// sRGB encoding of a linear value, which is clipped to 0..1 first: 12.92 v up to 0.0031308, 1.055 v^(1/2.4) - 0.055
/// above.
double encoded_srgb(double linear);
inline Eigen::Vector3d encoded_srgb(const Eigen::Vector3d& linear) {
  return {encoded_srgb(linear[0]), encoded_srgb(linear[1]), encoded_srgb(linear[2])};
}

/// Inverse of `encoded_srgb` on 0..1.
double decoded_srgb(double encoded);

/// Adaptation by the linear Bradford transform: maps `from_white` to `to_white` (both XYZ). Without it a scene lit by a
/// lamp keeps the lamp's tint relative to D65.
/// @throws InvalidParams if a white has no positive cone response.
Eigen::Matrix3d bradford_adaptation(const Eigen::Vector3d& from_white, const Eigen::Vector3d& to_white = kD65White);

/// CIE 1976 L*, a*, b* relative to `white`.
Eigen::Vector3d cielab(const Eigen::Vector3d& xyz, const Eigen::Vector3d& white = kD65White);

}  // namespace interglow::spectral
