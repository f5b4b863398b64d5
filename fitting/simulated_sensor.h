// SPDX-License-Identifier: GPL-3.0-or-later
/// A multispectral camera: from radiance to the counts it would have recorded.
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "fitting/affine_registration.h"
#include "fitting/capture.h"

namespace interglow::fitting {

struct SensorParams {
  int bits = 12;                     ///< of the converter, 2 to 16
  double full_well_electrons = 2e4;  ///< at full scale; above 0. Shot noise is the root of the electrons.
  double read_electrons = 10.0;      ///< standard deviation of the read noise; at least 0
  double black_counts = 64.0;        ///< level without light, in the dark frames too; in [0, full scale)
  /// Brightest band and pixel (99.9th percentile, white frame included) over full scale, at the exposure that results;
  /// above 1 saturates. Above 0.
  double peak = 0.8;
  /// Every band gets an exposure of its own that reaches `peak`, as with a tunable filter; otherwise all share one.
  bool expose_bands = false;
  /// Unknown gain of each band, drawn uniformly from 1 ± this. In [0, 1).
  double gain_spread = 0.0;
  /// Gaussian blur of the lens, the same in all bands [px]. At least 0; below 0.5 a pixel hardly sees it.
  double blur_px = 0.0;
  /// Share of the light that the lens spreads evenly over the picture: L → (1 - glare) L + glare · mean L. In [0, 1).
  double glare = 0.0;
  /// Light that reaches the sensor beside the picture and not its dark frames, over the brightest value of the band.
  /// At least 0.
  double stray = 0.0;
  /// Standard deviation of the pixels' responses, the same in all bands and frames; at least 0.
  double response_sigma = 0.0;
  /// Where in the ideal picture a pixel of the sensor looks: ideal position = map (sensor position).
  Affine ideal_from_sensor{};
  int dark_frames = 1;   ///< at least 0
  int white_frames = 0;  ///< at least 0
  std::uint64_t seed = 1;
};

void validate(const SensorParams& params);  ///< Throws InvalidParams, naming field, value and range.

struct SensorOutput {
  CaptureFrames frames;                 ///< whole counts from 0 to 2^bits - 1
  Eigen::VectorXd band_gain;            ///< drawn, one a band
  Eigen::VectorXd exposure;             ///< one a band; largest 1
  Eigen::VectorXd counts_per_radiance;  ///< gain and exposure together, one a band
  Eigen::VectorXd offset_counts;        ///< glare's veil and stray light, one a band; the dark frames lack them
  SensorNoise noise;                    ///< in counts
  double saturated_share = 0.0;         ///< of the pixels, those with a band at full scale
};

/// In this order: blur, resampling by the map (quintic B-splines, mirrored beyond the border), glare, stray light, gain
/// and exposure, shot noise (Poisson), response of the pixels, read noise (normal), black level, rounding, clipping.
///
/// @param radiance        at least 4 × 4 pixels, finite
/// @param white_radiance  of the white target, one a band; needed for white frames, which are even over the picture
/// @throws InvalidParams; InvalidInput if the radiance is not finite or has no light
/// Cost O(pixels × bands × (blur² + frames)). A function of its arguments, on any number of threads.
SensorOutput simulate_sensor(const image::SpectralImage& radiance, const SensorParams& params,
                             const Eigen::VectorXd& white_radiance = {});

}  // namespace interglow::fitting
