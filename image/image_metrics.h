// SPDX-License-Identifier: GPL-3.0-or-later
/// How far two spectral images are apart, as numbers and as maps.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "image/png.h"
#include "image/spectral_image.h"

namespace interglow::image {

struct CompareParams {
  /// Pixels to compare, height × width, not 0: yes. Empty: the pixels in which either image is not black.
  std::vector<std::uint8_t> mask{};
  /// Exposure of both images' colours (preview.h); unset: the reference's automatic one.
  std::optional<double> exposure{};
  /// XYZ of the lamp's white, to be adapted to D65; unset: not adapted.
  std::optional<Eigen::Vector3d> adapt_from_white{};
};

/// Mean and standard deviation (of the population) over `count` pixels; 0 if there are none.
struct Statistic {
  double mean = 0.0;
  double standard_deviation = 0.0;
  double largest = 0.0;
  std::size_t count = 0;
};

/// Differences of `image` from `reference`. Maps hold not-a-number where a value is undefined or a pixel is masked.
struct ImageComparison {
  std::size_t pixels = 0;  ///< compared
  double exposure = 1.0;   ///< used for both
  double image_clipped_share = 0.0;
  double reference_clipped_share = 0.0;
  Statistic spectral_angle_deg;  ///< over pixels in which neither spectrum is 0 [tominaga-guarnera-2021, eq. 14]
  Statistic delta_srgb;          ///< of encoded colours [tominaga-guarnera-2021, eq. 15]
  Statistic ciede2000;           ///< against the D65 white of the exposure; not meant for luminous colours (L* > 100)
  std::size_t above_white = 0;   ///< pixels with L* > 100 in either, where CIEDE2000 is outside its domain
  double rmse = 0.0;             ///< over all compared pixels and bands, in the images' unit
  double relative_rmse = 0.0;    ///< divided by the reference's mean over the same (not finite if that is 0)
  double mean_difference = 0.0;  ///< image minus reference
  double relative_mean_difference = 0.0;
  Eigen::VectorXd band_rmse;           ///< one a band
  Eigen::VectorXd band_relative_rmse;  ///< divided by the reference's mean of that band (not finite where that is 0)
  ScalarMap spectral_angle_deg_map;
  ScalarMap delta_srgb_map;
  ScalarMap ciede2000_map;
  ScalarMap relative_rmse_map;  ///< of the pixel's bands, divided by the reference's mean over all compared
};

/// Compares pixel by pixel. The images must have the same size and the same wavelengths (to 0.01 nm); images of
/// different registration are to be aligned before.
/// @throws InvalidParams naming both sizes, or the first wavelength that differs; if no pixel is left to compare.
/// Cost O(pixels × bands).
ImageComparison compare(const SpectralImage& image, const SpectralImage& reference, const CompareParams& params = {});

}  // namespace interglow::image
