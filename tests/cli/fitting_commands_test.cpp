// SPDX-License-Identifier: GPL-3.0-or-later
// The programs `register`, `compare --register` and `decompose`.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "image/channel_file.h"
#include "image/envi.h"
#include "image/mask_file.h"
#include "image/mat_file.h"
#include "image/spectral_exr.h"
#include "program.h"
#include "tests/temporary_folder.h"

namespace interglow::cli {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

class FittingCommands : public ::testing::Test {
 protected:
  std::string file(const std::string& name) const { return (folder_ / name).string(); }
  nlohmann::json json(const std::string& name) const {
    std::ifstream in(folder_ / name);
    return nlohmann::json::parse(in);
  }

 private:
  const test::TemporaryFolder folder_;
};

/// A few soft spots in two bands, the second twice as bright, seen from (dx, dy) further.
image::SpectralImage spots(double dx, double dy) {
  image::SpectralImage image{64, 64, Eigen::Vector2d(500, 600), {}};
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) {
      double value = 1.0;
      for (int s = 0; s < 12; ++s) {
        const double u = x + dx - (8 + 37 * s % 50), v = y + dy - (10 + 23 * s % 47), width = 3 + s % 4;
        value += (1 + s % 3) * std::exp(-0.5 * (u * u + v * v) / (width * width));
      }
      image.value.push_back(static_cast<float>(value));
      image.value.push_back(static_cast<float>(2 * value));
    }
  }
  return image;
}

TEST_F(FittingCommands, RegisterFindsAShift) {
  // What the reference has at (x, y) the image has at (x - 3.5, y + 1.25).
  image::write_spectral_exr(file("image.exr"), spots(3.5, -1.25));
  image::write_spectral_exr(file("reference.exr"), spots(0, 0));
  const ProgramRun run = run_program("register " + file("image.exr") + " " + file("reference.exr") + " --out " +
                                     file("moved.exr") + " --json " + file("map.json") + " 2>&1");
  ASSERT_EQ(run.status, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("at the corners"));
  const nlohmann::json map = json("map.json")["image_from_reference"];
  EXPECT_NEAR(map[0][0], 1.0, 1e-4);
  EXPECT_NEAR(map[1][0], 0.0, 1e-4);
  EXPECT_NEAR(map[0][2], -3.5, 0.005);
  EXPECT_NEAR(map[1][2], 1.25, 0.005);
  const image::SpectralImage moved = image::read_spectral_exr(file("moved.exr")).image;
  const image::SpectralImage reference = spots(0, 0);
  EXPECT_NEAR(moved.pixel(30, 30)[1], reference.pixel(30, 30)[1], 1e-3);
  EXPECT_EQ(moved.pixel(30, 1)[0], 0.0F);  // lies left of the image
}

TEST_F(FittingCommands, CompareRegistersBefore) {
  image::write_spectral_exr(file("image.exr"), spots(3.5, -1.25));
  image::write_spectral_exr(file("reference.exr"), spots(0, 0));
  const std::string images = "compare " + file("image.exr") + " " + file("reference.exr") + " --json " + file("c.json");
  ASSERT_EQ(run_program(images).status, 0);
  EXPECT_GT(json("c.json")["relative_rmse"], 0.05);
  const ProgramRun run = run_program(images + " --register 2>&1");
  ASSERT_EQ(run.status, 0) << run.output;
  EXPECT_NEAR(json("c.json")["registration"]["gain"], 1.0, 1e-3);
  EXPECT_EQ(json("c.json")["pixels"], (64 - 4) * (64 - 2));  // columns 4 … 63, rows 0 … 61 of the reference are covered
  // Splines continue a picture as in a mirror; the kink's error falls by 0.43 a pixel and is gone 8 pixels inside.
  image::ChannelImage inner{64, 64, {"Y"}, std::vector<float>(64 * 64, 0.0F), {}, {}};
  for (std::size_t y = 12; y < 54; ++y)
    for (std::size_t x = 12; x < 54; ++x) inner.value[y * 64 + x] = 1.0F;
  image::write_exr_channels(file("inner.exr"), inner);
  ASSERT_EQ(run_program(images + " --register --mask " + file("inner.exr")).status, 0);
  EXPECT_EQ(json("c.json")["pixels"], 42 * 42);
  EXPECT_LT(json("c.json")["relative_rmse"], 1e-3);
}

