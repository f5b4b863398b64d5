// SPDX-License-Identifier: GPL-3.0-or-later
#include "image/band_folder.h"

#include <OpenImageIO/imageio.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include "diagnostics/error.h"
#include "image/cube_file.h"
#include "image/mask_file.h"
#include "tests/temporary_folder.h"

namespace interglow::image {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

class BandFolders : public ::testing::Test {
 protected:
  fs::path file(const std::string& name) const { return folder_ / name; }
  const fs::path& folder() const { return folder_.path(); }
  /// Writes through the image library itself, every value `value`.
  template <typename Number>
  void picture(const std::string& name, Number value, int width = 2, int height = 1, int channels = 1) const {
    const auto out = OIIO::ImageOutput::create(name.substr(name.rfind('.') + 1));
    OIIO::ImageSpec spec(width, height, channels, OIIO::BaseTypeFromC<Number>::value);
    if constexpr (std::is_same_v<Number, std::uint8_t>) spec.attribute("oiio:ColorSpace", "Gamma2.2");
    const std::vector<Number> values(static_cast<std::size_t>(width * height * channels), value);
    ASSERT_TRUE(out->open(file(name).string(), spec));
    ASSERT_TRUE(out->write_image(spec.format, values.data()));
    out->close();
  }
  std::string message(const Eigen::VectorXd& nm = {}) const {
    try {
      read_band_folder(folder_.path(), nm);
    } catch (const InvalidInput& error) {
      return error.what();
    }
    return "";
  }

