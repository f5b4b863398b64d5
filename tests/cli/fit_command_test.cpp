// SPDX-License-Identifier: GPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "spectral/spectrum_file.h"
#include "tests/cli/program.h"
#include "tests/cli/two_sheets.h"

namespace interglow::cli {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

using FitCommand = TwoSheets;

// The capture's sheets reflect 0.02 more in all bands than the fitted scene says; noise is next to none. The sheets are
// flat, so that light, camera and w are held: what is left are gains and the two offsets.
TEST_F(FitCommand, FindsReflectanceOffsetsAndWritesASceneThatRunsWithThem) {
  write("scene.toml", scene(50, 24, 24, "subdivide_mm = 5\n"));
  fs::create_directories(file("true"));
  write("true/scene.toml", scene(50, 24, 24, "subdivide_mm = 5\n"));
  for (const char* mesh : {"floor.obj", "wall.obj"}) fs::copy_file(file(mesh), file(std::string("true/") + mesh));
  write("true/red.csv", "wavelength,r\n400,0.12\n550,0.22\n700,0.82\n");
  write("true/yellow.csv", "wavelength,r\n400,0.12\n550,0.72\n700,0.72\n");
  const ProgramRun captured = run_program("simulate-capture " + file("true/scene.toml").string() + " --out " +
                                          file("cap").string() + " --full-well 1e9 --bits 16 2>&1");
  ASSERT_EQ(captured.status, 0) << captured.output;
  const ProgramRun fitted = run_program("fit " + file("scene.toml").string() + " --capture " + file("cap").string() +
                                        " --out " + file("out").string() +
                                        " --near --fix light,pose,focal,blur,w,offset --free reflectance-offset"
                                        " --reflectance-offset-sigma 0.1 2>&1");
  ASSERT_EQ(fitted.status, 0) << fitted.output;
  for (const auto& [name, at_500] :
       {std::pair("red", 0.1 + 0.1 * 2.0 / 3.0), std::pair("yellow", 0.1 + 0.6 * 2.0 / 3.0)}) {
    const spectral::Spectrum table = spectral::read_spectrum(file(std::string("out/") + name + ".csv"));
    const Eigen::VectorXd& nm = table.wavelength_nm;
    for (Eigen::Index b = 0; b < nm.size(); ++b) {
      if (nm[b] != 500.0) continue;
      EXPECT_NEAR(table.value[b] - at_500, 0.02, 0.002) << name;
    }
  }
  const ProgramRun run =
      run_program("run " + file("out/scene.toml").string() + " --out " + file("again").string() + " 2>&1");
  EXPECT_EQ(run.status, 0) << run.output;
}

TEST_F(FitCommand, NamesTheGroupsThatCanBeFreed) {
  write("scene.toml", scene(100, 8, 8));
  const ProgramRun run =
      run_program("fit " + file("scene.toml").string() + " --capture x --out y --free reflectances 2>&1");
  EXPECT_NE(run.status, 0);
  EXPECT_THAT(run.output, HasSubstr("did you mean reflectance?"));
}

}  // namespace
}  // namespace interglow::cli
