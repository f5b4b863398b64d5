// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/capture_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <random>
#include <string>

#include "image/band_folder.h"
#include "image/channel_file.h"
#include "image/envi.h"
#include "tests/temporary_folder.h"

namespace interglow::fitting {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;

class CaptureFiles : public ::testing::Test {
 protected:
  fs::path file(const std::string& name) const { return folder_ / name; }
  void describe(const std::string& text) const { std::ofstream(file("capture.toml")) << text; }
  std::string message(const std::string& name = "capture.toml") const {
    try {
      read_capture(file(name));
    } catch (const std::exception& error) {
      return error.what();
    }
    return "";
  }

 private:
  const test::TemporaryFolder folder_;
};

/// 3 × 2 pixels of whole numbers in three bands.
image::SpectralImage counts(int lowest, int step, int width = 3) {
  image::SpectralImage image{width, 2, Eigen::Vector3d(450, 550, 650), {}};
  for (int v = 0; v < 6 * width; ++v) image.value.push_back(static_cast<float>(lowest + step * v));
  return image;
}

TEST_F(CaptureFiles, DescriptionNamesEverything) {
  image::write_band_folder(file("scan"), counts(1000, 50));
  image::write_band_folder(file("dark"), counts(64, 0), ".png");
  image::write_envi(file("white.img"), counts(2064, 0), {.type = image::EnviType::kUint16});
  image::write_grey_words(file("mask.png"), 3, 2, {1, 1, 0, 1, 1, 1});
  std::ofstream(file("spectralon.csv")) << "wavelength,factor\n400,0.9\n700,0.9\n";
  describe(
      "note = \"two lamps\"\nobject = \"scan\"\ndark = \"dark\"\nwhite = [\"white.hdr\", \"white.img\"]\n"
      "mask = \"mask.png\"\nwhite_reflectance = \"spectralon.csv\"\nbits = 12\nsaturation = 1840\n"
      "saturation_margin_px = 0\n[noise]\nread_sigma = 3\nshot_gain = 0.5\n");
  for (const char* name : {"capture.toml", ""}) {  // the description, or its folder
    const std::string said = message(name);
    ASSERT_THAT(said, HasSubstr("No pixel is left"));  // the white frame lies above the level of saturation
  }
  image::write_envi(file("white.img"), counts(1064, 0), {.type = image::EnviType::kUint16});
  const Capture capture = read_capture(file(""));
  // By hand: 0.9 (1000 + 50 v - 64) / 1000.
  for (int v = 0; v < 15; ++v) {
    if (v / 3 == 2) continue;  // outside the mask
    EXPECT_FLOAT_EQ(capture.image.value[v], static_cast<float>(0.9 * (936 + 50 * v) / 1000)) << v;
  }
  EXPECT_EQ(capture.use, (std::vector<std::uint8_t>{1, 1, 0, 1, 1, 0}));  // the last pixel reaches 1850
  EXPECT_EQ(capture.masked, 1U);
  EXPECT_EQ(capture.saturated, 1U);
  EXPECT_EQ(capture.dark_frames, 1);
  EXPECT_EQ(capture.white_frames, 2);
  EXPECT_EQ(capture.noise.read_sigma, 3.0);
  EXPECT_EQ(capture.noise.shot_gain, 0.5);
  EXPECT_EQ(capture.noise.quantisation_step, 1.0);
}

TEST_F(CaptureFiles, EveryFormatGivesTheSameCapture) {
  std::mt19937 random(3);
  image::SpectralImage scan = counts(0, 0, 20);
  for (float& value : scan.value) value = static_cast<float>(random() % 4096);
  image::write_band_folder(file("scan"), scan);
  image::write_band_folder(file("pictures"), scan, ".png");
  image::write_mat(file("scan.mat"), scan, image::MatType::kUint16);
  image::write_envi(file("bil.img"), scan,
                    {.interleave = image::Interleave::kBandInterleavedByLine, .type = image::EnviType::kUint16});
  image::write_cube(file("scan.exr"), scan);
  const auto capture = [&](const std::string& name) {
    describe("object = \"" + name + "\"\nbits = 12\ndark_level = 64\n[noise]\nread_sigma = 3\nshot_gain = 0.5\n" +
             "quantisation_step = 1\n");
    return read_capture(file("capture.toml"));
  };
  const Capture first = capture("scan");
  EXPECT_GT(first.used, 20U);
  for (const char* name : {"pictures", "scan.mat", "bil.hdr", "scan.exr"}) {
    const Capture other = capture(name);
    EXPECT_EQ(other.image.value, first.image.value) << name;
    EXPECT_EQ(other.image.wavelength_nm, first.image.wavelength_nm) << name;
    EXPECT_EQ(other.use, first.use) << name;
    EXPECT_EQ(other.variance(5, 1), first.variance(5, 1)) << name;
  }
}

TEST_F(CaptureFiles, BareFloatsNeedNoDescription) {
  image::write_cube(file("scan.exr"), counts(0, 1));
  const Capture capture = read_capture(file("scan.exr"));
  EXPECT_EQ(capture.image.value, counts(0, 1).value);
  EXPECT_THAT(capture.warnings, Contains(HasSubstr("noise is not known")));
  EXPECT_THAT(capture.warnings, Contains(HasSubstr("No dark frame")));
}

TEST_F(CaptureFiles, SaysWhatIsMissingOrContradictory) {
  EXPECT_THAT(message("nothing"), HasSubstr("no such file or folder"));
  image::write_band_folder(file("scan"), counts(1000, 50));
  EXPECT_THAT(message("scan"), AllOf(HasSubstr("whole numbers up to 1850 in 16 bits"), HasSubstr("bits = 12")));
  describe("object = \"scan\"\nbits = 12\n");
  EXPECT_EQ(message(), "");  // the others differ from this in one thing
  describe("object = \"skan\"\nbits = 12\n");
  EXPECT_THAT(message(), AllOf(HasSubstr("capture.toml:1: object"), HasSubstr("\"skan\" was not found")));
  describe("bits = 12\n");
  EXPECT_THAT(message(), HasSubstr("\"object\" is missing"));
  describe("object = \"scan\"\nbit = 12\n");
  EXPECT_THAT(message(), AllOf(HasSubstr("capture.toml:2"), HasSubstr("\"bits\"")));
  describe("object = \"scan\"\nbits = 10\n");
  EXPECT_THAT(message(), AllOf(HasSubstr("1050 counts"), HasSubstr("1023"), HasSubstr("10 bits")));
  describe("object = \"scan\"\nbits = 24\n");
  EXPECT_THAT(message(), AllOf(HasSubstr("values of 16 bits"), HasSubstr("bits = 24")));
  describe("object = \"scan\"\nbits = 12\nlinear = false\n");
  EXPECT_THAT(message(), HasSubstr("declared as not linear"));
  describe("object = \"scan\"\nbits = 12\nwhite = \"scan\"\n");
  EXPECT_THAT(message(), HasSubstr("\"white_reflectance\" is missing"));
  describe("object = \"scan\"\nbits = 12\nwhite_reflectance = 0.99\n");
  EXPECT_THAT(message(), HasSubstr("there is no white frame"));
  describe("object = \"scan\"\nbits = 12\nwhite = \"scan\"\nwhite_reflectance = 99\n");
  EXPECT_THAT(message(), AllOf(HasSubstr("white_reflectance: 99"), HasSubstr("1.2")));
  describe("object = \"scan\"\nbits = 12\nwhite = \"scan\"\nwhite_reflectance = [0.99, 0.98]\n");
  EXPECT_THAT(message(), AllOf(HasSubstr("white_reflectance: 2 values"), HasSubstr("3 bands")));
  std::ofstream(file("short.csv")) << "wavelength,factor\n500,0.9\n510,0.9\n";
  describe("object = \"scan\"\nbits = 12\nwhite = \"scan\"\nwhite_reflectance = \"short.csv\"\n");
  EXPECT_THAT(message(), HasSubstr("short.csv"));
  describe("object = \"scan\"\nbits = 12\nwavelengths_nm = [450, 550]\n");
  EXPECT_THAT(message(), AllOf(HasSubstr("3 bands"), HasSubstr("2 wavelengths")));
  image::write_cube(file("dark.mat"), counts(64, 0));
  describe("object = \"scan\"\nbits = 12\ndark = \"dark.mat\"\n");
  EXPECT_THAT(message(), AllOf(HasSubstr("dark.mat: floats"), HasSubstr("16 bits")));
  image::write_band_folder(file("dark"), counts(64, 0, 4));
  describe("object = \"scan\"\nbits = 12\ndark = \"dark\"\n");
  EXPECT_THAT(message(), AllOf(HasSubstr("dark frame: 4 × 2 pixels"), HasSubstr("3 × 2")));
  describe("object = \"scan\"\nbits = 12\ndark = \"scan\"\ndark_level = 3\n");
  EXPECT_THAT(message(), AllOf(HasSubstr("capture.toml:4: dark_level"), HasSubstr("Remove one")));
  image::write_grey_words(file("mask.png"), 2, 2, {1, 1, 1, 1});
  describe("object = \"scan\"\nbits = 12\nmask = \"mask.png\"\n");
  EXPECT_THAT(message(), AllOf(HasSubstr("mask.png: 2 × 2"), HasSubstr("expected 3 × 2")));
  describe("object = \"scan\"\nbits = 12\n[noise]\nread_sigma = 3\n");
  EXPECT_THAT(message(), HasSubstr("\"shot_gain\" is missing"));
  image::write_png_bytes(file("eight/band_450nm.png"), 1, 1, 1, {7}, {});
  EXPECT_THAT(message("eight"), AllOf(HasSubstr("8-bit values"), HasSubstr("linear = true")));
  describe("object = \"eight\"\nbits = 8\nlinear = true\n");
  EXPECT_EQ(message(), "");
}

}  // namespace
}  // namespace interglow::fitting
