// SPDX-License-Identifier: GPL-3.0-or-later
#include "image/preview.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "diagnostics/error.h"
#include "spectral/observer.h"
#include "spectral/shipped_tables.h"
#include "spectral/spectrum_file.h"

namespace interglow::image {
namespace {

const spectral::WavelengthGrid kCameraGrid = spectral::WavelengthGrid::uniform(400, 700, 5);

Eigen::VectorXd d65() {
  return spectral::band_means(spectral::read_spectrum(spectral::find_table("interglow:illuminants/d65")), kCameraGrid,
                              spectral::Outside::kRefuse);
}

/// Pixel i has the spectrum of D65 times factors[i].
SpectralImage greys(const std::vector<double>& factors) {
  SpectralImage image{static_cast<int>(factors.size()), 1, kCameraGrid.centers_nm(), {}};
  const Eigen::VectorXd light = d65();
  for (const double factor : factors) {
    for (const double value : light) image.value.push_back(static_cast<float>(factor * value));
  }
  return image;
}

TEST(Preview, PerfectDiffuserUnderD65IsWhite) {
  const Eigen::VectorXd light = d65();
  const double exposure = spectral::reference_white_scale(spectral::cie1931_weights(kCameraGrid), light);
  const RgbImage rgb = make_preview(greys({1.0, 0.5, 0.0}), {.exposure = exposure});
  // 400 to 700 nm instead of the whole visible range costs 0.002 at most.
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(rgb.value[static_cast<std::size_t>(c)], 1.0F, 3e-3F) << c;
    EXPECT_NEAR(rgb.value[static_cast<std::size_t>(3 + c)], 0.5F, 1.5e-3F) << c;
    EXPECT_EQ(rgb.value[static_cast<std::size_t>(6 + c)], 0.0F) << c;
  }
}

TEST(Preview, AutomaticExposurePutsThePercentileAtTheLevel) {
  std::vector<double> factors(100);
  for (std::size_t i = 0; i < factors.size(); ++i) factors[i] = static_cast<double>(i + 1) / 100.0;
  factors.resize(150, 0.0);  // the black background does not count
  const SpectralImage image = greys(factors);
  const PreviewParams params{.automatic_percentile = 0.9, .automatic_level = 0.6};
  const double exposure = automatic_exposure(image, params);
  // The 90th of 100 lit pixels has 0.9 of the white's luminance.
  const double white = spectral::cie1931_weights(kCameraGrid).col(1).dot(d65());
  EXPECT_NEAR(exposure * 0.9 * white, 0.6, 1e-6);
  EXPECT_EQ(make_preview(image, params).exposure, exposure);
  EXPECT_EQ(automatic_exposure(greys({0.0, 0.0})), 1.0);
}

TEST(Preview, ReportsTheClippedShareOfLitPixels) {
  const Eigen::VectorXd light = d65();
  const double exposure = spectral::reference_white_scale(spectral::cie1931_weights(kCameraGrid), light);
  EXPECT_DOUBLE_EQ(make_preview(greys({0.0, 0.2, 0.5, 1.5, 2.0}), {.exposure = exposure}).clipped_share, 0.5);
  // Light of a single band near 520 nm is outside the gamut: red is negative.
  SpectralImage green = greys({0.1});
  std::fill(green.value.begin(), green.value.end(), 0.0F);
  green.value[24] = 1.0F;
  const RgbImage rgb = make_preview(green);
  EXPECT_LT(rgb.value[0], 0.0F);
  EXPECT_DOUBLE_EQ(rgb.clipped_share, 1.0);
}

TEST(Preview, AdaptedLampIsNeutral) {
  const Eigen::VectorXd lamp =
      spectral::band_means(spectral::read_spectrum(spectral::find_table("interglow:illuminants/a")), kCameraGrid,
                           spectral::Outside::kRefuse);
  SpectralImage image{1, 1, kCameraGrid.centers_nm(), {}};
  for (const double value : lamp) image.value.push_back(static_cast<float>(value));
  const Eigen::Vector3d white = spectral::tristimulus(spectral::cie1931_weights(kCameraGrid), lamp);
  const RgbImage tinted = make_preview(image, {.exposure = 1.0 / white[1]});
  EXPECT_GT(tinted.value[0], 1.5F * tinted.value[2]);
  const RgbImage adapted = make_preview(image, {.exposure = 1.0 / white[1], .adapt_from_white = white});
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(adapted.value[static_cast<std::size_t>(c)], 1.0F, 1e-5F);
}

TEST(Preview, OneBandIsGrey) {
  const SpectralImage image{2, 1, Eigen::VectorXd::Constant(1, 550.0), {0.25F, 0.5F}};
  const RgbImage rgb = make_preview(image, {.exposure = 1.0});
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(rgb.value[c], 0.25F, 1e-6F);
    EXPECT_NEAR(rgb.value[3 + c], 0.5F, 1e-6F);
  }
}

TEST(Preview, RefusesParamsOutOfRange) {
  const SpectralImage image = greys({1.0});
  EXPECT_THROW(make_preview(image, {.exposure = 0.0}), InvalidParams);
  EXPECT_THROW(make_preview(image, {.automatic_percentile = 1.2}), InvalidParams);
  EXPECT_THROW(make_preview(image, {.automatic_level = -1.0}), InvalidParams);
}

}  // namespace
}  // namespace interglow::image
