// SPDX-License-Identifier: GPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "files/atomic_file.h"
#include "tests/cli/program.h"

namespace interglow::cli {
namespace {

using testing::HasSubstr;
namespace fs = std::filesystem;

/// A square of fluorescent paper under a beam, in a folder of its own.
fs::path glowing_square() {
  const fs::path folder = fs::path(testing::TempDir()) / "export_command";
  fs::remove_all(folder);
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
  return folder;
}

TEST(ExportCommand, WritesTheSceneAndSaysWhatIsLost) {
  const fs::path folder = glowing_square();
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
  const fs::path folder = glowing_square();
  const ProgramRun run = run_program("export '" + (folder / "scene.toml").string() + "' --format povray --out '" +
                                     (folder / "out").string() + "' 2>&1");
  EXPECT_EQ(run.status, 2);
  EXPECT_THAT(run.output, HasSubstr("{mitsuba3,mitsuba06,pbrt4}"));
  EXPECT_FALSE(fs::exists(folder / "out"));
}

}  // namespace
}  // namespace interglow::cli
