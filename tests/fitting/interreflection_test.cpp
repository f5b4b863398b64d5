// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/interreflection.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include "diagnostics/error.h"

namespace interglow::fitting {
namespace {

image::ScalarMap map_of(int width, int height, const std::function<double(int, int)>& value) {
  image::ScalarMap map{width, height, {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) map.value.push_back(static_cast<float>(value(x, y)));
  }
  return map;
}

std::vector<std::uint8_t> region_of(int width, int height, const std::function<bool(int, int)>& inside) {
  std::vector<std::uint8_t> region;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) region.push_back(inside(x, y) ? 1 : 0);
  }
  return region;
}

TEST(SignedDistance, AgreesWithBruteForce) {
  std::mt19937 random(3);
  std::bernoulli_distribution coin(0.1);
  const int width = 23;
  const int height = 17;
  const auto region = region_of(width, height, [&](int, int) { return coin(random); });
  const std::vector<float> found = signed_distance_px(region, width, height);
  for (int p = 0; p < width * height; ++p) {
    double nearest = std::numeric_limits<double>::infinity();
    for (int q = 0; q < width * height; ++q) {
      if (region[static_cast<std::size_t>(q)] != region[static_cast<std::size_t>(p)])
        nearest = std::min(nearest, std::hypot(p % width - q % width, p / width - q / width));
    }
    const double expected = region[static_cast<std::size_t>(p)] != 0 ? 0.5 - nearest : nearest - 0.5;
    ASSERT_FLOAT_EQ(found[static_cast<std::size_t>(p)], static_cast<float>(expected)) << p;
  }
}

TEST(SignedDistance, IsInfiniteWithoutABorder) {
  EXPECT_EQ(signed_distance_px({1, 1}, 2, 1)[0], -std::numeric_limits<float>::infinity());
  EXPECT_EQ(signed_distance_px({0, 0}, 2, 1)[1], std::numeric_limits<float>::infinity());
}

// A simulated image whose interreflection is the captured one divided by 1.5 everywhere: w / w' = 1.5 for any region.
TEST(InterreflectionRatio, OfProportionalImagesDoesNotDependOnTheRegion) {
  const auto direct = map_of(40, 30, [](int x, int y) { return 1.0 + 0.01 * x + 0.02 * y; });
  const auto indirect = map_of(40, 30, [](int x, int) { return std::exp(-0.2 * std::abs(x - 20)); });
  auto lower = indirect;
  for (float& value : lower.value) value /= 1.5F;
  const auto region = region_of(40, 30, [](int x, int y) { return std::abs(x - 20) < 10 && y > 10 && y < 20; });
  const InterreflectionRatio found = interreflection_ratio({direct, indirect}, {direct, lower}, region);
  EXPECT_NEAR(found.region.ratio, 1.5, 1e-6);
  EXPECT_NEAR(found.lowest, 1.5, 1e-6);
  EXPECT_NEAR(found.highest, 1.5, 1e-6);
  EXPECT_LT(found.tile_sd, 1e-6);
}

// f_1 = 1 in both; f_2 = x captured and 1 simulated, over columns |x| ≤ 10 grown by r: w / w' = mean x, in closed form.
TEST(InterreflectionRatio, FollowsTheMeanAlongTheCurve) {
  const int width = 101;
  const auto one = map_of(width, 5, [](int, int) { return 1.0; });
  const auto ramp = map_of(width, 5, [](int x, int) { return x; });
  // Columns 0 … 9; the left edge is the image's, so growing moves the right edge only.
  const auto region = region_of(width, 5, [](int x, int) { return x < 10; });
  const InterreflectionRatio found =
      interreflection_ratio({one, ramp}, {one, one}, region, {.radius_px = {-4, 0, 6, 20}, .tile_px = 5});
  ASSERT_EQ(found.curve.size(), 4U);
  EXPECT_NEAR(found.curve[0].ratio, 2.5, 1e-12);   // columns 0 … 5
  EXPECT_NEAR(found.curve[1].ratio, 4.5, 1e-12);   // 0 … 9
  EXPECT_NEAR(found.curve[2].ratio, 7.5, 1e-12);   // 0 … 15
  EXPECT_NEAR(found.curve[3].ratio, 14.5, 1e-12);  // 0 … 29
  EXPECT_NEAR(found.lowest, 2.5, 1e-12);
  EXPECT_NEAR(found.highest, 14.5, 1e-12);
  EXPECT_EQ(found.region.pixels, 50U);
  // Two tiles with means 2 and 7: the jackknife gives √(1/2 · 2 · 2.5²).
  EXPECT_EQ(found.tiles, 2);
  EXPECT_NEAR(found.tile_sd, 2.5, 1e-12);
}

TEST(InterreflectionRatio, LeavesOutPixelsThatEitherImageLacks) {
  auto one = map_of(4, 1, [](int, int) { return 1.0; });
  auto simulated = one;
  simulated.value[0] = std::numeric_limits<float>::quiet_NaN();
  const auto captured = map_of(4, 1, [](int x, int) { return x == 0 ? 100.0 : 2.0; });
  const auto found = interreflection_ratio({one, captured}, {one, simulated}, {1, 1, 1, 1});
  EXPECT_EQ(found.region.pixels, 3U);
  EXPECT_NEAR(found.region.ratio, 2.0, 1e-12);
}

TEST(InterreflectionRatio, RefusesRegionsWithoutLight) {
  const auto one = map_of(2, 1, [](int, int) { return 1.0; });
  const auto dark = map_of(2, 1, [](int, int) { return 0.0; });
  EXPECT_THROW(interreflection_ratio({one, one}, {one, one}, {0, 0}), InvalidInput);
  EXPECT_THROW(interreflection_ratio({dark, one}, {one, one}, {1, 1}), InvalidInput);
  EXPECT_THROW(interreflection_ratio({one, one}, {one, dark}, {1, 1}), InvalidInput);
  EXPECT_THROW(interreflection_ratio({one, one}, {one, one}, {1}), InvalidParams);
  EXPECT_THROW(interreflection_ratio({one, one}, {one, one}, {1, 1}, {.tile_px = 0}), InvalidParams);
}

}  // namespace
}  // namespace interglow::fitting
