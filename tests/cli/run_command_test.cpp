// SPDX-License-Identifier: GPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "image/spectral_exr.h"
#include "tests/cli/program.h"
#include "tests/temporary_folder.h"

namespace interglow::cli {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// Two sheets at a right angle, red and yellow fluorescent paper; z = 0 and x = 0 for x, z in 0..40 mm.
constexpr const char* kScene = R"([material.red]
donaldson = "interglow:fluorescent/paper_red"
[material.yellow]
donaldson = "interglow:fluorescent/paper_yellow"
[object.floor]
mesh = "floor.obj"
material = "red"
remesh = "none"
[object.wall]
mesh = "wall.obj"
material = "yellow"
remesh = "none"
[light.sun]
kind = "directional"
direction = [-1, 0.2, -1]
spectrum = "interglow:illuminants/sunlight_am15"
[camera]
position_mm = [200, 20, 200]
target_mm = [10, 20, 10]
up = [0, 0, 1]
horizontal_fov_deg = 12
width_px = 24
height_px = 20
[output]
split_li = true
spectra_px = [[12, 10]]
[solve]
)";

/// A sheet of n x n squares of 40 mm: corners at origin + i a + j b, front towards a × b.
std::string sheet(int n, const char* a_and_b) {
  std::string text;
  for (int j = 0; j <= n; ++j) {
    for (int i = 0; i <= n; ++i) {
      const std::string u = std::to_string(40.0 * i / n);
      const std::string v = std::to_string(40.0 * j / n);
      text += std::string("v ") + (std::string(a_and_b) == "xy" ? u + " " + v + " 0\n" : "0 " + u + " " + v + "\n");
    }
  }
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) {
      const int k = j * (n + 1) + i + 1;
      text += "f " + std::to_string(k) + " " + std::to_string(k + 1) + " " + std::to_string(k + n + 2) + " " +
              std::to_string(k + n + 1) + "\n";
    }
  }
  return text;
}

class RunCommand : public testing::Test {
 protected:
  void SetUp() override {
    std::ofstream(folder_ / "floor.obj") << sheet(6, "xy");
    std::ofstream(folder_ / "wall.obj") << sheet(6, "yz");
  }

  /// Runs the program on the scene with more [solve] lines; returns the exit status.
  int run(const std::string& out, const std::string& solve, const std::string& arguments = "") {
    std::ofstream(folder_ / "scene.toml") << kScene << solve << "\n";
    const ProgramRun finished = run_program("run " + (folder_ / "scene.toml").string() + " --out " +
                                            (folder_ / out).string() + " " + arguments + " 2>&1");
    output_ = finished.output;
    return finished.status;
  }
  image::SpectralImage picture(const std::string& out, const std::string& name) const {
    return image::read_spectral_exr(folder_ / out / (name + ".exr")).image;
  }
  nlohmann::json result(const std::string& out) const {
    std::ifstream stream(folder_ / out / "result.json");
    return nlohmann::json::parse(stream);
  }

  const test::TemporaryFolder folder_;
  std::string output_;
};

float largest(const image::SpectralImage& image) { return *std::max_element(image.value.begin(), image.value.end()); }

TEST_F(RunCommand, WritesEverythingItNames) {
  ASSERT_EQ(run("out", ""), 0) << output_;
  for (const char* name : {"image", "components/re", "components/rr", "components/le", "components/li", "components/rl",
                           "components/lr", "components/ll"}) {
    EXPECT_TRUE(fs::is_regular_file(folder_ / "out" / (std::string(name) + ".exr"))) << name;
    EXPECT_TRUE(fs::is_regular_file(folder_ / "out" / (std::string(name) + ".png"))) << name;
  }
  const nlohmann::json json = result("out");
  for (const auto& file : json["files"])
    EXPECT_TRUE(fs::is_regular_file(folder_ / "out" / file.get<std::string>())) << file;
  EXPECT_EQ(json["patches"], 144);
  EXPECT_EQ(json["inputs"].size(), 6U) << "scene, two tables, two meshes, one lamp";
  EXPECT_TRUE(json["solve"]["converged"]);
  EXPECT_LT(json["energy"]["relative_error"].get<double>(), 1e-6);
  EXPECT_EQ(json["image"]["bands"], 61);
  EXPECT_GT(json["contact"]["w_prime"].get<double>(), 0.0);
  EXPECT_THAT(output_, HasSubstr("energy balance"));
  EXPECT_THAT(output_, HasSubstr("w'"));
}

