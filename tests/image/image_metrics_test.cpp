// SPDX-License-Identifier: GPL-3.0-or-later
#include "image/image_metrics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>

#include "diagnostics/error.h"
#include "image/comparison_files.h"
#include "image/spectral_exr.h"
#include "tests/temporary_folder.h"

namespace interglow::image {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

/// Two bands, so that angles and means can be had by hand.
SpectralImage two_bands(int width, int height, std::vector<float> value) {
  return {width, height, Eigen::Vector2d(500, 600), std::move(value)};
}

TEST(CompareImages, FiguresByHand) {
  // Pixels: 45 degrees apart; equal up to a factor of 2; black in the image only; black in both.
  const SpectralImage image = two_bands(4, 1, {1, 1, 2, 4, 0, 0, 0, 0});
  const SpectralImage reference = two_bands(4, 1, {1, 0, 1, 2, 3, 1, 0, 0});
  const ImageComparison result = compare(image, reference);
  EXPECT_EQ(result.pixels, 3U);
  EXPECT_EQ(result.spectral_angle_deg.count, 2U);
  EXPECT_NEAR(result.spectral_angle_deg_map.value[0], 45.0F, 1e-5F);
  EXPECT_NEAR(result.spectral_angle_deg_map.value[1], 0.0F, 1e-5F);
  EXPECT_TRUE(std::isnan(result.spectral_angle_deg_map.value[2]));
  EXPECT_TRUE(std::isnan(result.relative_rmse_map.value[3]));
  EXPECT_NEAR(result.spectral_angle_deg.mean, 22.5, 1e-6);
  EXPECT_NEAR(result.spectral_angle_deg.standard_deviation, 22.5, 1e-6);
  EXPECT_NEAR(result.spectral_angle_deg.largest, 45.0, 1e-5);
  // Differences: (0, 1), (1, 2), (-3, -1).
  EXPECT_NEAR(result.band_rmse[0], std::sqrt((0.0 + 1.0 + 9.0) / 3.0), 1e-14);
  EXPECT_NEAR(result.band_rmse[1], std::sqrt((1.0 + 4.0 + 1.0) / 3.0), 1e-14);
  EXPECT_NEAR(result.rmse, std::sqrt(16.0 / 6.0), 1e-14);
  // Reference means: bands 5/3 and 1, all 8/6.
  EXPECT_NEAR(result.band_relative_rmse[0], std::sqrt(10.0 / 3.0) / (5.0 / 3.0), 1e-14);
  EXPECT_NEAR(result.band_relative_rmse[1], std::sqrt(2.0), 1e-14);
  EXPECT_NEAR(result.relative_rmse, std::sqrt(16.0 / 6.0) / (8.0 / 6.0), 1e-14);
  EXPECT_NEAR(result.mean_difference, 0.0, 1e-15);
  EXPECT_NEAR(result.relative_rmse_map.value[0], std::sqrt(0.5) / (8.0 / 6.0), 1e-6);
}

TEST(CompareImages, AnImageAgreesWithItself) {
  const SpectralImage image = two_bands(2, 1, {1, 2, 3, 0.5});
  const ImageComparison result = compare(image, image);
  EXPECT_EQ(result.spectral_angle_deg.largest, 0.0);
  EXPECT_EQ(result.delta_srgb.largest, 0.0);
  EXPECT_EQ(result.ciede2000.largest, 0.0);
  EXPECT_EQ(result.rmse, 0.0);
  EXPECT_EQ(result.relative_mean_difference, 0.0);
}

TEST(CompareImages, GreyLevelsHaveKnownColourDifferences) {
  // One band is grey with the chromaticity of D65: encoded sRGB of linear 0.2140411 is 0.5, of 0.0508761 0.25.
  const auto grey = [](std::vector<float> value) {
    return SpectralImage{2, 1, Eigen::VectorXd::Constant(1, 550.0), std::move(value)};
  };
  const ImageComparison result = compare(grey({0.2140411F, 1.3F}), grey({0.0508761F, 1.3F}), {.exposure = 1.0});
  EXPECT_NEAR(result.delta_srgb_map.value[0], 0.25 * std::sqrt(3.0), 1e-5);
  EXPECT_EQ(result.delta_srgb_map.value[1], 0.0F);
  EXPECT_EQ(result.above_white, 1U);
  EXPECT_DOUBLE_EQ(result.image_clipped_share, 0.5);
  // For greys CIEDE2000 is ΔL* / S_L with S_L = 1 + 0.015 d² / sqrt(20 + d²), d = mean L* - 50.
  const auto lightness = [](double y) { return 116.0 * std::cbrt(y) - 16.0; };
  const double a = lightness(0.2140411);
  const double b = lightness(0.0508761);
  const double d2 = std::pow((a + b) / 2.0 - 50.0, 2);
  EXPECT_NEAR(result.ciede2000_map.value[0], (a - b) / (1.0 + 0.015 * d2 / std::sqrt(20.0 + d2)), 1e-4);
}

TEST(CompareImages, MaskChoosesThePixels) {
  const SpectralImage image = two_bands(3, 1, {1, 1, 5, 5, 9, 9});
  const SpectralImage reference = two_bands(3, 1, {1, 1, 4, 4, 1, 1});
  const ImageComparison result = compare(image, reference, {.mask = {1, 1, 0}});
  EXPECT_EQ(result.pixels, 2U);
  EXPECT_NEAR(result.rmse, std::sqrt(0.5), 1e-14);
  EXPECT_TRUE(std::isnan(result.delta_srgb_map.value[2]));
}

std::string refusal(const SpectralImage& image, const SpectralImage& reference, const CompareParams& params = {}) {
  try {
    compare(image, reference, params);
  } catch (const InvalidParams& error) {
    return error.what();
  }
  ADD_FAILURE() << "nothing was thrown";
  return {};
}

TEST(CompareImages, RefusesWhatCannotBeCompared) {
  const SpectralImage image = two_bands(2, 1, {1, 2, 3, 4});
  EXPECT_THAT(refusal(image, two_bands(1, 1, {1, 2})), AllOf(HasSubstr("2 x 1"), HasSubstr("1 x 1")));
  SpectralImage shifted = image;
  shifted.wavelength_nm[1] = 605;
  EXPECT_THAT(refusal(image, shifted), AllOf(HasSubstr("band 2"), HasSubstr("600"), HasSubstr("605")));
  EXPECT_THAT(refusal(image, image, {.mask = {1}}), HasSubstr("mask"));
  EXPECT_THAT(refusal(image, image, {.mask = {0, 0}}), HasSubstr("no pixel"));
}

TEST(ComparisonMaps, AreWrittenAsNumbersAndPictures) {
  const test::TemporaryFolder folder;
  const ImageComparison result = compare(two_bands(2, 1, {1, 1, 0, 0}), two_bands(2, 1, {1, 0, 0, 0}));
  const std::vector<WrittenMap> written = write_comparison_maps(folder.path(), result);
  ASSERT_EQ(written.size(), 4U);
  EXPECT_EQ(written[0].highest, 50.0);  // 45 degrees
  for (const WrittenMap& map : written) EXPECT_TRUE(std::filesystem::exists(map.file)) << map.file;
  const ChannelImage maps = read_exr_channels(folder / "maps.exr");
  const auto channel = std::find(maps.channel.begin(), maps.channel.end(), "spectral_angle") - maps.channel.begin();
  ASSERT_LT(channel, 4);
  EXPECT_NEAR(maps.value[static_cast<std::size_t>(channel)], 45.0F, 1e-5F);
  EXPECT_TRUE(std::isnan(maps.value[4 + static_cast<std::size_t>(channel)]));
}

}  // namespace
}  // namespace interglow::image
