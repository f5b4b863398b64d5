// SPDX-License-Identifier: GPL-3.0-or-later
/// How far two spectra or colours are apart.
#pragma once

#include <Eigen/Core>
#include <optional>

namespace interglow::spectral {

/// Angle [rad] between two spectra as vectors, arccos(a·b / (|a| |b|)) [tominaga-guarnera-2021, eq. 14], to full
/// precision for small angles too. Independent of either's level. Empty if one of them is 0.
/// @pre same size
std::optional<double> spectral_angle(const Eigen::Ref<const Eigen::VectorXd>& a,
                                     const Eigen::Ref<const Eigen::VectorXd>& b);

/// Distance of two encoded sRGB colours in 0..1 [tominaga-guarnera-2021, eq. 15]; in [0, sqrt(3)].
inline double delta_srgb(const Eigen::Vector3d& encoded_a, const Eigen::Vector3d& encoded_b) {
  return (encoded_a - encoded_b).norm();
}

/// CIEDE2000 difference of two L*a*b* colours, kL = kC = kH = 1 [sharma-2005]. Made for small differences of surface
/// colours; for luminous or fluorescent ones (L* > 100) it is outside its domain.
double ciede2000(const Eigen::Vector3d& lab_a, const Eigen::Vector3d& lab_b);

/// Root of the mean squared difference.
/// @pre same size, at least 1
double root_mean_square_difference(const Eigen::Ref<const Eigen::VectorXd>& a,
                                   const Eigen::Ref<const Eigen::VectorXd>& b);

}  // namespace interglow::spectral
