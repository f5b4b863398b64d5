// SPDX-License-Identifier: GPL-3.0-or-later
#include "image/spectral_exr.h"

#include <OpenImageIO/imageio.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <random>

#include "diagnostics/error.h"
#include "tests/temporary_folder.h"

namespace interglow::image {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

class SpectralExr : public ::testing::Test {
 protected:
  fs::path file(const std::string& name) const { return folder_ / name; }

 private:
  const test::TemporaryFolder folder_;
};

SpectralImage random_image(int width, int height, int bands) {
  SpectralImage image{width, height, Eigen::VectorXd::LinSpaced(bands, 400, 400 + 5 * (bands - 1)), {}};
  image.value.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height) *
                     static_cast<std::size_t>(bands));
  std::mt19937 random(7);
  std::normal_distribution<float> normal;
  for (float& value : image.value) value = normal(random);
  return image;
}

/// Writes channels of random numbers as another program would.
void write_foreign(const fs::path& path, const std::vector<std::string>& channels, const std::vector<float>& value,
                   int width, int height, OIIO::TypeDesc stored = OIIO::TypeFloat) {
  auto output = OIIO::ImageOutput::create("exr");
  OIIO::ImageSpec spec(width, height, static_cast<int>(channels.size()), stored);
  spec.channelnames = channels;
  ASSERT_TRUE(output->open(path.string(), spec)) << output->geterror();
  ASSERT_TRUE(output->write_image(OIIO::TypeFloat, value.data()));
  ASSERT_TRUE(output->close());
}

std::string refusal(const fs::path& path) {
  try {
    read_spectral_exr(path);
  } catch (const InvalidInput& error) {
    return error.what();
  }
  ADD_FAILURE() << path << " was not refused";
  return {};
}

TEST_F(SpectralExr, RoundTripKeepsEveryBit) {
  SpectralImage image = random_image(13, 7, 61);
  image.value[0] = -0.0F;
  image.value[1] = std::numeric_limits<float>::denorm_min();
  image.value[2] = std::numeric_limits<float>::max();
  write_spectral_exr(file("image.exr"), image,
                     {{"interglow:version", "0.1.0"}, {"interglow:command", "interglow run a.toml"}});
  const SpectralFile back = read_spectral_exr(file("image.exr"));
  EXPECT_EQ(back.image.width, 13);
  EXPECT_EQ(back.image.height, 7);
  EXPECT_EQ(back.image.wavelength_nm, image.wavelength_nm);
  ASSERT_EQ(back.image.value.size(), image.value.size());
  for (std::size_t i = 0; i < image.value.size(); ++i) {
    ASSERT_EQ(std::signbit(back.image.value[i]), std::signbit(image.value[i])) << i;
    ASSERT_EQ(back.image.value[i], image.value[i]) << i;
  }
  EXPECT_EQ(back.emissive_units, "W.m^-2.sr^-1");
  EXPECT_THAT(back.attributes, ::testing::Contains(::testing::Pair("interglow:command", "interglow run a.toml")));
  EXPECT_EQ(std::distance(fs::directory_iterator(file("")), fs::directory_iterator()), 1) << "a temporary file is left";
}

TEST_F(SpectralExr, HasThePublishedChannelsAndAttributes) {
  const SpectralImage image = random_image(4, 3, 3);
  RgbImage preview{4, 3, std::vector<float>(36, 0.25F), 8.0, 0.0};
  write_spectral_exr(file("image.exr"), image, preview);
  auto input = OIIO::ImageInput::open(file("image.exr").string());
  ASSERT_TRUE(input) << OIIO::geterror();
  const OIIO::ImageSpec& spec = input->spec();
  EXPECT_THAT(spec.channelnames,
              ::testing::UnorderedElementsAre("R", "G", "B", "S0.400,000000nm", "S0.405,000000nm", "S0.410,000000nm"));
  EXPECT_EQ(spec.format, OIIO::TypeFloat);
  EXPECT_EQ(spec.get_string_attribute("spectralLayoutVersion"), "1.0");
  EXPECT_EQ(spec.get_string_attribute("emissiveUnits"), "W.m^-2.sr^-1");
  EXPECT_EQ(spec.get_float_attribute("EV"), 3.0F);
  std::vector<float> all(4 * 3 * 6);
  ASSERT_TRUE(input->read_image(0, 0, 0, 6, OIIO::TypeFloat, all.data()));
  const auto channel = [&](const std::string& name) { return static_cast<std::size_t>(spec.channelindex(name)); };
  for (std::size_t p = 0; p < 12; ++p) {
    EXPECT_EQ(all[6 * p + channel("G")], 0.25F);
    EXPECT_EQ(all[6 * p + channel("S0.405,000000nm")], image.value[3 * p + 1]) << "pixel " << p;
  }
}

