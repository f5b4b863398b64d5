// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/capture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <string>

namespace interglow::fitting {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

image::SpectralImage frame(int width, int height, const std::vector<float>& value) {
  const auto bands = static_cast<Eigen::Index>(value.size()) / (width * height);
  return {width, height, Eigen::VectorXd::LinSpaced(bands, 500, 500 + 10 * (static_cast<double>(bands) - 1)), value};
}

std::string message_of(const std::function<void()>& work) {
  try {
    work();
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

TEST(Capture, SubtractsDarkAndDividesByWhite) {
  // Two pixels of two bands; by hand: 0.98 (raw - dark) / (white - dark) with the means of two frames each.
  const CaptureFrames frames{.object = frame(2, 1, {110, 220, 60, 40}),
                             .dark = {frame(2, 1, {8, 20, 10, 40}), frame(2, 1, {12, 20, 10, 40})},
                             .white = {frame(2, 1, {205, 420, 108, 140}), frame(2, 1, {215, 420, 112, 140})}};
  const Capture capture = correct_capture(frames, {.white_reflectance = Eigen::Vector2d(0.98, 0.5)});
  EXPECT_FLOAT_EQ(capture.image.pixel(0, 0)[0], 0.98F * 100 / 200);
  EXPECT_FLOAT_EQ(capture.image.pixel(0, 0)[1], 0.5F * 200 / 400);
  EXPECT_FLOAT_EQ(capture.image.pixel(0, 1)[0], 0.98F * 50 / 100);
  EXPECT_FLOAT_EQ(capture.image.pixel(0, 1)[1], 0.0F);
  EXPECT_EQ(capture.used, 2U);
}

TEST(Capture, DividesByExposure) {
  const Capture capture = correct_capture({.object = frame(2, 1, {110, 220, 60, 40})},
                                          {.dark_level = 10, .exposure = Eigen::Vector2d(2, 5)});
  EXPECT_EQ(capture.image.value, (std::vector<float>{50, 42, 25, 6}));
  EXPECT_EQ(capture.value_per_count, (std::vector<float>{0.5F, 0.2F}));
}

// One pixel repeated 40 000 times with normal noise in object, dark and white frames. The sample variance has the
// relative standard deviation √(2/N) = 0.71 %; with a false-alarm rate of 1e-6 over the three cases |z| < 5.1. The
// model is of first order in the white's noise (relative 0.4 %), so its error is of the order 0.4 %² and not seen.
TEST(Capture, VarianceIsThatOfRepeatedCaptures) {
  const SensorNoise noise{.read_sigma = 4.0, .shot_gain = 0.4};
  constexpr int kCount = 40000;
  constexpr double kObject = 900.0, kWhite = 3000.0, kDark = 50.0;
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  const auto noisy = [&](double signal) {
    std::vector<float> value;
    for (int i = 0; i < kCount; ++i)
      value.push_back(static_cast<float>(kDark + signal + std::sqrt(noise.variance(signal)) * normal(random)));
    return frame(kCount, 1, value);
  };
  const auto z = [&](const Capture& capture, double mean) {
    double sum = 0.0;
    for (const float value : capture.image.value) sum += (value - mean) * (value - mean);
    double predicted = 0.0;  // its white estimates differ by pixel: the mean is compared
    for (std::size_t p = 0; p < kCount; ++p) predicted += capture.variance(p, 0, mean);
    return (sum / predicted - 1.0) / std::sqrt(2.0 / kCount);
  };
  const Capture plain = correct_capture({.object = noisy(kObject)}, {.noise = noise, .dark_level = kDark});
  EXPECT_LT(std::abs(z(plain, kObject)), 5.1);
  const Capture dark = correct_capture({.object = noisy(kObject), .dark = {noisy(0), noisy(0)}}, {.noise = noise});
  EXPECT_LT(std::abs(z(dark, kObject)), 5.1);
  const Capture white = correct_capture({.object = noisy(kObject), .white = {noisy(kWhite), noisy(kWhite)}},
                                        {.noise = noise, .dark_level = kDark});
  EXPECT_LT(std::abs(z(white, kObject / kWhite)), 5.1);
  EXPECT_GT(white.variance(0, 0), 0.0);
}

// 200 × 100 pixels with a fixed pattern of ±10 % in 2 dark and 3 white frames. Sums of N and 2 N squares: the dark
// variance has the relative standard deviation √(2/N) = 1 %, the gain (white variance less dark variance over the
// signal) √(2/(2N)) · (1 + 16/1200 + …) < 0.8 %. False alarms of 1e-6 over both: 5 standard deviations.
TEST(Capture, NoiseIsEstimatedFromRepeatedFrames) {
  const SensorNoise truth{.read_sigma = 4.0, .shot_gain = 0.4};
  constexpr int kWidth = 200, kHeight = 100;
  std::mt19937_64 random(11);
  std::normal_distribution<double> normal;
  const auto noisy = [&](double signal) {
    std::vector<float> value;
    for (int i = 0; i < kWidth * kHeight; ++i) {
      const double mean = signal * (1.0 + 0.1 * std::sin(0.37 * i));
      value.push_back(
          static_cast<float>(50 + 5 * std::sin(0.11 * i) + mean + std::sqrt(truth.variance(mean)) * normal(random)));
    }
    return frame(kWidth, kHeight, value);
  };
  const CaptureFrames frames{
      .object = {}, .dark = {noisy(0), noisy(0)}, .white = {noisy(3000), noisy(3000), noisy(3000)}};
  const SensorNoise found = estimate_noise(frames, 0.0);
  EXPECT_NEAR(found.read_sigma, 4.0, 4.0 * 5 * 0.005);
  EXPECT_NEAR(found.shot_gain, 0.4, 0.4 * 5 * 0.008);
  EXPECT_THAT(message_of([&] { estimate_noise({.object = {}, .dark = frames.white, .white = frames.dark}, 0.0); }),
              HasSubstr("swapped"));
}

TEST(Capture, LeavesOutWhatCannotBeUsed) {
  // 5 × 3 pixels: full scale at column 3 of row 1, not finite at the first, the last column masked.
  std::vector<float> value(15, 100.0F);
  value[0] = std::numeric_limits<float>::quiet_NaN();
  value[1 * 5 + 3] = 255.0F;
  std::vector<std::uint8_t> mask(15, 1);
  for (const int p : {4, 9, 14}) mask[p] = 0;
  const CaptureFrames frames{.object = frame(5, 3, value), .mask = mask};
  const Capture capture = correct_capture(frames, {.bits = 8, .saturation_margin_px = 1});
  EXPECT_EQ(capture.use, (std::vector<std::uint8_t>{0, 1, 0, 0, 0,  //
                                                    1, 1, 0, 0, 0,  //
                                                    1, 1, 0, 0, 0}));
  EXPECT_EQ(capture.masked, 3U);
  EXPECT_EQ(capture.saturated, 6U);
  EXPECT_EQ(capture.invalid, 1U);
  EXPECT_EQ(capture.used, 5U);
  EXPECT_THAT(capture.warnings, ::testing::Contains(HasSubstr("50.0 % of the pixels are saturated")));
  const Capture narrow = correct_capture(frames, {.bits = 8, .saturation_margin_px = 0});
  EXPECT_EQ(narrow.saturated, 1U);
}

TEST(Capture, LeavesOutWhereTheWhiteDoesNotReach) {
  const Capture capture =
      correct_capture({.object = frame(3, 1, {10, 10, 10}), .white = {frame(3, 1, {100, 90, 4})}}, {.bits = 8});
  EXPECT_EQ(capture.use, (std::vector<std::uint8_t>{1, 1, 0}));
}

TEST(Capture, NamesWhatContradicts) {
  const image::SpectralImage object = frame(2, 1, {110, 220, 60, 40});
  EXPECT_THAT(message_of([&] {
                correct_capture({.object = object, .dark = {frame(1, 1, {1, 2})}});
              }),
              AllOf(HasSubstr("dark frame: 1 × 1 pixels"), HasSubstr("2 × 1")));
  EXPECT_THAT(message_of([&] {
                correct_capture({.object = object, .white = {object, frame(2, 1, {1, 2})}});
              }),
              AllOf(HasSubstr("white frame 2: 1 bands"), HasSubstr("has 2")));
  image::SpectralImage shifted = object;
  shifted.wavelength_nm[1] += 1;
  EXPECT_THAT(message_of([&] { correct_capture({.object = object, .dark = {shifted}}); }),
              AllOf(HasSubstr("dark frame: band 2 is 511 nm"), HasSubstr("510 nm")));
  EXPECT_THAT(message_of([&] { correct_capture({.object = object}, {.bits = 7}); }),
              AllOf(HasSubstr("row 0, column 0, band 2: 220 counts"), HasSubstr("127"), HasSubstr("7 bits")));
  EXPECT_THAT(message_of([&] { correct_capture({.object = object, .white = {object}}, {.dark_level = 300}); }),
              AllOf(HasSubstr("band 1 (500 nm)"), HasSubstr("swapped")));
  EXPECT_THAT(message_of([&] { correct_capture({.object = object, .mask = {1}}); }), HasSubstr("mask: 1 pixels"));
  EXPECT_THAT(message_of([&] { correct_capture({.object = object}, {.saturation = 20}); }),
              AllOf(HasSubstr("No pixel is left of 2 × 1"), HasSubstr("2 saturated (beyond 20 counts)")));
  EXPECT_THAT(message_of([&] { correct_capture({.object = object}, {.exposure = Eigen::Vector3d::Ones()}); }),
              AllOf(HasSubstr("exposure: 3 values"), HasSubstr("2 bands")));
  EXPECT_THAT(message_of([&] { correct_capture({.object = object}, {.noise = {.read_sigma = -1}}); }),
              HasSubstr("noise.read_sigma = -1"));
  EXPECT_THAT(message_of([&] { correct_capture({.object = object}, {.saturation = 300, .bits = 8}); }),
              HasSubstr("saturation = 300"));
}

}  // namespace
}  // namespace interglow::fitting