 private:
  const test::TemporaryFolder folder_;
};

TEST_F(BandFolders, TakesWavelengthsFromNames) {
  picture<std::uint16_t>("scan_7_band_1000nm.tif", 3);
  picture<std::uint16_t>("scan_7_band_550.5nm.png", 2);
  picture<std::uint16_t>("scan_7_band_400nm.tif", 1);
  std::ofstream(file("notes.txt")) << "not a picture";
  const BandFolder found = read_band_folder(folder());
  EXPECT_EQ(found.image.wavelength_nm, Eigen::Vector3d(400, 550.5, 1000));
  EXPECT_EQ(found.image.value, (std::vector<float>{1, 2, 3, 1, 2, 3}));
  EXPECT_EQ(found.whole_bits, 16);
}

TEST_F(BandFolders, TakesAListForNamesInTheirOrder) {
  picture<float>("b10.tif", 3);
  picture<float>("b9.tif", 2.5);
  picture<float>("b08.tif", 1);
  const BandFolder found = read_band_folder(folder(), Eigen::Vector3d(400, 500, 600));
  EXPECT_EQ(found.files, (std::vector<std::string>{"b08.tif", "b9.tif", "b10.tif"}));
  EXPECT_EQ(found.image.value, (std::vector<float>{1, 2.5, 3, 1, 2.5, 3}));
  EXPECT_EQ(found.whole_bits, 0);
}

TEST_F(BandFolders, RoundTripsEveryCount) {
  // All 65536 values, so that scaling or rounding anywhere would show.
  SpectralImage image{256, 128, Eigen::Vector2d(400.5, 700), {}};
  for (int v = 0; v < 65536; ++v) image.value.push_back(static_cast<float>(v));
  for (const std::string extension : {".tif", ".png"}) {
    write_band_folder(file(extension), image, extension);
    const BandFolder found = read_band_folder(file(extension));
    EXPECT_EQ(found.image.value, image.value) << extension;
    EXPECT_EQ(found.image.wavelength_nm, image.wavelength_nm);
    EXPECT_EQ(found.whole_bits, 16);
  }
}

TEST_F(BandFolders, SaysWhatIsMissingOrContradictory) {
  EXPECT_THAT(message(), HasSubstr("no .tif, .tiff or .png files"));
  picture<std::uint16_t>("a.tif", 1);
  picture<std::uint16_t>("b.tif", 1);
  EXPECT_THAT(message(), AllOf(HasSubstr("wavelength of \"a.tif\" is not known"), HasSubstr("wavelengths.csv")));
  EXPECT_THAT(message(Eigen::Vector3d(400, 500, 600)), HasSubstr("2 pictures (a.tif to b.tif) for 3 wavelengths"));
  EXPECT_THAT(message(Eigen::Vector2d(500, 400)), AllOf(HasSubstr("entry 2 is 400 nm after 500 nm")));
  EXPECT_THAT(message(Eigen::Vector2d(0.5, 0.6)), HasSubstr("100 to 20000 nm"));
  const auto list = [&](const std::string& text) { std::ofstream(file("wavelengths.csv")) << text; };
  list("file,wavelength_nm\na.tif,400\n");
  EXPECT_THAT(message(), HasSubstr("does not list \"b.tif\""));
  list("file,wavelength_nm\na.tif,400\nb.tif,500,5\n");
  EXPECT_THAT(message(), HasSubstr("wavelengths.csv:3: 5; expected a wavelength of 100 to 20000 nm"));
  list("file,wavelength_nm\na.tif,400\nb.tif,5OO\n");
  EXPECT_THAT(message(), HasSubstr("wavelengths.csv:3: \"b.tif,5OO\""));
  list("file,wavelength_nm\na.tif,400\nb.tif,400\n");
  EXPECT_THAT(message(), HasSubstr("a.tif and b.tif are both 400 nm"));
  list("file,wavelength_nm\nb.tif,400\na.tif,500\n");
  EXPECT_EQ(message(), "");
  EXPECT_EQ(message(Eigen::Vector2d(400, 500)), "");
  EXPECT_THAT(message(Eigen::Vector2d(400, 510)), HasSubstr("band 2 is 500 nm in wavelengths.csv and 510 nm as given"));
  picture<std::uint16_t>("b.tif", 1, 3, 1);
  EXPECT_THAT(message(), HasSubstr("All bands must be alike"));
  picture<std::uint8_t>("b.tif", 1);
  EXPECT_THAT(message(), AllOf(HasSubstr("8 bits"), HasSubstr("16 bits")));
  picture<std::uint16_t>("b.tif", 1, 2, 1, 3);
  EXPECT_THAT(message(), AllOf(HasSubstr("b.tif: 3 channels"), HasSubstr("expected one")));
  std::ofstream(file("b.tif")) << "text";
  EXPECT_THAT(message(), HasSubstr("b.tif: not a readable TIFF or PNG"));
}

TEST_F(BandFolders, RefusesCutFiles) {
  std::mt19937 random(2);
  SpectralImage image{96, 96, Eigen::VectorXd::Constant(1, 500.0), {}};
  for (int v = 0; v < 96 * 96; ++v) image.value.push_back(static_cast<float>(random() & 0xFFFU));
  for (const std::string extension : {".tif", ".png"}) {
    for (const double share : {0.1, 0.3, 0.5, 0.7, 0.9}) {
      write_band_folder(folder(), image, extension);
      const fs::path picture = file("band_500nm" + extension);
      EXPECT_EQ(message(), "");
      fs::resize_file(picture, static_cast<std::uintmax_t>(share * static_cast<double>(fs::file_size(picture))));
      EXPECT_THAT(message(), HasSubstr("band_500nm" + extension)) << share;
      fs::remove(picture);
    }
  }
}

TEST_F(BandFolders, SaysThatAPictureIsEncoded) {
  picture<std::uint8_t>("a_400nm.png", 7);
  EXPECT_FLOAT_EQ(static_cast<float>(read_band_folder(folder()).gamma), 2.2F);
  EXPECT_EQ(read_band_folder(folder()).image.value, (std::vector<float>{7, 7}));
}

TEST_F(BandFolders, MasksAreGreyPicturesToo) {
  picture<std::uint8_t>("mask.png", 0, 3, 2);
  EXPECT_EQ(read_mask(file("mask.png"), 3, 2), std::vector<std::uint8_t>(6, 0));
  picture<std::uint16_t>("mask.tif", 9, 3, 2);
  EXPECT_EQ(read_mask(file("mask.tif"), 3, 2), std::vector<std::uint8_t>(6, 1));
  EXPECT_THROW(read_mask(file("mask.tif"), 2, 2), InvalidInput);
}

TEST_F(BandFolders, EveryFormatGivesTheSameImage) {
  std::mt19937 random(5);
  SpectralImage image{7, 5, Eigen::Vector3d(400.25, 500, 700), {}};
  for (int v = 0; v < 105; ++v) image.value.push_back(static_cast<float>(random() & 0xFFFFU));
  write_band_folder(file("folder"), image);
  std::vector<fs::path> written{file("folder")};
  for (const char* name : {"a.exr", "b.mat", "c.img", "d.bil", "e.bip"}) {
    write_cube(file(name), image);
    written.push_back(file(name));
  }
  for (const fs::path& path : written) {
    const CubeFile found = read_cube(path);
    EXPECT_EQ(found.image.value, image.value) << path;
    EXPECT_EQ(found.image.wavelength_nm, image.wavelength_nm) << path;
    EXPECT_EQ(found.whole_bits, path == file("folder") ? 16 : 0) << path;
  }
  const auto refusal = [&](const char* name) -> std::string {
    try {
      read_cube(file(name), {.wavelength_nm = image.wavelength_nm});
    } catch (const InvalidInput& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(refusal("a.exr"), HasSubstr("wavelengths are given, but this file has its own"));
  EXPECT_THAT(refusal("nothing"), HasSubstr("no such file or folder"));
  EXPECT_THROW(write_cube(file("a.jpg"), image), InvalidParams);
}

}  // namespace
}  // namespace interglow::image
