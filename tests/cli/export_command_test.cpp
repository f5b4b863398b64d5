// SPDX-License-Identifier: GPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "files/atomic_file.h"
#include "tests/cli/program.h"
#include "tests/temporary_folder.h"

namespace interglow::cli {
namespace {

using testing::HasSubstr;
namespace fs = std::filesystem;

/// A square of fluorescent paper under a beam.
void write_glowing_square(const test::TemporaryFolder& folder) {
  files::write_text_atomically(folder / "floor.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n");
  files::write_text_atomically(folder / "scene.toml", R"(
[material.paper]
donaldson = "interglow:fluorescent/paper_red"
[object.floor]
mesh = "floor.obj"
material = "paper"
remesh = "none"
[light.sun]
kind = "directional"
direction = [0, 0, -1]
spectrum = 1
[camera]
position_mm = [0, 0, 100]
target_mm = [0, 0, 0]
horizontal_fov_deg = 10
)");
}

TEST(ExportCommand, WritesTheSceneAndSaysWhatIsLost) {
  const test::TemporaryFolder folder;
  write_glowing_square(folder);
  for (const auto& [format, file] :
       {std::pair{"mitsuba3", "scene.xml"}, {"mitsuba06", "scene.xml"}, {"pbrt4", "scene.pbrt"}}) {
    const fs::path out = folder / format;
    const ProgramRun run = run_program("export '" + (folder / "scene.toml").string() + "' --format " + format +
                                       " --out '" + out.string() + "' 2>&1");
    EXPECT_EQ(run.status, 0) << run.output;
    EXPECT_THAT(run.output, HasSubstr("warning: material \"paper\" fluoresces"));
    EXPECT_THAT(run.output, HasSubstr((out / file).string()));
    EXPECT_TRUE(fs::exists(out / file));
    EXPECT_TRUE(fs::exists(out / "meshes" / "01_floor.ply"));
  }
}

TEST(ExportCommand, RefusesAnUnknownRendererWithTheKnownOnes) {
  const test::TemporaryFolder folder;
  write_glowing_square(folder);
  const ProgramRun run = run_program("export '" + (folder / "scene.toml").string() + "' --format povray --out '" +
                                     (folder / "out").string() + "' 2>&1");
  EXPECT_EQ(run.status, 2);
  EXPECT_THAT(run.output, HasSubstr("{mitsuba3,mitsuba06,pbrt4}"));
  EXPECT_FALSE(fs::exists(folder / "out"));
}

}  // namespace
}  // namespace interglow::cli