TEST_F(RunCommand, ComponentsAddUpToThePicture) {
  ASSERT_EQ(run("out", ""), 0) << output_;
  const image::SpectralImage whole = picture("out", "image");
  std::vector<double> sum(whole.value.size(), 0.0);
  for (const char* name : {"re", "rr", "le", "li", "rl"}) {
    const image::SpectralImage part = picture("out", std::string("components/") + name);
    ASSERT_EQ(part.value.size(), whole.value.size());
    EXPECT_GT(largest(part), 0.0F) << name;
    for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += part.value[k];
  }
  for (std::size_t k = 0; k < sum.size(); ++k) {
    ASSERT_NEAR(sum[k], whole.value[k], 1e-5 * std::abs(whole.value[k]) + 1e-9 * largest(whole)) << "value " << k;
  }
}

TEST_F(RunCommand, SameBitsForAnyNumberOfThreads) {
  ASSERT_EQ(run("one", "", "--threads 1"), 0) << output_;
  ASSERT_EQ(run("two", "", "--threads 2"), 0) << output_;
  for (const char* name : {"image", "components/rr", "components/li"}) {
    EXPECT_EQ(picture("one", name).value, picture("two", name).value) << name;
  }
}

TEST_F(RunCommand, WithoutBouncesOnlyDirectLightIsLeft) {
  ASSERT_EQ(run("all", ""), 0) << output_;
  ASSERT_EQ(run("direct", "", "--bounces 0"), 0) << output_;
  for (const char* name : {"rr", "li", "rl"})
    EXPECT_EQ(largest(picture("direct", std::string("components/") + name)), 0.0F) << name;
  for (const char* name : {"re", "le"}) {
    EXPECT_EQ(picture("direct", std::string("components/") + name).value,
              picture("all", std::string("components/") + name).value)
        << name;
  }
  EXPECT_EQ(result("direct")["settings"]["bounces"], 0);
  EXPECT_EQ(result("all")["settings"]["bounces"], "inf");
}

// With one bounce between two flat sheets under one lamp, the light that arrives from the neighbour has the spectrum
// S_j E (and D_L E) times one factor a point, which is what the paper's model assumes: both must give the same picture.
TEST_F(RunCommand, PaperModelIsExactForOneBounce) {
  ASSERT_EQ(run("exact", "bounces = 1"), 0) << output_;
  ASSERT_EQ(run("paper", "bounces = 1\nmodel = \"paper\""), 0) << output_;
  for (const char* name :
       {"image", "components/re", "components/rr", "components/le", "components/li", "components/rl"}) {
    const image::SpectralImage exact = picture("exact", name);
    const image::SpectralImage paper = picture("paper", name);
    ASSERT_EQ(exact.value.size(), paper.value.size());
    // Single precision (6e-8) times the condition of the two spectra in the least squares, some hundreds.
    const double limit = 1e-4 * largest(exact);
    for (std::size_t k = 0; k < exact.value.size(); ++k)
      ASSERT_NEAR(exact.value[k], paper.value[k], limit) << name << " value " << k;
  }
}

TEST_F(RunCommand, BadInputGivesStatus2AndWritesNothing) {
  EXPECT_EQ(run("out", "bouncs = 2"), 2);
  EXPECT_THAT(output_, HasSubstr("solve.bouncs"));
  EXPECT_THAT(output_, HasSubstr("\"bounces\""));
  EXPECT_EQ(run("out", "", "--bounces many"), 2);
  EXPECT_THAT(output_, HasSubstr("many"));
  EXPECT_EQ(run("out", "", "--no-such-option"), 2);
  std::ofstream(folder_ / "floor.obj") << "v 0 0 0\nv 1 x 0\n";
  EXPECT_EQ(run("out", ""), 2);
  EXPECT_THAT(output_, HasSubstr("floor.obj"));
  EXPECT_FALSE(fs::exists(folder_ / "out"));
}

}  // namespace
}  // namespace interglow::cli
