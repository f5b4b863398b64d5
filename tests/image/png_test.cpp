// SPDX-License-Identifier: GPL-3.0-or-later
#include "image/png.h"

#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "diagnostics/error.h"
#include "image/pixel_table.h"
#include "spectral/spectrum_file.h"
#include "tests/temporary_folder.h"

namespace interglow::image {
namespace {

template <class T>
std::vector<T> read_all(const std::filesystem::path& path, OIIO::TypeDesc type, int channels) {
  auto input = OIIO::ImageInput::open(path.string());
  if (!input || input->spec().nchannels != channels || input->spec().format != type) {
    ADD_FAILURE() << path << ": " << OIIO::geterror();
    return {};
  }
  std::vector<T> value(static_cast<std::size_t>(input->spec().image_pixels()) * static_cast<std::size_t>(channels));
  EXPECT_TRUE(input->read_image(0, 0, 0, channels, type, value.data()));
  return value;
}

TEST(Png, HoldsEncodedBytes) {
  const test::TemporaryFolder folder;
  const auto path = folder / "rgb.png";
  // IEC 61966-2-1: linear 0.2140411 is 127.5 of 255, 0.0031308 is 10.3; what is out of range is clipped.
  write_png(path, RgbImage{2, 1, {0.0F, 1.0F, 0.215F, 0.0031308F, -3.0F, 7.0F}, 1.0, 0.0});
  EXPECT_EQ(read_all<std::uint8_t>(path, OIIO::TypeUInt8, 3), (std::vector<std::uint8_t>{0, 255, 128, 10, 0, 255}));
}

TEST(MapPng, GreyIsLinearWith16Bits) {
  const test::TemporaryFolder folder;
  const auto path = folder / "grey.png";
  write_map_png(path, ScalarMap{5, 1, {-1.0F, 0.0F, 1.0F, 4.0F, std::nanf("")}}, 0.0, 4.0, MapColours::kGrey);
  EXPECT_EQ(read_all<std::uint16_t>(path, OIIO::TypeUInt16, 1), (std::vector<std::uint16_t>{0, 0, 16384, 65535, 0}));
}

TEST(MapPng, CubehelixRisesInLuminanceFromBlackToWhite) {
  const test::TemporaryFolder folder;
  const auto path = folder / "colours.png";
  ScalarMap map{65, 1, {}};
  for (int i = 0; i < 64; ++i) map.value.push_back(static_cast<float>(i) / 63.0F);
  map.value.push_back(std::nanf(""));
  write_map_png(path, map, 0.0, 1.0, MapColours::kCubehelix);
  const auto bytes = read_all<std::uint8_t>(path, OIIO::TypeUInt8, 4);
  ASSERT_EQ(bytes.size(), 65U * 4U);
  double last = -1.0;
  for (std::size_t i = 0; i < 64; ++i) {
    // Green (2011): the perceived level 0.30 R + 0.59 G + 0.11 B is the value itself.
    const double level = (0.30 * bytes[4 * i] + 0.59 * bytes[4 * i + 1] + 0.11 * bytes[4 * i + 2]) / 255.0;
    EXPECT_NEAR(level, map.value[i], 0.01) << i;
    EXPECT_GT(level, last) << i;
    EXPECT_EQ(bytes[4 * i + 3], 255);
    last = level;
  }
  EXPECT_EQ(bytes[4 * 64 + 3], 0) << "no value is transparent";
  EXPECT_THROW(write_map_png(path, map, 1.0, 1.0, MapColours::kGrey), InvalidParams);
}

TEST(PixelTable, HoldsTheSpectraOfThePixels) {
  const test::TemporaryFolder folder;
  const auto path = folder / "pixels.csv";
  const SpectralImage image{2, 2, Eigen::Vector2d(400, 405), {1, 2, 3, 4, 5, 6, 7, 0.1F}};
  write_pixel_table(path, image, {{1, 0}, {1, 1}}, {"a comment"});
  EXPECT_EQ(spectral::read_spectrum(path, "row1_column0").value, Eigen::Vector2d(5, 6));
  EXPECT_EQ(spectral::read_spectrum(path, "row1_column1").value, Eigen::Vector2d(7, static_cast<double>(0.1F)));
  EXPECT_THROW(write_pixel_table(path, image, {{2, 0}}), InvalidParams);
}

}  // namespace
}  // namespace interglow::image
