// SPDX-License-Identifier: GPL-3.0-or-later
/// What a spectral image looks like on a display.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "image/spectral_image.h"

namespace interglow::image {

struct PreviewParams {
  /// Factor from XYZ (spectral sums over the image's bands, unit of the image times nm) to the display's white = 1. Use
  /// one for all images that are to be compared. Unset: such that `automatic_percentile` of the lit pixels have a
  /// luminance of at most `automatic_level`. Positive.
  std::optional<double> exposure{};
  /// In (0, 1].
  double automatic_percentile = 0.99;
  /// Of the display's white, linear; positive.
  double automatic_level = 0.7;
  /// XYZ of the lamp's white, to be adapted to D65 (Bradford); unset: the lamp's tint stays visible.
  std::optional<Eigen::Vector3d> adapt_from_white{};
};

void validate(const PreviewParams& params);  ///< Throws InvalidParams, naming field, value and range.

/// Linear sRGB, exposure applied, not clipped.
struct RgbImage {
  int width = 0;
  int height = 0;
  std::vector<float> value;    ///< height × width × 3
  double exposure = 1.0;       ///< the factor that was used
  double clipped_share = 0.0;  ///< of the lit pixels, those with a channel beyond 0..1 (by more than 1e-4)
};

/// XYZ of every pixel with the CIE 1931 observer, height × width rows. An image of one band is grey: its value is taken
/// for the luminance, with the chromaticity of D65.
Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> tristimulus_image(const SpectralImage& image);

/// The exposure that `make_preview` takes by itself; 1 for a black image.
double automatic_exposure(const SpectralImage& image, const PreviewParams& params = {});

/// Spectra to XYZ to linear sRGB with one exposure. A pixel is lit if its luminance is positive.
/// @throws InvalidParams; InvalidInput if the shipped observer is not found.
/// Cost O(pixels × bands).
RgbImage make_preview(const SpectralImage& image, const PreviewParams& params = {});

}  // namespace interglow::image
