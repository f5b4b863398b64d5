// SPDX-License-Identifier: GPL-3.0-or-later
/// A picture from elsewhere (another renderer, a capture) as the reference of a check.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <optional>

#include "cross_check/path_tracer.h"
#include "image/spectral_image.h"
#include "scene/scene.h"

namespace interglow::verification {

struct ReferenceImage {
  image::SpectralImage mean;
  std::optional<image::SpectralImage> standard_error;
  bool grey = false;  ///< one channel: luminance for spectral scenes
};

/// Reads spectral or grey EXR files. A picture larger than `largest_side_px` is averaged over whole blocks of pixels,
/// its standard error as of independent pixels.
/// @throws InvalidInput if a file cannot be read, sizes or bands of the two differ, or the size is not a multiple of
///         the blocks that `largest_side_px` needs
ReferenceImage read_reference(const std::filesystem::path& mean, const std::filesystem::path& standard_error,
                              std::optional<int> largest_side_px);

/// The bands of the reference from those of a picture, as a matrix (reference bands × picture bands): linear
/// interpolation between band centres. For a grey reference the luminance Σ ȳ L Δλ / Σ ȳ Δλ (the mean radiance that the
/// eye's sensitivity weights), which is L itself for grey light.
/// @throws InvalidInput if the reference has bands outside the picture's
Eigen::MatrixXd band_conversion(const ReferenceImage& reference, const Eigen::VectorXd& wavelength_nm);

image::SpectralImage convert_bands(const image::SpectralImage& image, const Eigen::MatrixXd& conversion,
                                   const Eigen::VectorXd& wavelength_nm);

/// Converts the mean; standard errors as of bands that vary together (an upper bound).
cross_check::Estimate convert_bands(const cross_check::Estimate& estimate, const Eigen::MatrixXd& conversion,
                                    const Eigen::VectorXd& wavelength_nm, const Eigen::VectorXd& band_width_nm);

}  // namespace interglow::verification
