// SPDX-License-Identifier: GPL-3.0-or-later
#include "spectral/colour.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "diagnostics/error.h"
#include "spectral/observer.h"
#include "spectral/shipped_tables.h"
#include "spectral/spectrum.h"
#include "spectral/spectrum_file.h"

namespace interglow::spectral {
namespace {

const WavelengthGrid kVisible = WavelengthGrid::uniform(380, 780, 5);

Eigen::VectorXd illuminant(const std::string& name) {
  return band_means(read_spectrum(find_table("interglow:illuminants/" + name)), kVisible, Outside::kZero);
}

TEST(Tristimulus, WhitesOfTheCieIlluminants) {
  // CIE 15:2004 table 11.3, 2 degrees: chromaticities to four decimals.
  struct White {
    std::string name;
    double x, y;
  };
  const TristimulusWeights weights = cie1931_weights(kVisible);
  for (const White& white : {White{"d65", 0.3127, 0.3290}, White{"d50", 0.3457, 0.3585}, White{"a", 0.4476, 0.4074},
                             White{"equal_energy", 1.0 / 3, 1.0 / 3}, White{"f11", 0.3805, 0.3769}}) {
    const Eigen::Vector3d xyz = tristimulus(weights, illuminant(white.name));
    EXPECT_NEAR(xyz[0] / xyz.sum(), white.x, 3e-4) << white.name;  // 5 nm bands instead of the 1 nm sums of the table
    EXPECT_NEAR(xyz[1] / xyz.sum(), white.y, 3e-4) << white.name;
  }
}

TEST(Tristimulus, PerfectDiffuserHasUnitLuminance) {
  const TristimulusWeights weights = cie1931_weights(kVisible);
  const Eigen::VectorXd light = illuminant("d65");
  const double k = reference_white_scale(weights, light);
  EXPECT_NEAR(k * tristimulus(weights, light)[1], 1.0, 1e-14);
  EXPECT_THROW(reference_white_scale(weights, Eigen::VectorXd::Zero(kVisible.size())), InvalidParams);
}

TEST(Srgb, D65WhiteIsOneOneOne) {
  EXPECT_LT((linear_srgb(kD65White) - Eigen::Vector3d::Ones()).cwiseAbs().maxCoeff(), 1e-6);
  const TristimulusWeights weights = cie1931_weights(kVisible);
  const Eigen::VectorXd light = illuminant("d65");
  const Eigen::Vector3d rgb = linear_srgb(reference_white_scale(weights, light) * tristimulus(weights, light));
  EXPECT_LT((rgb - Eigen::Vector3d::Ones()).cwiseAbs().maxCoeff(), 2e-3) << rgb.transpose();
}

TEST(Srgb, EncodingMeetsTheStandard) {
  EXPECT_EQ(encoded_srgb(0.0), 0.0);
  EXPECT_NEAR(encoded_srgb(1.0), 1.0, 1e-15);
  EXPECT_EQ(encoded_srgb(-0.2), 0.0);
  EXPECT_NEAR(encoded_srgb(1.7), 1.0, 1e-15);
  EXPECT_NEAR(encoded_srgb(0.0031308), 0.04045, 1e-6);        // where the two branches meet, IEC 61966-2-1
  EXPECT_NEAR(encoded_srgb(0.2140411) * 255.0, 127.5, 1e-3);  // half: ((0.5 + 0.055) / 1.055)^2.4
  for (const double v : {0.0, 0.001, 0.02, 0.3, 0.99}) EXPECT_NEAR(decoded_srgb(encoded_srgb(v)), v, 1e-7);
}

TEST(Srgb, ColorCheckerPatchesMatchPublishedValues) {
  // 8-bit sRGB published by the maker for the chart (nominal colours under D50, adapted to D65). The spectra are
  // another measurement, of one chart: charts of that age differ by 2 to 3 units of ΔE, some 10 of 255 in sRGB.
  struct Patch {
    std::string name;
    Eigen::Vector3d srgb;
  };
  const std::vector<Patch> patches = {
      {"dark_skin", {115, 82, 68}},   {"light_skin", {194, 150, 130}}, {"blue_sky", {98, 122, 157}},
      {"foliage", {87, 108, 67}},     {"orange", {214, 126, 44}},      {"moderate_red", {193, 90, 99}},
      {"purple", {94, 60, 108}},      {"red", {175, 54, 60}},          {"yellow", {231, 199, 31}},
      {"neutral_8", {200, 200, 200}}, {"neutral_5", {122, 122, 121}},  {"black", {52, 52, 52}}};
  const TristimulusWeights weights = cie1931_weights(kVisible);
  const Eigen::VectorXd light = illuminant("d50");
  const double k = reference_white_scale(weights, light);
  const Eigen::Matrix3d adapt = bradford_adaptation(k * tristimulus(weights, light));
  for (const Patch& patch : patches) {
    const Eigen::VectorXd S = band_means(read_spectrum(find_table("interglow:reflectances/colorchecker"), patch.name),
                                         kVisible, Outside::kHold);
    const Eigen::Vector3d srgb =
        255.0 * encoded_srgb(linear_srgb(adapt * (k * tristimulus(weights, S.cwiseProduct(light)))));
    EXPECT_LT((srgb - patch.srgb).cwiseAbs().maxCoeff(), 12.0) << patch.name << ": " << srgb.transpose();
  }
}

TEST(Bradford, MapsWhiteToWhiteAndMatchesThePublishedMatrix) {
  const Eigen::Vector3d d50(0.96422, 1.0, 0.82521);
  const Eigen::Matrix3d adapt = bradford_adaptation(d50);
  EXPECT_LT((adapt * d50 - kD65White).cwiseAbs().maxCoeff(), 1e-14);
  // B. Lindbloom, "Chromatic Adaptation": D50 to D65, Bradford.
  const Eigen::Matrix3d expected{
      {0.9555766, -0.0230393, 0.0631636}, {-0.0282895, 1.0099416, 0.0210077}, {0.0122982, -0.0204830, 1.3299098}};
  EXPECT_LT((adapt - expected).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_THROW(bradford_adaptation(Eigen::Vector3d::Zero()), InvalidParams);
}

TEST(Cielab, WhiteBlackAndMidGrey) {
  EXPECT_LT((cielab(kD65White) - Eigen::Vector3d(100, 0, 0)).norm(), 1e-12);
  EXPECT_LT(cielab(Eigen::Vector3d::Zero()).norm(), 1e-12);
  // L* = 50 at Y = ((50 + 16) / 116)^3 = 0.184187.
  EXPECT_LT((cielab(std::pow(66.0 / 116.0, 3) * kD65White) - Eigen::Vector3d(50, 0, 0)).norm(), 1e-12);
  // Below (6/29)^3 the function is a line: L* = 903.2963 Y.
  EXPECT_NEAR(cielab(0.004 * kD65White)[0], 903.2962963 * 0.004, 1e-8);
}

}  // namespace
}  // namespace interglow::spectral
