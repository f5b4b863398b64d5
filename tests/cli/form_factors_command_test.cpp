// SPDX-License-Identifier: GPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "files/atomic_file.h"
#include "tests/cli/program.h"
#include "tests/temporary_folder.h"

namespace interglow::cli {
namespace {

using testing::HasSubstr;

/// Two facing squares of 1 mm at a distance of 1 mm.
void write_two_squares(const test::TemporaryFolder& folder) {
  files::write_text_atomically(folder / "floor.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n");
  files::write_text_atomically(folder / "ceiling.obj", "v 0 0 1\nv 0 1 1\nv 1 1 1\nv 1 0 1\nf 1 2 3\nf 1 3 4\n");
  files::write_text_atomically(folder / "scene.toml", R"(
[material.grey]
reflectance = 0.5
[object.floor]
mesh = "floor.obj"
material = "grey"
remesh = "none"
[object.ceiling]
mesh = "ceiling.obj"
material = "grey"
remesh = "none"
[light.sky]
kind = "sky"
spectrum = 1
[camera]
position_mm = [0, 0, 100]
target_mm = [0, 0, 0]
up = [0, 1, 0]
horizontal_fov_deg = 10
width_px = 8
height_px = 8
)");
}

TEST(FormFactorsCommand, PrintsTheTableOfASceneAndWritesItsMatrix) {
  const test::TemporaryFolder folder;
  write_two_squares(folder);
  const ProgramRun run = run_program("form-factors '" + (folder / "scene.toml").string() +
                                     "' --tolerance 1e-8 --out '" + (folder / "f.mtx").string() + "' 2>&1");
  ASSERT_EQ(run.status, 0) << run.output;
  // Opposite unit squares at distance 1 (Howell, C-11): 0.199825; the rest of 1 escapes.
  EXPECT_THAT(run.output, HasSubstr("0.199825"));
  EXPECT_THAT(run.output, HasSubstr("0.800175"));
  std::ifstream file(folder / "f.mtx");
  std::string line;
  ASSERT_TRUE(std::getline(file, line));
  EXPECT_EQ(line, "%%MatrixMarket matrix coordinate real general");
  double sum = 0.0;  // of the rows of the floor's two triangles of equal area: twice the factor
  int rows = 0, columns = 0, count = 0;
  std::getline(file, line);
  file >> rows >> columns >> count;
  EXPECT_EQ(rows, 8);  // two triangles with two sides on each of two sheets
  int i = 0, j = 0;
  for (double value = 0.0; file >> i >> j >> value;) {
    if (i <= 2 && j >= 3 && j <= 4) sum += value;
  }
  EXPECT_NEAR(0.5 * sum, 0.19982489569838737, 1e-8);
}

TEST(FormFactorsCommand, RefusesWhatIsNoSceneAndNoMatrixFormat) {
  const test::TemporaryFolder folder;
  write_two_squares(folder);
  const ProgramRun wrong_input = run_program("form-factors '" + (folder / "floor.obj").string() + "' 2>&1");
  EXPECT_EQ(wrong_input.status, 2);
  EXPECT_THAT(wrong_input.output, HasSubstr("floor.obj"));
  const ProgramRun wrong_output = run_program("form-factors '" + (folder / "scene.toml").string() + "' --out '" +
                                              (folder / "f.csv").string() + "' 2>&1");
  EXPECT_EQ(wrong_output.status, 2);
  EXPECT_THAT(wrong_output.output, HasSubstr("f.csv"));
  EXPECT_FALSE(std::filesystem::exists(folder / "f.csv"));
  // Before anything is computed, or the scene so much as read.
  const ProgramRun no_scene = run_program("form-factors '" + (folder / "none.toml").string() + "' --out '" +
                                          (folder / "f.csv").string() + "' 2>&1");
  EXPECT_THAT(no_scene.output, HasSubstr("f.csv"));
  std::filesystem::create_directory(folder / "folder.mtx");
  const ProgramRun onto_folder = run_program("form-factors '" + (folder / "scene.toml").string() + "' --out '" +
                                             (folder / "folder.mtx").string() + "' 2>&1");
  EXPECT_EQ(onto_folder.status, 2);
  EXPECT_THAT(onto_folder.output, HasSubstr("folder.mtx: is a folder"));
}

}  // namespace
}  // namespace interglow::cli
