// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/spline_image.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "diagnostics/error.h"

namespace interglow::fitting {
namespace {

/// Enough for the taps of order 5 at any position within the image.
constexpr int kFrame = 3;
constexpr int kMostTaps = 6;

int mirrored(int index, int count) {
  const int period = 2 * count - 2;
  index = ((index % period) + period) % period;
  return index < count ? index : period - index;
}

/// Poles of the inverse of the sampled B-spline [unser-1999, table 1, in closed form].
std::vector<double> poles(int order) {
  if (order == 3) return {std::sqrt(3.0) - 2.0};
  const double root = std::sqrt(17745.0 / 4.0);
  return {std::sqrt(135.0 / 2.0 - root) + std::sqrt(105.0 / 4.0) - 13.0 / 2.0,
          std::sqrt(135.0 / 2.0 + root) - std::sqrt(105.0 / 4.0) - 13.0 / 2.0};
}

/// Turns the values of one line into B-spline coefficients, with exact start values for the mirrored signal.
void prefilter_line(std::vector<double>& line, const std::vector<double>& filter_poles) {
  const auto count = static_cast<std::ptrdiff_t>(line.size());
  const auto at = [&](std::ptrdiff_t i) -> double& { return line[static_cast<std::size_t>(i)]; };
  for (const double z : filter_poles) {
    for (double& value : line) value *= (1.0 - z) * (1.0 - 1.0 / z);
    double forward = z;
    double backward = std::pow(z, static_cast<double>(count - 1));
    double sum = at(0) + backward * at(count - 1);
    backward *= backward / z;
    for (std::ptrdiff_t i = 1; i + 1 < count; ++i) {
      sum += (forward + backward) * at(i);
      forward *= z;
      backward /= z;
    }
    at(0) = sum / (1.0 - forward * forward);
    for (std::ptrdiff_t i = 1; i < count; ++i) at(i) += z * at(i - 1);
    at(count - 1) = z / (z * z - 1.0) * (z * at(count - 2) + at(count - 1));
    for (std::ptrdiff_t i = count - 2; i >= 0; --i) at(i) = z * (at(i + 1) - at(i));
  }
}

struct Weights {
  std::array<double, kMostTaps> value{};
  std::array<double, kMostTaps> slope{};
};

/// Values and derivatives of the order + 1 B-splines over the cell at fraction t, by the recursion over orders.
Weights weights(double t, int order) {
  Weights w;
  w.value[0] = 1.0;
  for (int k = 1; k <= order; ++k) {
    if (k == order) {
      for (int j = k; j >= 0; --j) {
        const auto i = static_cast<std::size_t>(j);
        w.slope[i] = (j > 0 ? w.value[i - 1] : 0.0) - (j < k ? w.value[i] : 0.0);
      }
    }
    for (int j = k; j >= 0; --j) {
      const auto i = static_cast<std::size_t>(j);
      const double left = j > 0 ? (t + k - j) * w.value[i - 1] : 0.0;
      const double right = j < k ? (1.0 - t + j) * w.value[i] : 0.0;
      w.value[i] = (left + right) / k;
    }
  }
  return w;
}

}  // namespace

SplineImage::SplineImage(const image::ScalarMap& image, int order)
    : width_(image.width), height_(image.height), order_(order), stride_(image.width + 2 * kFrame) {
  if (order != 3 && order != 5) throw InvalidParams(fmt::format("order: {}; expected 3 or 5.", order));
  if (width_ < 4 || height_ < 4)
    throw InvalidParams(
        fmt::format("an image of {} × {} pixels; interpolation needs at least 4 × 4.", width_, height_));
  const auto w = static_cast<std::size_t>(width_);
  const auto h = static_cast<std::size_t>(height_);
  for (std::size_t p = 0; p < w * h; ++p) {
    if (!std::isfinite(image.value[p]))
      throw InvalidInput(fmt::format("row {}, column {}: {} is not finite.", p / w, p % w, image.value[p]));
  }
  const std::vector<double> filter_poles = poles(order);
  std::vector<double> plane(image.value.begin(), image.value.end());
  std::vector<double> line(w);
  for (std::size_t y = 0; y < h; ++y) {
    line.assign(plane.begin() + static_cast<std::ptrdiff_t>(y * w),
                plane.begin() + static_cast<std::ptrdiff_t>((y + 1) * w));
    prefilter_line(line, filter_poles);
    std::copy(line.begin(), line.end(), plane.begin() + static_cast<std::ptrdiff_t>(y * w));
  }
  line.resize(h);
  for (std::size_t x = 0; x < w; ++x) {
    for (std::size_t y = 0; y < h; ++y) line[y] = plane[y * w + x];
    prefilter_line(line, filter_poles);
    for (std::size_t y = 0; y < h; ++y) plane[y * w + x] = line[y];
  }
  coefficient_.reserve(static_cast<std::size_t>(stride_) * (h + 2 * kFrame));
  for (int y = -kFrame; y < height_ + kFrame; ++y) {
    const std::size_t row = static_cast<std::size_t>(mirrored(y, height_)) * w;
    for (int x = -kFrame; x < width_ + kFrame; ++x)
      coefficient_.push_back(plane[row + static_cast<std::size_t>(mirrored(x, width_))]);
  }
}

SplineImage::Sample SplineImage::sample(double x, double y) const {
  const double column = std::floor(x);
  const double row = std::floor(y);
  const Weights across = weights(x - column, order_);
  const Weights down = weights(y - row, order_);
  const int first = kFrame - (order_ - 1) / 2;
  const double* tap = coefficient_.data() + (static_cast<std::ptrdiff_t>(row) + first) * stride_ +
                      static_cast<std::ptrdiff_t>(column) + first;
  Sample sample;
  for (std::size_t j = 0; j <= static_cast<std::size_t>(order_); ++j, tap += stride_) {
    double value = 0.0;
    double slope = 0.0;
    for (std::size_t i = 0; i <= static_cast<std::size_t>(order_); ++i) {
      value += across.value[i] * tap[i];
      slope += across.slope[i] * tap[i];
    }
    sample.value += down.value[j] * value;
    sample.dx += down.value[j] * slope;
    sample.dy += down.slope[j] * value;
  }
  return sample;
}

image::ScalarMap gaussian_blur(const image::ScalarMap& image, double sigma_px) {
  if (!(sigma_px >= 0.0 && std::isfinite(sigma_px)))
    throw InvalidParams(fmt::format("sigma_px: {}; expected 0 or more.", sigma_px));
  if (sigma_px == 0.0) return image;
  const int reach = static_cast<int>(std::ceil(4.0 * sigma_px));
  std::vector<double> kernel;
  double sum = 0.0;
  for (int i = -reach; i <= reach; ++i) sum += kernel.emplace_back(std::exp(-0.5 * i * i / (sigma_px * sigma_px)));
  for (double& weight : kernel) weight /= sum;
  const auto w = static_cast<std::size_t>(image.width);
  image::ScalarMap across = image;
  image::ScalarMap result = image;
  const auto filtered = [&](int centre, int count, const auto& value) {
    double total = 0.0;
    for (int i = -reach; i <= reach; ++i)
      total += kernel[static_cast<std::size_t>(i + reach)] * static_cast<double>(value(mirrored(centre + i, count)));
    return static_cast<float>(total);
  };
  for (int y = 0; y < image.height; ++y) {
    const float* row = image.value.data() + static_cast<std::size_t>(y) * w;
    for (int x = 0; x < image.width; ++x)
      across.value[static_cast<std::size_t>(y) * w + static_cast<std::size_t>(x)] =
          filtered(x, image.width, [&](int i) { return row[i]; });
  }
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const auto column = static_cast<std::size_t>(x);
      result.value[static_cast<std::size_t>(y) * w + column] =
          filtered(y, image.height, [&](int i) { return across.value[static_cast<std::size_t>(i) * w + column]; });
    }
  }
  return result;
}

