// SPDX-License-Identifier: GPL-3.0-or-later
// Exit status and files of the command; what it judges by is tested with the statistics and with planted faults.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>

#include "files/atomic_file.h"
#include "tests/cli/program.h"
#include "tests/temporary_folder.h"

namespace interglow::cli {
namespace {

using testing::HasSubstr;
using testing::StartsWith;
namespace fs = std::filesystem;

/// A right-angled corner of two squares under a beam that lights the floor alone.
void write_corner(const test::TemporaryFolder& folder) {
  files::write_text_atomically(folder / "floor.obj", "v 0 0 0\nv 8 0 0\nv 8 8 0\nv 0 8 0\nf 1 2 3 4\n");
  files::write_text_atomically(folder / "wall.obj", "v 0 0 0\nv 0 8 0\nv 0 8 8\nv 0 0 8\nf 1 2 3 4\n");
  files::write_text_atomically(folder / "scene.toml", R"(
[wavelengths]
centers_nm = [450, 550]
[material.grey]
reflectance = 0.5
[object.floor]
mesh = "floor.obj"
material = "grey"
remesh = "none"
subdivide_mm = 2
[object.wall]
mesh = "wall.obj"
material = "grey"
remesh = "none"
subdivide_mm = 2
[light.sun]
kind = "directional"
direction = [0, 0, -1]
spectrum = 1
[camera]
position_mm = [60, 4, 60]
target_mm = [2, 4, 2]
up = [0, 1, 0]
horizontal_fov_deg = 5
width_px = 16
height_px = 16
first_nm = 450
last_nm = 550
)");
}

ProgramRun cross_check(const test::TemporaryFolder& folder, const std::string& options) {
  return run_program("cross-check '" + (folder / "scene.toml").string() + "' --out '" + (folder / "check").string() +
                     "' --tiles 2 --margin 0.05 " + options + " 2>&1");
}

TEST(CrossCheckCommand, SaysThatBothMethodsAgreeAndWritesTheReport) {
  const test::TemporaryFolder folder;
  write_corner(folder);
  const ProgramRun run = cross_check(folder, "");
  EXPECT_EQ(run.status, 0) << run.output;
  EXPECT_THAT(run.output, StartsWith("agrees: Within 5 % with 99 % confidence"));
  EXPECT_TRUE(fs::exists(folder / "check" / "report.html"));
  std::ifstream file(folder / "check" / "report.json");
  const auto result = nlohmann::json::parse(file).at("result");
  EXPECT_EQ(result.at("verdict"), "agrees");
  EXPECT_EQ(result.at("radiosity").size(), 2U) << "patches and halved patches";
}

TEST(CrossCheckCommand, ClaimsNothingOfAReferenceWithoutItsError) {
  const test::TemporaryFolder folder;
  write_corner(folder);
  const ProgramRun picture =
      run_program("run '" + (folder / "scene.toml").string() + "' --out '" + (folder / "out").string() + "' 2>&1");
  ASSERT_EQ(picture.status, 0) << picture.output;
  const ProgramRun run = cross_check(folder, "--reference '" + (folder / "out" / "image.exr").string() + "'");
  EXPECT_EQ(run.status, 4) << run.output;
  EXPECT_THAT(run.output, HasSubstr("without a standard error"));
}

// A reference that is 100 % uncertain decides nothing; a light of half the power is found.
TEST(CrossCheckCommand, DisagreesOrIsUndecidedByTheReferencesError) {
  const test::TemporaryFolder folder;
  write_corner(folder);
  const ProgramRun picture =
      run_program("run '" + (folder / "scene.toml").string() + "' --out '" + (folder / "out").string() + "' 2>&1");
  ASSERT_EQ(picture.status, 0) << picture.output;
  const std::string image = "'" + (folder / "out" / "image.exr").string() + "'";
  const std::string black = "'" + (folder / "out" / "components" / "le.exr").string() + "'";  // nothing luminesces
  EXPECT_EQ(cross_check(folder, "--reference " + image + " --standard-error " + image).status, 4);
  EXPECT_EQ(cross_check(folder, "--reference " + image + " --standard-error " + black).status, 0);
  std::ifstream file(folder / "scene.toml");
  std::string scene(std::istreambuf_iterator<char>(file), {});
  scene.replace(scene.find("spectrum = 1"), 12, "spectrum = 0.5");
  files::write_text_atomically(folder / "scene.toml", scene);
  const ProgramRun halved = cross_check(folder, "--reference " + image + " --standard-error " + black);
  EXPECT_EQ(halved.status, 3) << halved.output;
  EXPECT_THAT(halved.output, StartsWith("disagrees: "));
}

TEST(CrossCheckCommand, RefusesOptionsThatNeedAReference) {
  const test::TemporaryFolder folder;
  write_corner(folder);
  const ProgramRun run = cross_check(folder, "--method path-tracer");
  EXPECT_EQ(run.status, 2);
  EXPECT_THAT(run.output, HasSubstr("--reference"));
  EXPECT_FALSE(fs::exists(folder / "check"));
}

}  // namespace
}  // namespace interglow::cli
