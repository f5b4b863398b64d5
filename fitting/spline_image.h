// SPDX-License-Identifier: GPL-3.0-or-later
/// An image as a smooth function of continuous position.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "image/png.h"

namespace interglow::fitting {

/// Interpolating B-spline of order 3 or 5 through the pixel centres, which lie at whole coordinates (x right, y down).
/// Beyond its border the image continues mirrored about the outermost pixel centres. Unlike Catmull-Rom interpolation
/// it needs a prefilter (exact, recursive), and its gradients err far less at high frequencies [unser-1999].
class SplineImage {
 public:
  struct Sample {
    double value = 0.0;
    double dx = 0.0;  ///< per pixel
    double dy = 0.0;
  };

  /// @throws InvalidParams unless order is 3 or 5 and both sides have at least 4 pixels; InvalidInput if a value is not
  ///         finite, naming its row and column. Cost O(pixels).
  SplineImage(const image::ScalarMap& image, int order);

  int width() const { return width_; }
  int height() const { return height_; }

  /// Whether (x, y) lies between the outermost pixel centres, `margin` or more away from them.
  bool contains(double x, double y, double margin = 0.0) const {
    return x >= margin && y >= margin && x <= width_ - 1 - margin && y <= height_ - 1 - margin;
  }

  /// @pre contains(x, y)
  Sample sample(double x, double y) const;

 private:
  int width_ = 0;
  int height_ = 0;
  int order_ = 3;
  int stride_ = 0;
  std::vector<double> coefficient_;  ///< with a mirrored frame of kFrame pixels
};

/// The image blurred by a Gaussian (mirrored at the border, cut at 4 sigma). sigma_px = 0 returns it unchanged.
image::ScalarMap gaussian_blur(const image::ScalarMap& image, double sigma_px);

/// The same with the kernel exp(-½ dᵀ C⁻¹ d). C = 0 returns the image unchanged.
/// @throws InvalidParams unless C is 0 or positive definite. Cost O(pixels × |C|).
image::ScalarMap gaussian_blur(const image::ScalarMap& image, const Eigen::Matrix2d& covariance_px2);

}  // namespace interglow::fitting
