// SPDX-License-Identifier: GPL-3.0-or-later
/// Aligns two images of the same scene by an affine map, with gain and offset of the intensities.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "image/png.h"
#include "image/spectral_image.h"

namespace interglow::fitting {

/// moving position = linear · fixed position + shift, in pixels; pixel centres at whole coordinates, x right, y down.
struct Affine {
  Eigen::Matrix2d linear = Eigen::Matrix2d::Identity();
  Eigen::Vector2d shift = Eigen::Vector2d::Zero();

  Eigen::Vector2d operator()(const Eigen::Vector2d& fixed_px) const { return linear * fixed_px + shift; }
};

/// Root of the mean squared distance between where two maps take the four corners of an image [px].
double corner_rms_px(const Affine& a, const Affine& b, int width, int height);

struct AffineParams {
  /// Order of the B-spline: 3, or 5, which costs 1.6 times as much and errs less at fine detail.
  int spline_order = 5;
  /// Gaussian blur of both images before the last level [px]: interpolation errs less, noise counts less. At least 0.
  double prefilter_sigma_px = 1.0;
  /// Residuals beyond this many robust standard deviations count linearly (Huber). Above 0.
  double huber_sigmas = 3.0;
  /// Pixels this close to the border of either image are left out, more by 3 sigmas of the prefilter. At least 0.
  double border_px = 2.0;
  /// Where to begin; unset: a search over all turns, scales and shifts below, at a coarse level.
  std::optional<Affine> start{};
  /// Range of the search: turns by up to this much to either side [degrees]. In [0, 180].
  double search_turn_deg = 25.0;
  /// Scales by up to this factor and its inverse. In [1, 4].
  double search_scale = 1.25;
  /// Shifts by up to this share of the image's sides. In [0, 1].
  double search_shift = 0.3;
  /// Only these pixels of the fixed image count: height × width, not 0: yes. Empty: all.
  std::vector<std::uint8_t> fixed_mask{};
  /// Steps per level. At least 1.
  int most_iterations = 60;
};

void validate(const AffineParams& params);  ///< Throws InvalidParams, naming field, value and range.

/// fixed(x) = gain · moving(moving_from_fixed(x)) + offset.
struct AffineRegistration {
  Affine moving_from_fixed;
  double gain = 1.0;
  double offset = 0.0;
  /// Of (a11, a12, a21, a22, shift x, shift y) at the middle of the fixed image, that is of the map
  /// x ↦ linear (x - middle) + middle + shift. Sandwich form: holds for residuals that are correlated between pixels.
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  double corner_sd_px = 0.0;   ///< root mean square over the corners of the predicted standard deviation of position
  double residual_sd = 0.0;    ///< robust, in the unit of the fixed image (after the prefilter)
  double correlation = 0.0;    ///< of the two images over the overlap
  double overlap_share = 0.0;  ///< pixels used over pixels of the fixed image (or mask)
  int iterations = 0;          ///< at the last level
  bool converged = false;
};

/// Minimises Σ ρ(fixed(x) - gain · moving(A x + t) - offset) over A, t, gain and offset, by Levenberg-Marquardt from
/// the coarse to the fine level of a Gaussian pyramid. Images may differ in size.
///
/// @throws InvalidParams; InvalidInput if an image has fewer than 16 pixels a side, is constant, or no position of the
///         search lays a third of one on the other
/// Cost O(pixels × iterations): about 0.3 s for 256² on one core. Same bits for any number of threads.
AffineRegistration register_affine(const image::ScalarMap& fixed, const image::ScalarMap& moving,
                                   const AffineParams& params = {});

/// Mean over the bands, for the registration of spectral images.
image::ScalarMap mean_over_bands(const image::SpectralImage& image);

struct WarpedImage {
  image::SpectralImage image;         ///< 0 where not covered
  std::vector<std::uint8_t> covered;  ///< height × width; 1 where the moving image has a value
};

/// The moving image resampled at the fixed image's pixels, band by band, by B-splines. @throws as SplineImage.
WarpedImage warp(const image::SpectralImage& moving, const Affine& moving_from_fixed, int width, int height,
                 int spline_order = 5);

}  // namespace interglow::fitting
