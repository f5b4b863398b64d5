// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/scan_file.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include "tests/temporary_folder.h"

namespace interglow::mesh {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using Triangles = std::vector<std::array<int, 3>>;

ScanFile read_text(const std::string& file, const std::string& bytes, const ReadParams& params = {}) {
  return read_scan_bytes(bytes, file, params);
}

std::string refusal(const std::string& file, const std::string& bytes) {
  try {
    const ScanFile scan = read_text(file, bytes);
    return fmt::format("(read: {} points, {} triangles)", scan.mesh.points.size(), scan.mesh.triangles.size());
  } catch (const InvalidInput& error) {
    return error.what();
  }
}

template <class T>
void append(std::string& bytes, T value, bool big_endian = false) {
  std::array<char, sizeof(T)> raw = std::bit_cast<std::array<char, sizeof(T)>>(value);
  if (big_endian) std::reverse(raw.begin(), raw.end());
  bytes.append(raw.data(), raw.size());
}

double area(const TriangleMesh& mesh) {
  double sum = 0.0;
  for (const auto& [a, b, c] : mesh.triangles) {
    sum += 0.5 * (mesh.points[b] - mesh.points[a]).cross(mesh.points[c] - mesh.points[a]).norm();
  }
  return sum;
}

// The same tetrahedron in every format.
const std::vector<Eigen::Vector3d> kPoints{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1.5}};
const Triangles kTriangles{{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
const std::string kObj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1.5\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";

std::string ply(const std::string& format, const std::string& coordinate, const std::string& index) {
  std::string bytes = "ply\nformat " + format + " 1.0\nelement vertex 4\nproperty " + coordinate + " x\nproperty " +
                      coordinate + " y\nproperty " + coordinate + " z\nelement face 4\nproperty list uchar " + index +
                      " vertex_indices\nend_header\n";
  const bool big = format == "binary_big_endian";
  for (const Eigen::Vector3d& p : kPoints) {
    if (format == "ascii") bytes += fmt::format("{} {} {}\n", p.x(), p.y(), p.z());
    for (int axis = 0; axis < 3 && format != "ascii"; ++axis) {
      coordinate == "double" ? append(bytes, p[axis], big) : append(bytes, static_cast<float>(p[axis]), big);
    }
  }
  for (const auto& [a, b, c] : kTriangles) {
    if (format == "ascii") {
      bytes += fmt::format("3 {} {} {}\n", a, b, c);
      continue;
    }
    bytes += '\3';
    for (const int corner : {a, b, c}) {
      index == "ushort" ? append(bytes, static_cast<std::uint16_t>(corner), big) : append(bytes, corner, big);
    }
  }
  return bytes;
}

std::string binary_stl() {
  std::string bytes(80, ' ');
  bytes.replace(0, 5, "solid");
  append(bytes, static_cast<std::uint32_t>(kTriangles.size()));
  for (const auto& triangle : kTriangles) {
    for (int axis = 0; axis < 3; ++axis) append(bytes, 0.0F);
    for (const int corner : triangle) {
      for (int axis = 0; axis < 3; ++axis) append(bytes, static_cast<float>(kPoints[corner][axis]));
    }
    bytes += std::string(2, '\0');
  }
  return bytes;
}

std::string ascii_stl() {
  std::string text = "solid a tetrahedron\n";
  for (const auto& triangle : kTriangles) {
    text += "facet normal nan nan nan\nouter loop\n";
    for (const int i : triangle)
      text += fmt::format("vertex {} {} {}\n", kPoints[i].x(), kPoints[i].y(), kPoints[i].z());
    text += "endloop\nendfacet\n";
  }
  return text + "endsolid a tetrahedron\n";
}

const std::string kOff =
    "OFF # a tetrahedron\n4 4 6\n0 0 0\n1 0 0\n0 1 0\n0 0 1.5\n\n3 0 2 1\n3 0 1 3 255 0 0\n3 1 2 3\n3 2 0 3\n";

/// The triangles as coordinates, since STL numbers points in the order of their first appearance.
std::vector<std::array<Eigen::Vector3d, 3>> corners(const TriangleMesh& mesh) {
  std::vector<std::array<Eigen::Vector3d, 3>> all;
  for (const auto& [a, b, c] : mesh.triangles) all.push_back({mesh.points[a], mesh.points[b], mesh.points[c]});
  return all;
}

TEST(ReadScan, TheSameMeshInEveryFormat) {
  const auto expected = corners({kPoints, kTriangles});
  const std::vector<std::pair<std::string, std::string>> files{
      {"t.obj", kObj},
      {"t_ascii.ply", ply("ascii", "float", "int")},
      {"t_le.ply", ply("binary_little_endian", "float", "int")},
      {"t_be.ply", ply("binary_big_endian", "double", "ushort")},
      {"t_bin.stl", binary_stl()},
      {"t_asc.stl", ascii_stl()},
      {"t.off", kOff}};
  for (const auto& [file, bytes] : files) {
    const ScanFile scan = read_text(file, bytes);
    EXPECT_EQ(scan.mesh.points.size(), 4U) << file;
    EXPECT_EQ(corners(scan.mesh), expected) << file;
    EXPECT_TRUE(scan.report.warnings.empty()) << file;
    EXPECT_EQ(scan.report.faces_in_file, 4U) << file;
  }
}

TEST(ReadScan, ReadsFromDisk) {
  const test::TemporaryFolder folder;
  const fs::path path = folder / "scan.OBJ";
  std::ofstream(path, std::ios::binary) << kObj;
  EXPECT_EQ(read_scan(path).mesh.triangles, kTriangles);
}

TEST(ReadScan, ScalesToMillimetres) {
  const ScanFile scan = read_text("t.obj", kObj, {.mm_per_unit = 25.4});
  EXPECT_DOUBLE_EQ(scan.mesh.points[3].z(), 38.1);  // 1.5 inch
}

TEST(ReadScan, ObjSyntax) {
  const std::string text =
      "\xEF\xBB\xBF# comment \\\r\nmtllib a.mtl\r\no thing\r\nv\t0 0 0 1\r\nvt 0.5 0.5\r\nvn 0 0 1\r\n"
      "v +1. 0 0 0.1 0.2 0.3\r\nv 1 \\\r\n 1e0 0 # end\r\nv 0 1 0\r\ns 1\r\n"
      "f 1/1/1 2//1 -2/1\r\nf -4 \\\r\n -2 \\\r\n -1\r\n";
  const ScanFile scan = read_text("syntax.obj", text);
  ASSERT_EQ(scan.mesh.points.size(), 4U);
  EXPECT_EQ(scan.mesh.points[1], Eigen::Vector3d(1, 0, 0));
  EXPECT_EQ(scan.mesh.points[2], Eigen::Vector3d(1, 1, 0));
  EXPECT_EQ(scan.mesh.triangles, (Triangles{{0, 1, 2}, {0, 2, 3}}));
  EXPECT_TRUE(scan.report.warnings.empty());
}

TEST(ReadScan, OldMacintoshLineEndsAndUtf16) {
  std::string carriage_returns = kObj;
  std::replace(carriage_returns.begin(), carriage_returns.end(), '\n', '\r');
  EXPECT_EQ(read_text("mac.obj", carriage_returns).mesh.triangles, kTriangles);
  std::string utf16 = "\xFF\xFE";
  for (const char c : kObj) utf16 += {c, '\0'};
  EXPECT_EQ(read_text("utf16.obj", utf16).mesh.triangles, kTriangles);
}

TEST(ReadScan, NumbersAreReadWholeOrNotAtAll) {
  EXPECT_THAT(refusal("comma.obj", "v 1,5 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
              HasSubstr("comma.obj:1: \"1,5\" has a comma"));
  EXPECT_THAT(refusal("comma.off", "OFF\n3 1 0\n0 0 0\n1,5 0 0\n0 1 0\n3 0 1 2\n"), HasSubstr("comma.off:4: \"1,5\""));
  EXPECT_THAT(refusal("comma.stl", "solid\nfacet normal 0 0 1\nouter loop\nvertex 1,5 0 0\n"),
              HasSubstr("comma.stl:4: \"1,5\""));
  std::string text = ply("ascii", "float", "int");
  text.replace(text.find("1.5"), 3, "1,5");
  EXPECT_THAT(refusal("comma.ply", text), HasSubstr("comma.ply:13: \"1,5\""));
  for (const char* number : {"0x10", "1.5f", "--1", "+-1", "1e", "one", "1.#INF"}) {
    const ScanFile scan =
        read_text("number.obj", fmt::format("v {} 7 7\n{}f 2 3 4\nf 2 4 5\nf 1 2 3\n", number, kObj.substr(0, 34)));
    EXPECT_EQ(scan.mesh.points.size(), 4U) << number;
    EXPECT_EQ(scan.report.unusable_points, 1U) << number;
    EXPECT_EQ(scan.report.faces_of_unusable_points, 1U) << number;
    ASSERT_EQ(scan.report.warnings.size(), 2U) << number;
    EXPECT_THAT(scan.report.warnings[0], HasSubstr(fmt::format("\"{}\" in line 1", number)));
  }
}

TEST(ReadScan, NumbersBeyondDoubleAreInfiniteOrZero) {
  const ScanFile scan =
      read_text("range.obj", "v 1e-999 0 0\nv 1 0 0\nv 0 1 0\nv 1e999 0 0\nf 1 2 3\nf 1 2 3\nf 2 3 4\n");
  EXPECT_EQ(scan.mesh.points.size(), 3U);
  EXPECT_EQ(scan.mesh.points[0].x(), 0.0);
}

TEST(ReadScan, PolygonsKeepTheirArea) {
  // An L of area 3 with a straight corner, wound both ways, and a convex hexagon with unit sides.
  const std::string points = "v 0 0 0\nv 1 0 0\nv 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 2 0\nv 0 2 0\n";
  for (const char* face : {"f 1 2 3 4 5 6 7\n", "f 5 6 7 1 2 3 4\n", "f 7 6 5 4 3 2 1\n", "f 4 3 2 1 7 6 5\n"}) {
    const ScanFile scan = read_text("l.obj", points + face);
    EXPECT_EQ(scan.mesh.triangles.size(), 5U) << face;
    EXPECT_EQ(scan.report.polygons_triangulated, 1U);
    EXPECT_NEAR(area(scan.mesh), 3.0, 1e-14) << face;
  }
  std::string hexagon;
  for (int k = 0; k < 6; ++k) hexagon += fmt::format("v 5 {} {}\n", std::cos(k * M_PI / 3), std::sin(k * M_PI / 3));
  const ScanFile scan = read_text("hexagon.obj", hexagon + "f 1 2 3 4 5 6\n");
  EXPECT_NEAR(area(scan.mesh), 1.5 * std::sqrt(3.0), 1e-14);
}

TEST(ReadScan, AStarOfManyCornersKeepsItsArea) {
  constexpr int kTips = 200;
  std::string text;
  for (int k = 0; k < 2 * kTips; ++k) {
    const double r = k % 2 == 0 ? 2.0 : 1.0;
    text += fmt::format("v {} {} 3\n", r * std::cos(k * M_PI / kTips), r * std::sin(k * M_PI / kTips));
  }
  text += "f";
  for (int k = 1; k <= 2 * kTips; ++k) text += fmt::format(" {}", k);
  const ScanFile scan = read_text("star.obj", text + "\n");
  EXPECT_EQ(scan.mesh.triangles.size(), 2U * kTips - 2U);
  // 2 n triangles from the centre with sides 2 and 1 and the angle pi/n between them.
  EXPECT_NEAR(area(scan.mesh), 2.0 * kTips * std::sin(M_PI / kTips), 1e-10);
}

TEST(ReadScan, ARangeImageIsCutAtItsStep) {
  // 4 x 3 samples, the last column 10 behind: two columns of blocks stay, the third spans the step. One sample is
  // missing.
  std::string text =
      "ply\nformat ascii 1.0\nobj_info num_cols 4\nobj_info num_rows 3\nelement vertex 11\nproperty float x\n"
      "property float y\nproperty float z\nelement range_grid 12\nproperty list uchar int vertex_indices\nend_header\n";
  std::string cells;
  int samples = 0;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) {
      if (row == 0 && column == 0) {
        cells += "0\n";
        continue;
      }
      text += fmt::format("{} {} {}\n", column, -row, column == 3 ? -10 : 0);
      cells += fmt::format("1 {}\n", samples++);
    }
  }
  const ScanFile scan = read_text("grid.ply", text + cells);
  EXPECT_EQ(scan.mesh.triangles.size(), 7U);  // 4 blocks of two, less the corner of the missing sample
  EXPECT_DOUBLE_EQ(area(scan.mesh), 3.5);
  ASSERT_EQ(scan.report.warnings.size(), 1U);
  EXPECT_THAT(scan.report.warnings[0], HasSubstr("4 across"));
  for (const auto& [a, b, c] : scan.mesh.triangles) {
    EXPECT_GT((scan.mesh.points[b] - scan.mesh.points[a]).cross(scan.mesh.points[c] - scan.mesh.points[a]).z(), 0.0);
  }
}

TEST(ReadScan, RefusalsNameFilePlaceAndValue) {
  EXPECT_THAT(refusal("zero.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n"), HasSubstr("zero.obj:4: corner index 0"));
  EXPECT_THAT(refusal("type.ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty half x\nend_header\n"),
              HasSubstr("type.ply:4: \"half\""));
  EXPECT_THAT(refusal("z.ply",
                      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nend_header\n0 0\n"),
              HasSubstr("no property \"z\""));
  EXPECT_THAT(refusal("off.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n"),
              HasSubstr("off.off: line 6: a face has the corner 3"));
  EXPECT_THAT(refusal("huge.off", "OFF\n999999999999 1 0\n0 0 0\n"), HasSubstr("999999999999 points"));
  EXPECT_THAT(refusal("four.off", "4OFF\n1 1 0\n"), HasSubstr("\"4OFF\""));
  EXPECT_THAT(refusal("scan.xyz", "0 0 0\n"), HasSubstr("\".xyz\""));
  EXPECT_THAT(refusal("fake.ply", "solid\n"), HasSubstr("not a PLY file"));
  EXPECT_THROW((void)read_scan(testing::TempDir()), InvalidInput);
  EXPECT_THROW((void)read_scan("/nonexistent/scan.obj"), InvalidInput);
  EXPECT_THROW((void)read_text("t.obj", kObj, {.mm_per_unit = 0.0}), InvalidParams);
  EXPECT_THROW((void)read_text("t.obj", kObj, {.range_grid_edge_ratio = 0.5}), InvalidParams);
}

/// InvalidInput, or a mesh that keeps the promises of the header; anything else fails the test.
void expect_refused_or_sound(const std::string& file, const std::string& bytes) {
  try {
    const ScanFile scan = read_text(file, bytes);
    for (const Eigen::Vector3d& point : scan.mesh.points) ASSERT_TRUE(point.allFinite());
    for (const auto& triangle : scan.mesh.triangles) {
      for (const int corner : triangle) ASSERT_TRUE(corner >= 0 && corner < static_cast<int>(scan.mesh.points.size()));
    }
  } catch (const InvalidInput&) {
  }
}

TEST(ReadScan, FilesCutOffAnywhereOrWithAnyByteChanged) {
  std::mt19937 random(7);
  const std::vector<std::pair<std::string, std::string>> files{
      {"cut.obj", kObj},
      {"cut_a.ply", ply("ascii", "float", "int")},
      {"cut_l.ply", ply("binary_little_endian", "float", "int")},
      {"cut_b.ply", ply("binary_big_endian", "double", "ushort")},
      {"cut_b.stl", binary_stl()},
      {"cut_a.stl", ascii_stl()},
      {"cut.off", kOff}};
  for (const auto& [file, bytes] : files) {
    for (std::size_t position = 0; position < bytes.size(); ++position) {
      SCOPED_TRACE(fmt::format("{} at byte {}", file, position));
      expect_refused_or_sound(file, bytes.substr(0, position));
      std::string changed = bytes;
      changed[position] = static_cast<char>(random());
      expect_refused_or_sound(file, changed);
    }
    std::string garbage = bytes;
    for (int i = 0; i < 300; ++i) garbage += static_cast<char>(random());
    expect_refused_or_sound(file, garbage);
  }
}

TEST(ReadScan, AnyBinaryFileThatIsCutOffIsRefused) {
  // Binary formats and PLY tell how much there is, so nothing that is missing may go unnoticed; a last newline may.
  for (const auto& [file, bytes] : {std::pair("short_l.ply", ply("binary_little_endian", "float", "int")),
                                    std::pair("short_b.ply", ply("binary_big_endian", "double", "ushort")),
                                    std::pair("short.stl", binary_stl()), std::pair("short_a.stl", ascii_stl())}) {
    const std::size_t needed =
        bytes.size() - (std::string_view(file) == "short_a.stl" ? std::strlen(" a tetrahedron\n") : 0);
    for (std::size_t size = 0; size < needed; ++size) {
      EXPECT_THROW((void)read_text(file, bytes.substr(0, size)), InvalidInput)
          << file << " cut to " << size << " bytes";
    }
  }
}

}  // namespace
}  // namespace interglow::mesh
