// SPDX-License-Identifier: GPL-3.0-or-later
// Every damaged or unusual file of the shared collection gets its verdict. Expected counts: the MANIFEST beside the
// files (an independent reader in Python), less the faces and points that its text says are damaged.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <string>

#include "mesh/scan_file.h"

namespace interglow::mesh {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

const fs::path kFolder = fs::path(INTERGLOW_SHARED_DATA) / "meshes" / "broken";

enum Verdict { kRefused, kWarned, kSilent };

struct Case {
  const char* file;
  Verdict verdict;
  /// Refused or warned: what a message must say.
  const char* says = "";
  std::size_t points = 0;
  std::size_t triangles = 0;
};

// kSilent: the reader finds nothing wrong; damage of the topology is for `repair` to report (repair_test.cpp).
const Case kCases[] = {
    {"ascii_truncated.stl", kRefused, "file ends"},
    // Better than the 944 triangles proposed (466 of them degenerate): the line tells one quad over and over.
    {"assimp_box_longline.obj", kWarned, "repeated corners", 8, 12},
    {"assimp_box_utf16be.obj", kSilent, "", 8, 12},
    {"assimp_cube_binary_starts_with_nl.ply", kSilent, "", 8, 12},
    {"assimp_empty.obj", kRefused, "0 bytes"},
    // Refused rather than dropping the face: who counts from 0 has shifted every other index as well.
    {"assimp_malformed.obj", kRefused, ":28: corner index 0"},
    {"assimp_malformed2.obj", kWarned, "line 23", 8, 10},
    {"assimp_number_formats.obj", kWarned, "\"3.1+e2\" in line 11", 9, 1},
    {"assimp_point_cloud.obj", kRefused, "no faces"},
    {"assimp_two_solids.stl", kSilent, "", 6, 2},
    {"binary_named_solid.stl", kSilent, "", 395, 702},
    {"cgal_degtri_four.obj", kSilent, "", 5, 4},
    {"comma_decimals.obj", kRefused, "comma"},
    // Refused: loading 202 of 702 faces would leave a scan with holes that nobody made.
    {"count_fewer_faces.ply", kRefused, "6500 bytes are left"},
    {"count_huge.ply", kRefused, "4294967295"},
    {"count_more_faces.ply", kRefused, "1202"},
    {"count_more_vertices.ply", kRefused, "counts"},
    {"count_negative.ply", kRefused, "\"-3\""},
    {"count_too_large.stl", kRefused, "1702"},
    {"count_zero.stl", kRefused, "room for 702"},
    {"crlf_continued.obj", kSilent, "", 395, 702},
    {"draco_deg_faces.obj", kSilent, "", 6, 4},
    {"draco_eof_test.obj", kSilent, "", 3, 1},
    {"draco_inf_nan.obj", kRefused, "1 of 1 faces"},
    {"draco_non_manifold_wrap.obj", kSilent, "", 10, 12},
    {"duplicate_faces.obj", kSilent, "", 395, 767},
    {"empty.stl", kRefused, "0 bytes"},
    {"extra_properties.ply", kSilent, "", 4, 2},
    {"far_offset_double.ply", kSilent, "", 395, 702},
    {"fin_and_bowtie.obj", kSilent, "", 398, 704},
    {"flipped_patch.stl", kSilent, "", 395, 702},
    {"floating_specks.obj", kSilent, "", 675, 762},
    {"garbage_tail.stl", kWarned, "777 bytes", 395, 702},
    {"gc_hourglass_ico.obj", kSilent, "", 23, 40},
    {"gc_moebius.obj", kSilent, "", 280, 448},
    // No scanned thing is 1e31 mm large: the unit is wrong, and with the right one (below) the file is read.
    {"huge_coordinates.ply", kRefused, "mm_per_unit"},
    {"index_out_of_range.obj", kWarned, "3 faces with a corner index out of range", 395, 699},
    {"index_zero.obj", kRefused, ":1098: corner index 0"},
    {"list_length_255.ply", kRefused, "of 702"},
    {"nan_facets.stl", kWarned, "3 points", 395, 699},
    {"nan_inf_vertices.ply", kWarned, "7 points without finite coordinates dropped, and with them 32 faces", 388, 670},
    {"only_header.stl", kRefused, "80 bytes"},
    {"quads.obj", kSilent, "", 395, 702},
    {"random_bytes.stl", kRefused, "3803942800"},
    {"self_intersecting.ply", kSilent, "", 790, 1404},
    {"tiny_coordinates.ply", kRefused, "mm_per_unit"},
    {"trimesh_empty.ply", kRefused, "no points"},
    {"trimesh_negative_indices.obj", kSilent, "", 8, 12},
    {"trimesh_notenoughindices.obj", kWarned, "line 9", 3, 1},
    {"trimesh_points_emptyface.ply", kRefused, "no faces"},
    {"trimesh_soup.stl", kSilent, "", 300, 100},
    {"tristrips.ply", kSilent, "", 395, 702},
    {"truncated_binary.ply", kRefused, "702"},
    {"truncated_face.obj", kRefused, ":832: the file ends inside this line"},
    {"truncated_vertices.obj", kRefused, ":196: the file ends inside this line"},
    {"unwelded_soup.obj", kSilent, "", 2106, 702},
    {"wrong_endian.ply", kRefused, "byte order"},
    {"zero_area.ply", kSilent, "", 399, 706},
};

class BrokenScan : public testing::TestWithParam<Case> {};

TEST_P(BrokenScan, GetsItsVerdict) {
  if (!fs::exists(kFolder)) GTEST_SKIP() << kFolder << " is absent: the shared collection of meshes is not installed";
  const Case& expected = GetParam();
  const fs::path path = kFolder / expected.file;
  ScanFile scan;
  try {
    scan = read_scan(path);
  } catch (const InvalidInput& error) {
    EXPECT_EQ(expected.verdict, kRefused) << error.what();
    EXPECT_THAT(error.what(), HasSubstr(expected.file));
    EXPECT_THAT(error.what(), HasSubstr(expected.says));
    return;
  }
  ASSERT_NE(expected.verdict, kRefused) << scan.mesh.triangles.size() << " triangles were read";
  EXPECT_EQ(scan.mesh.points.size(), expected.points);
  EXPECT_EQ(scan.mesh.triangles.size(), expected.triangles);
  std::string warnings;
  for (const std::string& warning : scan.report.warnings) warnings += warning + "\n";
  EXPECT_EQ(warnings.empty(), expected.verdict == kSilent) << warnings;
  EXPECT_THAT(warnings, HasSubstr(expected.says));
  for (const Eigen::Vector3d& point : scan.mesh.points) ASSERT_TRUE(point.allFinite());
  for (const auto& triangle : scan.mesh.triangles) {
    for (const int corner : triangle) {
      ASSERT_GE(corner, 0);
      ASSERT_LT(corner, static_cast<int>(expected.points));
    }
  }
  if (expected.verdict == kWarned) {
    EXPECT_THROW((void)read_scan(path, {.strict = true}), InvalidInput);
  }
}

std::string test_name(const testing::TestParamInfo<Case>& tested) {
  std::string name = tested.param.file;
  for (char& c : name) c = std::isalnum(static_cast<unsigned char>(c)) ? c : '_';
  return name;
}

INSTANTIATE_TEST_SUITE_P(Files, BrokenScan, testing::ValuesIn(kCases), test_name);

TEST(BrokenScans, NoFileIsForgotten) {
  if (!fs::exists(kFolder)) GTEST_SKIP() << kFolder << " is absent: the shared collection of meshes is not installed";
  for (const auto& entry : fs::directory_iterator(kFolder)) {
    const std::string file = entry.path().filename();
    if (file == "range_grid_no_faces.ply") continue;  // below
    EXPECT_TRUE(std::any_of(std::begin(kCases), std::end(kCases), [&](const Case& c) { return c.file == file; }))
        << file;
  }
}

TEST(BrokenScans, CoordinatesFarFromOneAreReadWithTheRightUnit) {
  if (!fs::exists(kFolder)) GTEST_SKIP() << kFolder << " is absent: the shared collection of meshes is not installed";
  for (const auto& [file, mm_per_unit] :
       {std::pair("huge_coordinates.ply", 1e-30), std::pair("tiny_coordinates.ply", 1e21)}) {
    const ScanFile scan = read_scan(kFolder / file, {.mm_per_unit = mm_per_unit});
    EXPECT_EQ(scan.mesh.points.size(), 395U) << file;
    EXPECT_EQ(scan.mesh.triangles.size(), 702U) << file;
  }
}

TEST(BrokenScans, DoubleCoordinatesFarFromTheOriginKeepTheirDigits) {
  if (!fs::exists(kFolder)) GTEST_SKIP() << kFolder << " is absent: the shared collection of meshes is not installed";
  const ScanFile scan = read_scan(kFolder / "far_offset_double.ply", {.mm_per_unit = 1000.0});
  Eigen::Vector3d low = scan.mesh.points.front();
  Eigen::Vector3d high = low;
  for (const Eigen::Vector3d& point : scan.mesh.points) {
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  // MANIFEST: 0.01275 x 0.01257 x 0.01106 m, four digits.
  EXPECT_NEAR(high.x() - low.x(), 12.75, 0.005);
  EXPECT_NEAR(high.y() - low.y(), 12.57, 0.005);
  EXPECT_NEAR(high.z() - low.z(), 11.06, 0.005);
}

TEST(BrokenScans, ARangeImageWithoutFacesIsTriangulated) {
  if (!fs::exists(kFolder)) GTEST_SKIP() << kFolder << " is absent: the shared collection of meshes is not installed";
  const ScanFile scan = read_scan(kFolder / "range_grid_no_faces.ply");
  EXPECT_EQ(scan.mesh.points.size(), 5376U);
  ASSERT_EQ(scan.report.warnings.size(), 1U);
  EXPECT_THAT(scan.report.warnings[0], HasSubstr("96 x 80 cells"));
  // 5376 samples of 7680 cells: nearly two triangles a sample, but for the border and the steps.
  EXPECT_GT(scan.mesh.triangles.size(), 9000U);
  EXPECT_LT(scan.mesh.triangles.size(), 2U * 5376U);
}

}  // namespace
}  // namespace interglow::mesh
