// SPDX-License-Identifier: GPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/cli/program.h"
#include "tests/temporary_folder.h"

namespace interglow::cli {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

fs::path written(const test::TemporaryFolder& folder, const std::string& file, const std::string& bytes) {
  std::ofstream(folder / file, std::ios::binary) << bytes;
  return folder / file;
}

// A unit square of two triangles in metres, one of them there twice, and a point that no face uses.
const std::string kSquare = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 7 7 7\nf 1 2 3\nf 1 3 4\nf 4 3 1\n";

TEST(InspectCommand, ReportsInNumbers) {
  const test::TemporaryFolder folder;
  const fs::path square = written(folder, "square.obj", kSquare);
  const ProgramRun run = run_program("inspect --json --mm-per-unit 1000 " + square.string());
  EXPECT_EQ(run.status, 0);
  const auto report = nlohmann::json::parse(run.output).at(0);
  EXPECT_EQ(report["read"]["triangles"], 3);
  EXPECT_EQ(report["repair"]["duplicate_faces_removed"], 1);
  EXPECT_EQ(report["repair"]["unused_points_removed"], 1);
  EXPECT_EQ(report["result"]["triangles"], 2);
  EXPECT_DOUBLE_EQ(report["result"]["area_mm2"], 1e6);
  EXPECT_EQ(report["result"]["borders"][0]["edges"], 4);
  EXPECT_EQ(report["warnings"].size(), 2U);
  EXPECT_THAT(run_program("inspect " + square.string()).output, HasSubstr("warning: 1 duplicate face removed."));
}

TEST(InspectCommand, RefusedFilesExitWithTwoAndTheOthersAreReported) {
  const test::TemporaryFolder folder;
  const fs::path good = written(folder, "good.obj", kSquare);
  const fs::path bad = written(folder, "bad.obj", "v 1,5 0 0\n");
  const ProgramRun run = run_program("inspect " + bad.string() + " " + good.string() + " 2>&1");
  EXPECT_EQ(run.status, 2);
  EXPECT_THAT(run.output, HasSubstr("bad.obj:1: \"1,5\" has a comma"));
  EXPECT_THAT(run.output, HasSubstr("duplicate_faces_removed"));
  EXPECT_EQ(run_program("inspect /nonexistent.obj 2>&1").status, 2);
  EXPECT_EQ(run_program("inspect --mm-per-unit -1 " + good.string() + " 2>&1").status, 2);
  EXPECT_EQ(run_program("inspect 2>&1").status, 2);
}

TEST(InspectCommand, WritesTheRepairedMesh) {
  const test::TemporaryFolder folder;
  const fs::path square = written(folder, "square.obj", kSquare);
  const fs::path out = square.parent_path() / "repaired.ply";
  EXPECT_EQ(run_program("inspect --out " + out.string() + " " + square.string()).status, 0);
  const ProgramRun again = run_program("inspect --json " + out.string());
  EXPECT_EQ(nlohmann::json::parse(again.output).at(0)["result"]["triangles"], 2);
  EXPECT_TRUE(nlohmann::json::parse(again.output).at(0)["warnings"].empty());
  EXPECT_EQ(
      run_program("inspect --out " + out.string() + " " + square.string() + " " + square.string() + " 2>&1").status, 2);
}

}  // namespace
}  // namespace interglow::cli