TEST_F(FittingCommands, DecomposeWritesShadingTerms) {
  std::ofstream(file("spectra.csv")) << "wavelength,a,b\n500,1,2\n600,1,0\n700,0,1\n";
  // Pixels 3 a + 4 b and 5 a.
  image::write_spectral_exr(file("image.exr"), {2, 1, Eigen::Vector3d(500, 600, 700), {11, 3, 4, 5, 5, 0}});
  const ProgramRun run = run_program("decompose " + file("image.exr") + " --spectra " + file("spectra.csv:b,a") +
                                     " --out " + file("out") + " 2>&1");
  ASSERT_EQ(run.status, 0) << run.output;
  const image::ChannelImage shading = image::read_exr_channels(file("out/shading.exr"));
  const auto at = [&](const std::string& name, std::size_t pixel) {
    const auto found = std::find(shading.channel.begin(), shading.channel.end(), name);
    return shading.value[pixel * shading.channel.size() + static_cast<std::size_t>(found - shading.channel.begin())];
  };
  EXPECT_NEAR(at("a", 0), 3, 1e-5);
  EXPECT_NEAR(at("b", 0), 4, 1e-5);
  EXPECT_NEAR(at("a", 1), 5, 1e-5);
  EXPECT_NEAR(at("b", 1), 0, 1e-5);
  const nlohmann::json figures = json("out/decomposition.json");
  EXPECT_EQ(figures["pixels"], 2);
  // cos φ = (1·2) / (√2 √5)
  EXPECT_NEAR(figures["objects"][0]["sine_to_span_of_others"][0], std::sqrt(1 - 4.0 / 10.0), 1e-12);
}

TEST_F(FittingCommands, CapturesAreCorrectedConvertedAndDecomposed) {
  std::ofstream(file("spectra.csv")) << "wavelength,a,b\n500,1,2\n600,1,0\n700,0,1\n";
  // Above a dark level of 100: 30 a + 40 b, 50 a, and a pixel at full scale.
  image::write_envi(file("scan.img"),
                    {3, 1, Eigen::Vector3d(500, 600, 700), {210, 130, 140, 150, 150, 100, 1023, 100, 100}},
                    {.type = image::EnviType::kUint16});
  std::ofstream(file("capture.toml")) << "object = \"scan.hdr\"\nbits = 10\ndark_level = 100\n"
                                         "saturation_margin_px = 0\n[noise]\nread_sigma = 2\nshot_gain = 0.5\n";
  const ProgramRun shown = run_program("capture " + file("capture.toml") + " --out " + file("corrected.mat") +
                                       " --use " + file("use.png") + " 2>&1");
  ASSERT_EQ(shown.status, 0) << shown.output;
  EXPECT_THAT(shown.output, AllOf(HasSubstr("3 × 1 pixels, 3 bands from 500 to 700 nm"),
                                  HasSubstr("pixels used: 2 (66.7 %); masked 0, saturated 1, invalid 0")));
  EXPECT_EQ(image::read_mat(file("corrected.mat")).image.value,
            (std::vector<float>{110, 30, 40, 50, 50, 0, 923, 0, 0}));
  EXPECT_EQ(image::read_mask(file("use.png"), 3, 1), (std::vector<std::uint8_t>{1, 1, 0}));
  const ProgramRun run = run_program("decompose " + file("capture.toml") + " --spectra " + file("spectra.csv") +
                                     " --out " + file("out") + " 2>&1");
  ASSERT_EQ(run.status, 0) << run.output;
  const image::ChannelImage shading = image::read_exr_channels(file("out/shading.exr"));
  const auto at = [&](const std::string& name, std::size_t pixel) {
    const auto found = std::find(shading.channel.begin(), shading.channel.end(), name);
    return shading.value[pixel * shading.channel.size() + static_cast<std::size_t>(found - shading.channel.begin())];
  };
  EXPECT_NEAR(at("a", 0), 30, 1e-4);
  EXPECT_NEAR(at("b", 0), 40, 1e-4);
  EXPECT_NEAR(at("a", 1), 50, 1e-4);
  EXPECT_TRUE(std::isnan(at("a", 2)));
  const ProgramRun wrong = run_program("capture " + file("scan.hdr") + " 2>&1");
  EXPECT_EQ(wrong.status, 2);
  EXPECT_THAT(wrong.output, HasSubstr("whole numbers up to 1023 in 16 bits"));
}

TEST_F(FittingCommands, DecomposeNamesWhatItCannotUse) {
  std::ofstream(file("spectra.csv")) << "wavelength,a,b\n500,1,2\n600,1,2\n700,3,6\n";
  image::write_spectral_exr(file("image.exr"), {2, 1, Eigen::Vector3d(500, 600, 700), {11, 3, 4, 5, 5, 0}});
  const std::string command = "decompose " + file("image.exr") + " --out " + file("out") + " --spectra ";
  const ProgramRun same = run_program(command + file("spectra.csv") + " 2>&1");
  EXPECT_EQ(same.status, 2);
  EXPECT_THAT(same.output, HasSubstr("\"a\" and \"b\" nearly coincide"));
  const ProgramRun unknown = run_program(command + file("spectra.csv:a,c") + " 2>&1");
  EXPECT_EQ(unknown.status, 2);
  EXPECT_THAT(unknown.output, AllOf(HasSubstr("no column \"c\""), HasSubstr("a, b")));
  EXPECT_FALSE(fs::exists(file("out/decomposition.json")));
}

}  // namespace
}  // namespace interglow::cli