TEST_F(SpectralExr, ReadsOtherWritersNamesInAnyOrder) {
  // 5.5e-7 m, 402.5 nm, 0.6 um, 428.274940 THz (700 nm), beside what is none of ours.
  const std::vector<std::string> channels = {
      "B", "S0.5,5e-7m", "S0.402,500nm", "S1.402,500nm", "S0.428,274940THz", "S0.0.6um", "A"};
  std::vector<float> value;
  for (int p = 0; p < 6; ++p) {
    for (int c = 0; c < 7; ++c) value.push_back(static_cast<float>(10 * p + c));
  }
  write_foreign(file("other.exr"), channels, value, 3, 2);
  const SpectralImage image = read_spectral_exr(file("other.exr")).image;
  ASSERT_EQ(image.bands(), 4);
  EXPECT_EQ(image.wavelength_nm[0], 402.5);
  EXPECT_NEAR(image.wavelength_nm[1], 550.0, 1e-9);
  EXPECT_NEAR(image.wavelength_nm[2], 600.0, 1e-9);
  EXPECT_NEAR(image.wavelength_nm[3], 700.0, 1e-4);
  for (int p = 0; p < 6; ++p) {
    const float* pixel = image.pixel(p / 3, p % 3);
    const float base = static_cast<float>(10 * p);
    EXPECT_EQ(std::vector<float>(pixel, pixel + 4), (std::vector<float>{base + 2, base + 1, base + 5, base + 4}));
  }
}

TEST_F(SpectralExr, ReadsHalfPrecisionAndGrey) {
  write_foreign(file("grey.exr"), {"Y"}, {0.5F, 0.25F, 1.0F, 2.0F}, 2, 2, OIIO::TypeHalf);
  const SpectralImage image = read_spectral_exr(file("grey.exr")).image;
  ASSERT_EQ(image.bands(), 1);
  EXPECT_EQ(image.wavelength_nm[0], kGreyWavelengthNm);
  EXPECT_EQ(image.value, (std::vector<float>{0.5F, 0.25F, 1.0F, 2.0F}));
}

TEST_F(SpectralExr, RefusesWhatIsNoSpectralImage) {
  write_foreign(file("rgb.exr"), {"R", "G", "B"}, std::vector<float>(12, 1.0F), 2, 2);
  EXPECT_THAT(refusal(file("rgb.exr")), AllOf(HasSubstr("rgb.exr"), HasSubstr("S0.550,000000nm")));
  write_foreign(file("twice.exr"), {"S0.550nm", "S0.550,0nm"}, std::vector<float>(8, 1.0F), 2, 2);
  EXPECT_THAT(refusal(file("twice.exr")),
              AllOf(HasSubstr("S0.550nm"), HasSubstr("S0.550,0nm"), HasSubstr("same wavelength")));
  write_foreign(file("nan.exr"), {"S0.550nm"}, {0, 1, std::nanf(""), 3, 4, 5}, 2, 3);
  EXPECT_THAT(refusal(file("nan.exr")), AllOf(HasSubstr("row 1, column 0"), HasSubstr("nan"), HasSubstr("S0.550nm")));
  EXPECT_THAT(refusal(file("absent.exr")), HasSubstr("cannot be opened"));
  EXPECT_THAT(refusal(file("")), HasSubstr("folder"));
  std::ofstream(file("text.exr")) << "wavelength_nm,S\n";
  EXPECT_THAT(refusal(file("text.exr")), HasSubstr("not an OpenEXR file"));
}

TEST_F(SpectralExr, RefusesEveryTruncation) {
  write_spectral_exr(file("whole.exr"), random_image(8, 8, 5));
  std::ifstream stream(file("whole.exr"), std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(stream)), {});
  for (const double share : {0.001, 0.1, 0.3, 0.6, 0.9}) {
    const auto size = static_cast<std::size_t>(share * static_cast<double>(bytes.size()));
    std::ofstream(file("cut.exr"), std::ios::binary) << bytes.substr(0, size);
    EXPECT_THAT(refusal(file("cut.exr")), HasSubstr("cut.exr")) << size << " of " << bytes.size() << " bytes";
  }
}

TEST_F(SpectralExr, RefusesAHeaderThatPromisesTooMuch) {
  write_foreign(file("small.exr"), {"Y"}, std::vector<float>(64, 1.0F), 8, 8);
  std::ifstream stream(file("small.exr"), std::ios::binary);
  std::string bytes((std::istreambuf_iterator<char>(stream)), {});
  for (const std::string name : {"dataWindow", "displayWindow"}) {
    // box2i after the name, type name and size: xMin yMin xMax yMax; 7 becomes 99999.
    const std::size_t box = bytes.find(name) + name.size() + 1 + std::string("box2i").size() + 1 + 4;
    for (const std::size_t corner : {box + 8, box + 12}) bytes.replace(corner, 4, std::string("\x9f\x86\x01\x00", 4));
  }
  std::ofstream(file("huge.exr"), std::ios::binary) << bytes;
  EXPECT_THAT(refusal(file("huge.exr")), HasSubstr("huge.exr"));
}

TEST_F(SpectralExr, RefusesToWriteWhatDoesNotFit) {
  const SpectralImage image = random_image(4, 4, 3);
  const RgbImage preview{2, 2, std::vector<float>(12, 0.0F), 1.0, 0.0};
  EXPECT_THROW(write_spectral_exr(file("image.exr"), image, preview), InvalidParams);
  EXPECT_THROW(write_spectral_exr(file("image.png"), image), InvalidParams);
  EXPECT_THROW(write_spectral_exr("/proc/none/image.exr", image), InvalidInput);
  EXPECT_FALSE(fs::exists(file("image.exr")));
}

}  // namespace
}  // namespace interglow::image