image::ScalarMap gaussian_blur(const image::ScalarMap& image, const Eigen::Matrix2d& covariance_px2) {
  if (covariance_px2.isZero(0.0)) return image;
  const double determinant = covariance_px2.determinant();
  if (!(determinant > 0.0 && covariance_px2(0, 0) > 0.0)) {
    throw InvalidParams(fmt::format("covariance_px2: [{} {}; {} {}]; expected 0 or a positive definite matrix.",
                                    covariance_px2(0, 0), covariance_px2(0, 1), covariance_px2(1, 0),
                                    covariance_px2(1, 1)));
  }
  const Eigen::Matrix2d inverse = covariance_px2.inverse();
  const int reach_x = static_cast<int>(std::ceil(4.0 * std::sqrt(covariance_px2(0, 0))));
  const int reach_y = static_cast<int>(std::ceil(4.0 * std::sqrt(covariance_px2(1, 1))));
  const int columns = 2 * reach_x + 1;
  std::vector<double> kernel;
  double sum = 0.0;
  for (int dy = -reach_y; dy <= reach_y; ++dy) {
    for (int dx = -reach_x; dx <= reach_x; ++dx) {
      const Eigen::Vector2d d(dx, dy);
      sum += kernel.emplace_back(std::exp(-0.5 * d.dot(inverse * d)));
    }
  }
  for (double& weight : kernel) weight /= sum;
  // With a mirrored frame, so that the sums below run without a test.
  const int stride = image.width + 2 * reach_x;
  std::vector<double> framed;
  for (int y = -reach_y; y < image.height + reach_y; ++y) {
    const float* row = image.value.data() + static_cast<std::ptrdiff_t>(mirrored(y, image.height)) * image.width;
    for (int x = -reach_x; x < image.width + reach_x; ++x)
      framed.push_back(static_cast<double>(row[mirrored(x, image.width)]));
  }
  image::ScalarMap result = image;
  tbb::parallel_for(0, image.height, [&](int y) {
    std::vector<double> line(static_cast<std::size_t>(image.width), 0.0);
    for (int j = 0; j <= 2 * reach_y; ++j) {
      for (int i = 0; i < columns; ++i) {
        const double weight = kernel[static_cast<std::size_t>(j * columns + i)];
        const double* from = framed.data() + static_cast<std::ptrdiff_t>(y + j) * stride + i;
        for (std::size_t x = 0; x < line.size(); ++x) line[x] += weight * from[x];
      }
    }
    std::copy(line.begin(), line.end(), result.value.begin() + static_cast<std::ptrdiff_t>(y) * image.width);
  });
  return result;
}

}  // namespace interglow::fitting
