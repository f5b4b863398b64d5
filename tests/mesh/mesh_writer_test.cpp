// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/mesh_writer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>

#include "diagnostics/error.h"
#include "mesh/scan_file.h"
#include "tests/temporary_folder.h"

namespace interglow::mesh {
namespace {

namespace fs = std::filesystem;

TEST(WriteMesh, EveryBitSurvivesPlyAndObj) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> exponent(-8.0, 8.0);
  TriangleMesh mesh;
  for (int i = 0; i < 300; ++i) {
    mesh.points.emplace_back(std::pow(10.0, exponent(random)), -std::pow(10.0, exponent(random)),
                             5411877.0 + exponent(random));
  }
  for (int i = 0; i + 2 < 300; ++i) mesh.triangles.push_back({i, i + 1, i + 2});
  const test::TemporaryFolder folder;
  for (const char* file : {"mesh.ply", "mesh.obj"}) {
    const fs::path path = folder / file;
    write_mesh(path, mesh, "made by\na test");
    const ScanFile read = read_scan(path);
    EXPECT_EQ(read.mesh.points, mesh.points) << file;
    EXPECT_EQ(read.mesh.triangles, mesh.triangles) << file;
    EXPECT_TRUE(read.report.warnings.empty()) << file;
  }
}

TEST(WriteMesh, RefusesOtherFormats) {
  const test::TemporaryFolder folder;
  EXPECT_THROW(write_mesh(folder / "mesh.stl", {}), InvalidInput);
  EXPECT_FALSE(fs::exists(folder / "mesh.stl"));
}

}  // namespace
}  // namespace interglow::mesh
