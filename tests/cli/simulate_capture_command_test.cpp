// SPDX-License-Identifier: GPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>

#include "fitting/capture_file.h"
#include "image/spectral_exr.h"
#include "tests/cli/program.h"
#include "tests/cli/two_sheets.h"

namespace interglow::cli {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class SimulateCapture : public TwoSheets {
 protected:
  void SetUp() override {
    TwoSheets::SetUp();
    write("scene.toml", scene(100, 24, 20));
  }
  ProgramRun simulate(const std::string& out, const std::string& options) const {
    return run_program("simulate-capture " + file("scene.toml").string() + " --out " + file(out).string() + " " +
                       options + " 2>&1");
  }
  nlohmann::json truth(const std::string& out) const {
    std::ifstream in(file(out) / "truth.json");
    return nlohmann::json::parse(in);
  }
};

// 480 pixels of three bands: χ² of 1440 values about the ideal radiance times counts per radiance. False-alarm rate
// 1e-6: |χ² - 1440| < 4.9 √2880.
TEST_F(SimulateCapture, IsReadAsItIsAndHasItsNoise) {
  const ProgramRun run = simulate("cap", "--gain-spread 0.1 --dark-frames 4 --full-well 1e5");
  ASSERT_EQ(run.status, 0) << run.output;
  const fitting::Capture capture = fitting::read_capture(file("cap"));
  EXPECT_EQ(capture.used, 480U);
  EXPECT_EQ(capture.bits, 12);
  const image::SpectralImage ideal = image::read_spectral_exr(file("cap/ideal.exr")).image;
  const nlohmann::json sensor = truth("cap")["sensor"];
  double chi2 = 0.0;
  for (std::size_t p = 0; p < 480; ++p) {
    for (std::size_t b = 0; b < 3; ++b) {
      const double expected = ideal.value[3 * p + b] * sensor["counts_per_radiance"][b].get<double>();
      const double off = capture.image.value[3 * p + b] - expected;
      chi2 += off * off / capture.variance(p, static_cast<int>(b), expected);
    }
  }
  EXPECT_NEAR(chi2, 1440.0, 4.9 * std::sqrt(2880.0));
}

TEST_F(SimulateCapture, EveryFormatAndNumberOfThreadsGivesTheSameCapture) {
  const std::string options = "--white-frames 1 --blur 1 --glare 0.03 --stray 0.005 --turn 2 --seed 5 ";
  ASSERT_EQ(simulate("tif", options + "--threads 1").status, 0);
  const fitting::Capture first = fitting::read_capture(file("tif"));
  for (const std::string format : {"png", "envi", "mat"}) {
    const ProgramRun run = simulate(format, options + "--threads 2 --format " + format);
    ASSERT_EQ(run.status, 0) << run.output;
    const fitting::Capture other = fitting::read_capture(file(format));
    EXPECT_EQ(other.image.value, first.image.value) << format;
    EXPECT_EQ(other.use, first.use) << format;
    EXPECT_EQ(other.noise.read_sigma, first.noise.read_sigma) << format;
  }
  EXPECT_TRUE(first.has_white());
}

TEST_F(SimulateCapture, ScalesTheLightBetweenTheObjects) {
  // total(k) = direct + k · indirect, so total(3) - total(1) = 2 (total(2) - total(1)).
  for (const std::string k : {"1", "2", "3"}) ASSERT_EQ(simulate(k, "--w-ratio " + k).status, 0);
  const auto ideal = [&](const std::string& name) {
    return image::read_spectral_exr(file(name) / "ideal.exr").image.value;
  };
  const auto one = ideal("1"), two = ideal("2"), three = ideal("3");
  float largest = 0.0F;
  for (std::size_t v = 0; v < one.size(); ++v) {
    EXPECT_NEAR(three[v] - one[v], 2 * (two[v] - one[v]), 1e-6);
    largest = std::max(largest, (two[v] - one[v]) / std::max(one[v], 1e-9F));
  }
  EXPECT_GT(largest, 0.05F);
  EXPECT_EQ(truth("2")["w_over_w_simulated"], 2.0);
}

TEST_F(SimulateCapture, PathTracedPicturesAgreeWithTheRadiositysMean) {
  ASSERT_EQ(simulate("r", "--edge-length 4").status, 0);
  const ProgramRun run = simulate("p", "--path-traced 256");
  ASSERT_EQ(run.status, 0) << run.output;
  const auto mean = [&](const std::string& name) {
    const auto image = image::read_spectral_exr(file(name) / "ideal.exr").image;
    double sum = 0.0;
    for (const float value : image.value) sum += value;
    return sum / static_cast<double>(image.value.size());
  };
  const double error = truth("p")["path_tracer"]["relative_error"];  // of a pixel; the mean's is √480 smaller
  EXPECT_GT(error, 0.0);
  EXPECT_LT(error, 0.05);
  // 5 standard errors, and what the patches and the edges of 24 × 20 pixels may differ by.
  EXPECT_NEAR(mean("p") / mean("r"), 1.0, 5 * error / std::sqrt(480.0) + 0.005);
}

TEST_F(SimulateCapture, BadOptionsAreNamedAndLeaveNothing) {
  EXPECT_EQ(simulate("x", "--bits 40").status, 2);
  EXPECT_THAT(simulate("x", "--bits 40").output, HasSubstr("bits = 40; expected 2 to 16"));
  EXPECT_THAT(simulate("x", "--size 2").output, HasSubstr("--size 2"));
  EXPECT_THAT(simulate("x", "--w-ratio -1").output, HasSubstr("--w-ratio -1"));
  EXPECT_FALSE(fs::exists(file("x")));
}

}  // namespace
}  // namespace interglow::cli
