// SPDX-License-Identifier: GPL-3.0-or-later
/// Captured spectral images: from what a camera counted to linear values with a known noise.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "diagnostics/error.h"
#include "image/spectral_image.h"

namespace interglow::fitting {

/// Noise of one raw value whose mean is x counts above the dark level:
///   σ²(x) = read_sigma² + shot_gain · max(x, 0) + quantisation_step² / 12 + (relative_sigma · x)²
struct SensorNoise {
  double read_sigma = 0.0;         ///< standard deviation in the dark [counts]; at least 0
  double shot_gain = 0.0;          ///< variance per count of signal = counts per electron [counts]; at least 0
  double quantisation_step = 0.0;  ///< [counts]: 1 for whole numbers, 0 for floats; at least 0
  double relative_sigma = 0.0;     ///< pixel response non-uniformity that no white frame took out [1]; at least 0

  double variance(double signal) const;  ///< [counts²]
  /// Quantisation alone is not what a sensor's noise is.
  bool known() const { return read_sigma > 0.0 || shot_gain > 0.0 || relative_sigma > 0.0; }
};

/// Raw frames of one camera setting. All have the size and the bands of `object`.
struct CaptureFrames {
  image::SpectralImage object;                ///< [counts]
  std::vector<image::SpectralImage> dark{};   ///< shutter closed, same exposure; their mean is subtracted from all
  std::vector<image::SpectralImage> white{};  ///< a white target in place of the objects; their mean divides
  std::vector<std::uint8_t> mask{};           ///< height × width, not 0: takes part; empty: all
};

struct CaptureParams {
  SensorNoise noise{};
  /// Highest raw value that can be trusted [counts]; unset: 2^bits - 2, that is all below full scale; with neither,
  /// nothing counts as saturated.
  std::optional<double> saturation{};
  /// Of the converter, 1 to 32. Values beyond 2^bits - 1 contradict it.
  std::optional<int> bits{};
  /// Offset of the sensor where there is no dark frame [counts].
  double dark_level = 0.0;
  /// Exposure of each band, in any unit; divides the bands. Empty: all 1. Positive. Cancels with a white frame.
  Eigen::VectorXd exposure{};
  /// Reflectance (radiance factor) of the white target, one a band, or a single value for all. In (0, 1.2].
  Eigen::VectorXd white_reflectance = Eigen::VectorXd::Ones(1);
  /// Pixels around a saturated one that are left out as well [px]: blooming and blur carry its unknown excess there.
  int saturation_margin_px = 1;
  /// Pixels whose white signal is below this share of the band's median white are left out: the target does not
  /// reach there. In [0, 1).
  double least_white = 0.05;
};

/// Photon transfer: read_sigma² + step² / 12 is the mean variance of a pixel over the dark frames; shot_gain is what
/// the variance over the white frames has beyond it, over their mean signal. Differences between pixels drop out; a
/// lamp that flickers between white frames counts as shot noise. Pixels that are not finite in some frame are left out.
/// @pre 2 or more dark and 2 or more white frames of one size
/// @throws InvalidInput if the white frames are no brighter than the dark ones
SensorNoise estimate_noise(const CaptureFrames& frames, double quantisation_step);

/// Throws InvalidParams, naming field, value and range. `bands`: of the object frame.
void validate(const CaptureParams& params, int bands);

/// A corrected capture. value = value_per_count · (raw - dark).
///
/// Without a white frame values are counts over the band's exposure: proportional to radiance by one unknown factor a
/// band. With one they are radiance factors (π L / E, E the lamp's irradiance on the white target at that pixel).
struct Capture {
  image::SpectralImage image;          ///< linear; 0 where `use` is 0 because a value is not finite
  std::vector<std::uint8_t> use;       ///< height × width; 1: takes part in fits
  SensorNoise noise;                   ///< of the raw values [counts]
  std::vector<float> value_per_count;  ///< one a band; with a white frame height × width × bands
  Eigen::VectorXd white_reflectance;   ///< one a band; empty without a white frame
  int dark_frames = 0;
  int white_frames = 0;
  int bits = 0;                        ///< 0: not declared
  std::optional<double> saturation{};  ///< [counts]
  std::size_t used = 0;                ///< pixels, and why others are not:
  std::size_t masked = 0;              ///< by the mask
  std::size_t saturated = 0;           ///< with a band at saturation, or within its margin
  std::size_t invalid = 0;             ///< not finite, or no white signal
  Warnings warnings;

  bool has_white() const { return white_frames > 0; }
  /// Variance of a value with the mean `value` at a pixel (row · width + column), in the unit of `image` squared: noise
  /// of the object frame, of the mean dark frame and of the mean white frame, as independent. 0 if no noise is known.
  double variance(std::size_t pixel, int band, double value) const;
  /// The same at the captured value itself.
  double variance(std::size_t pixel, int band) const;
};

/// Subtracts the dark, divides by exposure or white, and says which pixels can be used.
/// @throws InvalidParams; InvalidInput naming the frame, its size or bands and the object's, a band that the white
///         target does not light, counts that the bit depth cannot hold, or that no pixel is left (with the reasons)
/// Cost O(pixels × bands).
Capture correct_capture(const CaptureFrames& frames, const CaptureParams& params = {});

}  // namespace interglow::fitting
