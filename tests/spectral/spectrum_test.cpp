// SPDX-License-Identifier: GPL-3.0-or-later
#include "spectral/spectrum.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "diagnostics/error.h"

namespace interglow::spectral {
namespace {

/// A triangle of height 1 over 400 to 600 nm: integral 100 nm.
Spectrum triangle() { return {Eigen::Vector3d(400, 500, 600), Eigen::Vector3d(0, 1, 0), "triangle"}; }

TEST(BandMeans, IntegrateThePiecewiseLinearTable) {
  // Band 485 to 515 around the peak: 2 × 15 × (1 + 0.85) / 2 / 30 = 0.925; next band 515 to 545: the value at 530.
  const WavelengthGrid grid = WavelengthGrid::uniform(500, 560, 30);
  const Eigen::VectorXd means = band_means(triangle(), grid, Outside::kZero);
  EXPECT_NEAR(means[0], 0.925, 1e-14);
  EXPECT_NEAR(means[1], 0.70, 1e-14);
  EXPECT_NEAR(means[2], 0.40, 1e-14);
}

TEST(BandMeans, ConserveTheIntegralOnAnyGrid) {
  for (const double step : {1.0, 3.0, 7.0, 50.0}) {
    const double bands = std::ceil(300.0 / step);
    const WavelengthGrid grid = WavelengthGrid::uniform(350, 350 + bands * step, step);
    const Eigen::VectorXd means = band_means(triangle(), grid, Outside::kZero);
    EXPECT_NEAR(means.dot(grid.widths_nm()), 100.0, 1e-10) << step << " nm";
  }
  Eigen::VectorXd uneven(6);
  uneven << 380, 430, 433, 500, 570, 640;
  const WavelengthGrid grid = WavelengthGrid::from_centers(uneven);
  EXPECT_NEAR(band_means(triangle(), grid, Outside::kZero).dot(grid.widths_nm()), 100.0, 1e-10);
}

TEST(BandMeans, OfATableOnTheGridsOwnCentresAreItsValues) {
  Eigen::VectorXd wavelength = Eigen::VectorXd::LinSpaced(97, 300, 780);
  const Eigen::VectorXd value = (wavelength.array() * 0.1).sin();
  const WavelengthGrid grid = WavelengthGrid::uniform(350, 700, 5);
  const Eigen::VectorXd means = band_means({wavelength, value, ""}, grid, Outside::kRefuse);
  EXPECT_EQ(means, value.segment(10, 71));
}

TEST(BandMeans, OutsideTheTable) {
  const Spectrum flat{Eigen::Vector2d(400, 410), Eigen::Vector2d(2, 2), "lamp.csv: power"};
  // Covered: 395 to 415 nm. Bands 380 to 400 and 400 to 420.
  const WavelengthGrid grid = WavelengthGrid::uniform(390, 410, 20);
  EXPECT_TRUE(band_means(flat, grid, Outside::kZero).isApprox(Eigen::Vector2d(0.5, 1.5), 1e-14));
  EXPECT_TRUE(band_means(flat, grid, Outside::kHold).isApprox(Eigen::Vector2d(2, 2), 1e-14));
  try {
    band_means(flat, grid, Outside::kRefuse);
    FAIL() << "no refusal";
  } catch (const InvalidInput& error) {
    EXPECT_NE(std::string(error.what()).find("lamp.csv: power"), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("395"), std::string::npos) << error.what();
  }
  ASSERT_EQ(warn_where_uncovered(flat, grid, Outside::kZero).size(), 1U);
  EXPECT_TRUE(warn_where_uncovered(flat, WavelengthGrid::uniform(400, 410, 10), Outside::kZero).empty());
}

TEST(ValidateSpectrum, NamesTheBadEntry) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(validate(Spectrum{{}, {}, ""}), InvalidInput);
  EXPECT_THROW(validate(Spectrum{Eigen::Vector2d(400, 400), Eigen::Vector2d(1, 1), ""}), InvalidInput);
  try {
    validate(Spectrum{Eigen::Vector2d(400, 405), Eigen::Vector2d(1, nan), "x.csv"});
    FAIL() << "no refusal";
  } catch (const InvalidInput& error) {
    EXPECT_NE(std::string(error.what()).find("x.csv: entry 2 (405 nm)"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace interglow::spectral
