// SPDX-License-Identifier: GPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "image/spectral_exr.h"
#include "tests/cli/program.h"
#include "tests/cli/two_sheets.h"

namespace interglow::cli {
namespace {

using testing::AllOf;
using testing::HasSubstr;

class WRatioCommand : public TwoSheets {
 protected:
  void SetUp() override {
    TwoSheets::SetUp();
    const std::string sheets = scene(50, 48, 40, "subdivide_mm = 8") + "[output]\ncontact_region_mm = 12\n";
    write("one.toml", sheets + "[solve]\nbounces = 1\n");
    write("all.toml", sheets);
  }
  std::string file(const std::string& name) const { return TwoSheets::file(name).string(); }
  ProgramRun ratio(const std::string& scene, const std::string& capture, const std::string& options = "") const {
    return run_program("w-ratio " + file(scene) + " --capture " + file(capture) + " --out " + file("out") + " " +
                       options + " 2>&1");
  }
  nlohmann::json figures() const {
    std::ifstream in(TwoSheets::file("out") / "w_ratio.json");
    return nlohmann::json::parse(in);
  }
};

TEST_F(WRatioCommand, FindsTheFactorOfOneBounceExactly) {
  ASSERT_EQ(run_program("simulate-capture " + file("one.toml") + " --out " + file("cap") +
                        " --w-ratio 1.5 --white-frames 1 --gain-spread 0.1")
                .status,
            0);
  // Without the camera: what is left is the rounding to single precision and the interpolation of the gather.
  const ProgramRun exact = ratio("one.toml", "cap/ideal.exr");
  ASSERT_EQ(exact.status, 0) << exact.output;
  EXPECT_NEAR(figures()["region"]["w_over_w_simulated"], 1.5, 1e-4);
  EXPECT_NEAR(figures()["equivalent_factor"]["factor"], 1.5, 1e-4);
  EXPECT_NEAR(figures()["equivalent_factor"]["slope"], 1.0, 1e-3);
  EXPECT_EQ(figures()["capture_decomposition"]["components"], (std::vector<std::string>{"re", "rr"}));
  for (const auto& point : figures()["curve"]) EXPECT_NEAR(point["w_over_w_simulated"], 1.5, 1e-4) << point;
  // With it: unknown gains cancel against the white frame, noise remains. False-alarm rate 1e-6.
  const ProgramRun noisy = ratio("one.toml", "cap");
  ASSERT_EQ(noisy.status, 0) << noisy.output;
  const double sd = figures()["tile_sd"];
  EXPECT_LT(sd, 0.05);
  EXPECT_NEAR(figures()["region"]["w_over_w_simulated"], 1.5, 4.9 * sd);
}

TEST_F(WRatioCommand, EquivalentFactorDoesNotOweToLaterBounces) {
  ASSERT_EQ(run_program("simulate-capture " + file("all.toml") + " --out " + file("cap") + " --w-ratio 1.5").status, 0);
  const ProgramRun run = ratio("all.toml", "cap/ideal.exr");
  ASSERT_EQ(run.status, 0) << run.output;
  EXPECT_NEAR(figures()["equivalent_factor"]["factor"], 1.5, 1e-4);
  EXPECT_THAT(run.output, HasSubstr("1.5000 ± "));
}

TEST_F(WRatioCommand, NamesWhatItCannotUse) {
  image::write_spectral_exr(file("tall.exr"),
                            {40, 48, Eigen::VectorXd::LinSpaced(5, 450, 650), std::vector<float>(40 * 48 * 5, 1.0F)});
  EXPECT_THAT(ratio("one.toml", "tall.exr").output, AllOf(HasSubstr("40 × 48"), HasSubstr("48 × 40")));
  image::write_spectral_exr(file("other.exr"),
                            {48, 40, Eigen::VectorXd::LinSpaced(5, 400, 600), std::vector<float>(40 * 48 * 5, 1.0F)});
  const ProgramRun bands = ratio("one.toml", "other.exr");
  EXPECT_EQ(bands.status, 2);
  EXPECT_THAT(bands.output, HasSubstr("a band at 400 nm"));
}

}  // namespace
}  // namespace interglow::cli
