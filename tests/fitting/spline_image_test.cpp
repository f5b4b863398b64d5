// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/spline_image.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <random>

#include "diagnostics/error.h"

namespace interglow::fitting {
namespace {

image::ScalarMap sampled(int width, int height, const std::function<double(double, double)>& f) {
  image::ScalarMap map{width, height, {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) map.value.push_back(static_cast<float>(f(x, y)));
  }
  return map;
}

class Spline : public ::testing::TestWithParam<int> {};

TEST_P(Spline, GoesThroughThePixels) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform;
  const image::ScalarMap map = sampled(13, 9, [&](double, double) { return uniform(random); });
  const SplineImage spline(map, GetParam());
  for (int y = 0; y < 9; ++y) {
    for (int x = 0; x < 13; ++x)
      ASSERT_NEAR(spline.sample(x, y).value, map.value[static_cast<std::size_t>(13 * y + x)], 1e-12) << x << ' ' << y;
  }
}

// Splines of order n contain the polynomials up to degree n. The mirrored border disturbs them, less by the pole's
// magnitude (0.27 or 0.43) with each pixel from it: 24 pixels in, by less than 0.43^24 = 2e-9 of the size at the
// border.
TEST_P(Spline, ReproducesCubics) {
  const auto cubic = [](double x, double y) {
    const double u = (x - 30) / 30, v = (y - 30) / 30;
    return u * u * u - 2 * u * v * v + v + 0.5;
  };
  const SplineImage spline(sampled(61, 61, cubic), GetParam());
  for (const double x : {29.1, 30.5, 31.9}) {
    for (const double y : {30.25, 32.6}) {
      const double u = (x - 30) / 30, v = (y - 30) / 30;
      const SplineImage::Sample sample = spline.sample(x, y);
      EXPECT_NEAR(sample.value, cubic(x, y), 2e-7);  // values are given in single precision
      EXPECT_NEAR(sample.dx, (3 * u * u - 2 * v * v) / 30, 2e-7);
      EXPECT_NEAR(sample.dy, (-4 * u * v + 1) / 30, 2e-7);
    }
  }
}

TEST_P(Spline, SlopesAreDerivativesOfValues) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> uniform;
  const SplineImage spline(sampled(16, 16, [&](double, double) { return uniform(random); }), GetParam());
  const double h = 1e-4;
  for (int trial = 0; trial < 200; ++trial) {
    const double x = 0.1 + 14.8 * uniform(random);
    const double y = 0.1 + 14.8 * uniform(random);
    const SplineImage::Sample sample = spline.sample(x, y);
    EXPECT_NEAR(sample.dx, (spline.sample(x + h, y).value - spline.sample(x - h, y).value) / (2 * h), 1e-6);
    EXPECT_NEAR(sample.dy, (spline.sample(x, y + h).value - spline.sample(x, y - h).value) / (2 * h), 1e-6);
  }
}

// At 0.2 cycles per pixel the gradient of Catmull-Rom errs by 22 % of its peak, that of a cubic spline by 2.9 % and of
// order 5 by 0.4 % (amplitudes of the aliased copies, to first order 2 (f / (1 - f))^(n + 1) (1 - f) / f).
TEST_P(Spline, GradientsErrLittleAtHighFrequencies) {
  const double f = 0.2;
  const auto wave = [&](double x, double) { return std::sin(2 * std::numbers::pi * f * x); };
  const SplineImage spline(sampled(81, 8, wave), GetParam());
  double worst = 0.0;
  for (double x = 30; x < 50; x += 0.01) {
    const double expected = 2 * std::numbers::pi * f * std::cos(2 * std::numbers::pi * f * x);
    worst = std::max(worst, std::abs(spline.sample(x, 3.5).dx - expected));
  }
  const double bound = 2 * std::pow(f / (1 - f), GetParam() + 1) * (1 - f) / f;
  EXPECT_LT(worst / (2 * std::numbers::pi * f), bound);
}

TEST_P(Spline, IsMirroredAtTheBorder) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform;
  const SplineImage spline(sampled(10, 10, [&](double, double) { return uniform(random); }), GetParam());
  for (const double along : {0.0, 3.3, 9.0}) {
    EXPECT_NEAR(spline.sample(0, along).dx, 0.0, 1e-12);
    EXPECT_NEAR(spline.sample(9, along).dx, 0.0, 1e-12);
    EXPECT_NEAR(spline.sample(along, 0).dy, 0.0, 1e-12);
    EXPECT_NEAR(spline.sample(along, 9).dy, 0.0, 1e-12);
  }
}

INSTANTIATE_TEST_SUITE_P(Order, Spline, ::testing::Values(3, 5));

TEST(SplineImage, RefusesWhatItCannotInterpolate) {
  const image::ScalarMap good = sampled(5, 5, [](double x, double) { return x; });
  EXPECT_THROW(SplineImage(good, 4), InvalidParams);
  EXPECT_THROW(SplineImage(sampled(3, 5, [](double, double) { return 1; }), 3), InvalidParams);
  image::ScalarMap bad = good;
  bad.value[7] = std::numeric_limits<float>::infinity();
  EXPECT_THROW(SplineImage(bad, 3), InvalidInput);
}

// A Gaussian of variance s² blurred by σ has the variance s² + σ²; sums over pixels of both are exact to 1e-6 for s
// ≥ 2.
TEST(GaussianBlur, AddsItsVarianceAndKeepsTheSum) {
  const auto spot = sampled(
      61, 61, [](double x, double y) { return std::exp(-((x - 30) * (x - 30) + (y - 30) * (y - 30)) / (2 * 4.0)); });
  const image::ScalarMap blurred = gaussian_blur(spot, 1.5);
  double before = 0.0, sum = 0.0, second = 0.0;
  for (int y = 0; y < 61; ++y) {
    for (int x = 0; x < 61; ++x) {
      const auto p = static_cast<std::size_t>(61 * y + x);
      before += static_cast<double>(spot.value[p]);
      sum += static_cast<double>(blurred.value[p]);
      second += static_cast<double>(blurred.value[p]) * (x - 30) * (x - 30);
    }
  }
  EXPECT_NEAR(sum / before, 1.0, 1e-6);
  EXPECT_NEAR(second / sum, 4.0 + 2.25, 0.01);  // the kernel is cut at 4 sigma, which takes 0.1 % of its variance
}

}  // namespace
}  // namespace interglow::fitting
