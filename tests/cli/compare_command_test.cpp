// SPDX-License-Identifier: GPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "image/spectral_exr.h"
#include "tests/cli/program.h"
#include "tests/temporary_folder.h"

namespace interglow {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

using cli::ProgramRun;

/// Arguments that need no quoting; stdout and stderr.
ProgramRun run_program(const std::string& arguments) { return cli::run_program(arguments + " 2>&1"); }

class CompareCommand : public ::testing::Test {
 protected:
  void SetUp() override {
    const Eigen::Vector3d bands(450, 550, 650);
    image::write_spectral_exr(folder_ / "a.exr", {2, 1, bands, {1, 1, 1, 2, 0, 0}});
    image::write_spectral_exr(folder_ / "b.exr", {2, 1, bands, {2, 2, 2, 2, 2, 0}});
  }
  std::string file(const std::string& name) const { return (folder_ / name).string(); }

 private:
  const test::TemporaryFolder folder_;
};

TEST_F(CompareCommand, WritesFiguresAndMaps) {
  const ProgramRun run = run_program("compare " + file("a.exr") + " " + file("b.exr") + " --json " +
                                     file("figures.json") + " --out " + file("maps"));
  ASSERT_EQ(run.status, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("spectral angle"));
  std::ifstream stream(file("figures.json"));
  const nlohmann::json figures = nlohmann::json::parse(stream);
  // The first pixels are parallel, the second 45 degrees apart.
  EXPECT_NEAR(figures.at("spectral_angle_deg").at("mean").get<double>(), 22.5, 1e-5);
  EXPECT_EQ(figures.at("pixels"), 2);
  // Differences (-1, -1, -1) and (0, -2, 0): RMSE sqrt(7/6) of a reference mean 10/6.
  EXPECT_NEAR(figures.at("relative_rmse").get<double>(), std::sqrt(7.0 / 6.0) / (10.0 / 6.0), 1e-12);
  EXPECT_EQ(figures.at("wavelength_nm"), (std::vector<double>{450, 550, 650}));
  for (const char* name : {"spectral_angle.png", "delta_srgb.png", "ciede2000.png", "relative_rmse.png", "maps.exr"}) {
    EXPECT_TRUE(fs::exists(fs::path(file("maps")) / name)) << name;
  }
}

TEST_F(CompareCommand, BadInputIsStatus2AndLeavesNothing) {
  const ProgramRun missing =
      run_program("compare " + file("a.exr") + " " + file("none.exr") + " --out " + file("maps"));
  EXPECT_EQ(missing.status, 2);
  EXPECT_THAT(missing.output, HasSubstr("none.exr"));
  image::write_spectral_exr(file("c.exr"), {1, 1, Eigen::Vector3d(450, 550, 650), {1, 1, 1}});
  const ProgramRun sizes =
      run_program("compare " + file("a.exr") + " " + file("c.exr") + " --json " + file("figures.json"));
  EXPECT_EQ(sizes.status, 2);
  EXPECT_THAT(sizes.output, HasSubstr("2 x 1"));
  EXPECT_EQ(run_program("compare " + file("a.exr")).status, 2);
  EXPECT_FALSE(fs::exists(file("maps")));
  EXPECT_FALSE(fs::exists(file("figures.json")));
}

}  // namespace
}  // namespace interglow
