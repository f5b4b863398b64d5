// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/simulated_sensor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <functional>
#include <string>

namespace interglow::fitting {
namespace {

using ::testing::HasSubstr;

/// A picture of `bands` bands, value(row, column, band).
image::SpectralImage picture(int width, int height, int bands, const std::function<double(int, int, int)>& value) {
  image::SpectralImage image{width, height, Eigen::VectorXd::LinSpaced(bands, 400, 400 + 10 * (bands - 1)), {}};
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (int b = 0; b < bands; ++b) image.value.push_back(static_cast<float>(value(y, x, b)));
  return image;
}

/// Without noise beyond rounding to 1/16 of the smallest signal used here.
SensorParams clean() {
  return {.bits = 16, .full_well_electrons = 1e13, .read_electrons = 0.0, .black_counts = 0.0, .dark_frames = 0};
}

// Counts of 40 000 pixels at each of 5 levels. The variance of the sample has the relative standard deviation
// √((2 + κ)/N), κ = 1/mean electrons < 0.01 of a Poisson number: 0.71 %. Family false-alarm rate 1e-6 over 5 levels
// of mean and variance: |z| < 5.3. Catches a noise that is off by 5.3 + 3.1 standard deviations = 6 % 999 times of
// 1000.
TEST(SimulatedSensor, NoiseHasTheStatedVariance) {
  constexpr double kLevels[] = {0.01, 0.05, 0.2, 0.6, 1.0};
  const SensorParams params{.full_well_electrons = 1e4, .read_electrons = 8.0, .peak = 0.7, .dark_frames = 0};
  const auto radiance = picture(200, 1000, 1, [&](int y, int, int) { return kLevels[y / 200]; });
  const SensorOutput output = simulate_sensor(radiance, params);
  EXPECT_NEAR(output.counts_per_radiance[0], 0.7 * (4095 - 64), 1e-9);
  for (int level = 0; level < 5; ++level) {
    const double signal = kLevels[level] * output.counts_per_radiance[0];
    const double expected = signal + params.black_counts;
    double sum = 0.0, squares = 0.0;
    constexpr int kCount = 200 * 200;
    for (int i = 0; i < kCount; ++i) {
      const double value = output.frames.object.value[static_cast<std::size_t>(level * kCount + i)];
      sum += value - expected;
      squares += (value - expected) * (value - expected);
    }
    const double variance = output.noise.variance(signal);
    EXPECT_LT(std::abs(sum / std::sqrt(variance * kCount)), 5.3) << "mean of level " << level;
    EXPECT_LT(std::abs((squares / (variance * kCount) - 1.0) / std::sqrt(2.01 / kCount)), 5.3)
        << "variance of level " << level << ": " << squares / kCount << ", expected " << variance;
  }
}

TEST(SimulatedSensor, BlurKeepsTheSumAndHasItsSecondMoment) {
  for (const double sigma : {0.8, 1.5, 3.0}) {
    SensorParams params = clean();
    params.blur_px = sigma;
    params.peak = 0.2;  // the brightest pixel of a spot lies far above the 99.9th percentile
    const auto output =
        simulate_sensor(picture(64, 64, 1, [](int y, int x, int) { return y == 30 && x == 33 ? 1.0 : 0.0; }), params);
    double sum = 0.0, x_mean = 0.0, y_moment = 0.0, x_moment = 0.0;
    for (int y = 0; y < 64; ++y) {
      for (int x = 0; x < 64; ++x) {
        const double value = output.frames.object.pixel(y, x)[0] / output.counts_per_radiance[0];
        sum += value;
        x_mean += value * x;
        x_moment += value * (x - 33) * (x - 33);
        y_moment += value * (y - 30) * (y - 30);
      }
    }
    // Cutting at 4 σ takes 8 φ(4) / (1 - 6e-5) = 0.11 % of the second moment, rounding of counts below 0.1 % more.
    EXPECT_NEAR(sum, 1.0, 1e-3) << sigma;
    EXPECT_NEAR(x_mean / sum, 33.0, 1e-3) << sigma;
    EXPECT_NEAR(x_moment / sum, sigma * sigma, 0.003 * sigma * sigma) << sigma;
    EXPECT_NEAR(y_moment / sum, sigma * sigma, 0.003 * sigma * sigma) << sigma;
  }
}

TEST(SimulatedSensor, GlareKeepsTheMeanAndStrayLightAddsToIt) {
  // Half the picture is 1, half 0.2: glare of 10 % gives 0.96 and 0.24; stray light of 0.5 % of 0.96 adds to both.
  SensorParams params = clean();
  params.glare = 0.1;
  params.stray = 0.005;
  const auto output = simulate_sensor(picture(16, 16, 1, [](int, int x, int) { return x < 8 ? 1.0 : 0.2; }), params);
  const double scale = output.counts_per_radiance[0];
  EXPECT_NEAR(output.frames.object.pixel(0, 0)[0], (0.96 + 0.0048) * scale, 0.5);
  EXPECT_NEAR(output.frames.object.pixel(15, 15)[0], (0.24 + 0.0048) * scale, 0.5);
  EXPECT_NEAR(output.offset_counts[0], (0.06 + 0.0048) * scale, 1e-6 * scale);
}

TEST(SimulatedSensor, LooksWhereTheMapSays) {
  // Splines of order 5 reproduce a plane, away from the mirrored border.
  SensorParams params = clean();
  params.ideal_from_sensor.linear << 1.01, 0.02, -0.02, 0.99;
  params.ideal_from_sensor.shift = {1.5, -0.25};
  const auto plane = [](double x, double y) { return 0.2 + 0.004 * x + 0.002 * y; };
  const auto output = simulate_sensor(picture(80, 80, 1, [&](int y, int x, int) { return plane(x, y); }), params);
  for (const int y : {20, 40, 60}) {
    for (const int x : {20, 40, 60}) {
      const Eigen::Vector2d at = params.ideal_from_sensor(Eigen::Vector2d(x, y));
      EXPECT_NEAR(output.frames.object.pixel(y, x)[0] / output.counts_per_radiance[0], plane(at.x(), at.y()), 2e-5);
    }
  }
}

TEST(SimulatedSensor, RoundsAndSaturates) {
  // Without noise each count is its radiance rounded; beyond full scale it stays there.
  SensorParams params = clean();
  params.bits = 8;
  params.peak = 1.25;
  const auto radiance = picture(64, 32, 1, [](int y, int x, int) { return (y * 64 + x) / 2047.0; });
  const SensorOutput output = simulate_sensor(radiance, params);
  std::size_t saturated = 0;
  for (std::size_t p = 0; p < radiance.value.size(); ++p) {
    const double exact = radiance.value[p] * output.counts_per_radiance[0];
    const double count = output.frames.object.value[p];
    EXPECT_EQ(count, std::round(count));
    EXPECT_NEAR(count, std::min(exact, 255.0), 0.5 + 1e-3);
    if (count == 255.0) ++saturated;
  }
  EXPECT_NEAR(static_cast<double>(saturated) / 2048.0, 0.2, 0.005);  // 1 - 1/1.25, up to the percentile and rounding
  EXPECT_EQ(output.saturated_share, static_cast<double>(saturated) / 2048.0);
}

TEST(SimulatedSensor, CorrectionUndoesIt) {
  // With dark and white frames the corrected values are radiance over the white's, times its reflectance.
  SensorParams params{.bits = 14, .full_well_electrons = 1e6, .expose_bands = true, .gain_spread = 0.1};
  params.dark_frames = 3;
  params.white_frames = 3;
  const Eigen::Vector3d white(2.0, 1.0, 0.5);
  const auto radiance =
      picture(40, 30, 3, [&](int y, int x, int b) { return white[b] * (0.1 + 0.7 * (x + 40 * y) / 1200.0); });
  const SensorOutput output = simulate_sensor(radiance, params, white);
  const Capture capture = correct_capture(
      output.frames, {.noise = output.noise, .bits = 14, .white_reflectance = Eigen::VectorXd::Constant(1, 0.9)});
  EXPECT_EQ(capture.used, 1200U);
  // χ² of 3600 values with the predicted variance; false-alarm rate 1e-6: 3600 ± 4.9 √7200. Three white frames a pixel
  // are shared by no other value.
  double chi2 = 0.0;
  for (std::size_t p = 0; p < 1200; ++p) {
    for (int b = 0; b < 3; ++b) {
      const double expected = 0.9 * radiance.value[3 * p + b] / white[b];
      const double off = capture.image.value[3 * p + b] - expected;
      chi2 += off * off / capture.variance(p, b, expected);
    }
  }
  EXPECT_NEAR(chi2, 3600.0, 4.9 * std::sqrt(7200.0));
  EXPECT_GT((output.band_gain.array() - 1.0).abs().maxCoeff(), 0.005);
  EXPECT_LE((output.band_gain.array() - 1.0).abs().maxCoeff(), 0.1);
}

TEST(SimulatedSensor, IsAFunctionOfItsSeed) {
  const auto radiance = picture(32, 32, 2, [](int y, int x, int b) { return 0.1 + x * y * (b + 1); });
  const SensorParams params{.gain_spread = 0.1, .blur_px = 1.0, .dark_frames = 2};
  const SensorOutput first = simulate_sensor(radiance, params);
  {
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    const SensorOutput again = simulate_sensor(radiance, params);
    EXPECT_EQ(first.frames.object.value, again.frames.object.value);
    EXPECT_EQ(first.frames.dark[1].value, again.frames.dark[1].value);
  }
  EXPECT_NE(first.frames.dark[0].value, first.frames.dark[1].value);
  SensorParams other = params;
  other.seed = 2;
  EXPECT_NE(first.frames.object.value, simulate_sensor(radiance, other).frames.object.value);
}

TEST(SimulatedSensor, NamesWhatItCannotUse) {
  const auto radiance = picture(8, 8, 2, [](int, int, int) { return 1.0; });
  const auto message = [&](const SensorParams& params, const image::SpectralImage& image) -> std::string {
    try {
      simulate_sensor(image, params);
    } catch (const std::exception& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(message({}, radiance), "");
  EXPECT_THAT(message({.bits = 17}, radiance), HasSubstr("bits = 17"));
  EXPECT_THAT(message({.peak = 0.0}, radiance), HasSubstr("peak = 0"));
  EXPECT_THAT(message({.glare = 1.0}, radiance), HasSubstr("glare = 1"));
  EXPECT_THAT(message({.white_frames = 1}, radiance), HasSubstr("white_radiance: 0 values for 2 bands"));
  EXPECT_THAT(message({}, picture(8, 8, 1, [](int, int, int) { return 0.0; })), HasSubstr("0 everywhere"));
  EXPECT_THAT(message({}, picture(8, 8, 1, [](int, int, int) { return NAN; })), HasSubstr("not finite"));
}

}  // namespace
}  // namespace interglow::fitting
