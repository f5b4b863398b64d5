// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/repair.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "mesh/scan_file.h"

namespace interglow::mesh {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::IsEmpty;

const fs::path kMeshes = fs::path(INTERGLOW_SHARED_DATA) / "meshes";

/// What `Repaired::mesh` promises, by maps of edges and walks around points; empty if it holds.
std::string broken_promise(const TriangleMesh& mesh) {
  std::map<std::pair<int, int>, int> face_at;  // directed edge -> face
  std::vector<std::vector<int>> faces_of(mesh.points.size());
  for (std::size_t f = 0; f < mesh.triangles.size(); ++f) {
    const auto& t = mesh.triangles[f];
    double longest = 0.0;
    for (int k = 0; k < 3; ++k) {
      if (t[k] < 0 || t[k] >= static_cast<int>(mesh.points.size())) return fmt::format("face {}: index {}", f, t[k]);
      if (t[k] == t[(k + 1) % 3]) return fmt::format("face {}: repeated corner", f);
      if (!face_at.emplace(std::pair(t[k], t[(k + 1) % 3]), static_cast<int>(f)).second) {
        return fmt::format("edge {}-{} runs twice in one direction", t[k], t[(k + 1) % 3]);
      }
      faces_of[t[k]].push_back(static_cast<int>(f));
      longest = std::max(longest, (mesh.points[t[k]] - mesh.points[t[(k + 1) % 3]]).norm());
    }
    const double twice_area =
        (mesh.points[t[1]] - mesh.points[t[0]]).cross(mesh.points[t[2]] - mesh.points[t[0]]).norm();
    if (!(twice_area > 0.99e-8 * longest * longest)) return fmt::format("face {}: no area", f);
  }
  for (std::size_t p = 0; p < mesh.points.size(); ++p) {
    if (faces_of[p].empty()) return fmt::format("point {} is not used", p);
    // From one face around the point, both ways: all of its faces must be met.
    std::set<int> met;
    std::vector<int> to_visit{faces_of[p].front()};
    while (!to_visit.empty()) {
      const int f = to_visit.back();
      to_visit.pop_back();
      if (!met.insert(f).second) continue;
      const auto& t = mesh.triangles[f];
      for (int k = 0; k < 3; ++k) {
        const int a = t[k];
        const int b = t[(k + 1) % 3];
        if (a != static_cast<int>(p) && b != static_cast<int>(p)) continue;
        if (const auto other = face_at.find({b, a}); other != face_at.end()) to_visit.push_back(other->second);
      }
    }
    if (met.size() != faces_of[p].size()) return fmt::format("{} fans of faces meet in point {}", "several", p);
  }
  return "";
}

std::size_t border_edges(const RepairReport& report) {
  std::size_t edges = 0;
  for (const BorderLoop& border : report.borders) edges += static_cast<std::size_t>(border.edges);
  return edges;
}

/// (columns x rows) points one apart, two triangles a cell.
TriangleMesh grid(int columns, int rows) {
  TriangleMesh mesh;
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < columns; ++x) mesh.points.emplace_back(x, y, 0.1 * std::sin(x + 2.0 * y));
  }
  for (int y = 0; y + 1 < rows; ++y) {
    for (int x = 0; x + 1 < columns; ++x) {
      const int i = y * columns + x;
      mesh.triangles.push_back({i, i + 1, i + columns + 1});
      mesh.triangles.push_back({i, i + columns + 1, i + columns});
    }
  }
  return mesh;
}

TriangleMesh octahedron(const Eigen::Vector3d& centre, double radius, bool inward = false) {
  TriangleMesh mesh;
  for (int axis = 0; axis < 3; ++axis) {
    mesh.points.push_back(centre + radius * Eigen::Vector3d::Unit(axis));
    mesh.points.push_back(centre - radius * Eigen::Vector3d::Unit(axis));
  }
  for (int octant = 0; octant < 8; ++octant) {
    const int x = octant & 1;
    const int y = octant >> 1 & 1;
    const int z = octant >> 2 & 1;
    const bool turned = ((x + y + z) % 2 == 1) != inward;
    mesh.triangles.push_back(turned ? std::array{x, 4 + z, 2 + y} : std::array{x, 2 + y, 4 + z});
  }
  return mesh;
}

void append(TriangleMesh& mesh, const TriangleMesh& other) {
  const int offset = static_cast<int>(mesh.points.size());
  mesh.points.insert(mesh.points.end(), other.points.begin(), other.points.end());
  for (const auto& [a, b, c] : other.triangles) mesh.triangles.push_back({a + offset, b + offset, c + offset});
}

double signed_volume(const TriangleMesh& mesh) {
  double volume = 0.0;
  for (const auto& [a, b, c] : mesh.triangles) volume += mesh.points[a].dot(mesh.points[b].cross(mesh.points[c])) / 6.0;
  return volume;
}

TEST(Repair, ASoundMeshComesBackUnchanged) {
  for (const TriangleMesh& mesh : {grid(9, 7), octahedron({1, 2, 3}, 2.0)}) {
    const Repaired repaired = repair(mesh);
    EXPECT_EQ(repaired.mesh.points, mesh.points);
    EXPECT_EQ(repaired.mesh.triangles, mesh.triangles);
    EXPECT_THAT(repaired.report.warnings, IsEmpty());
    EXPECT_EQ(broken_promise(repaired.mesh), "");
  }
}

TEST(Repair, MeasuresBorders) {
  TriangleMesh mesh = grid(6, 6);
  for (Eigen::Vector3d& point : mesh.points) point.z() = 0.0;
  // Two cells in the middle: a hole of 2 x 1.
  mesh.triangles.erase(mesh.triangles.begin() + 2 * (5 * 2 + 1), mesh.triangles.begin() + 2 * (5 * 2 + 3));
  const RepairReport report = repair(mesh).report;
  ASSERT_EQ(report.borders.size(), 2U);
  EXPECT_EQ(report.borders[0].edges, 20);
  EXPECT_DOUBLE_EQ(report.borders[0].length_mm, 20.0);
  EXPECT_DOUBLE_EQ(report.borders[0].area_mm2, 25.0);
  EXPECT_EQ(report.borders[1].edges, 6);
  EXPECT_DOUBLE_EQ(report.borders[1].area_mm2, 2.0);
  EXPECT_DOUBLE_EQ(report.area_mm2, 23.0);
  EXPECT_FALSE(report.closed);
  EXPECT_THAT(report.warnings, IsEmpty());
}

TEST(Repair, FillsHolesOnlyWhenAsked) {
  TriangleMesh mesh = grid(6, 6);
  for (Eigen::Vector3d& point : mesh.points) point.z() = 0.0;
  mesh.triangles.erase(mesh.triangles.begin() + 2 * (5 * 2 + 1), mesh.triangles.begin() + 2 * (5 * 2 + 3));
  const Repaired repaired = repair(mesh, {.fill_holes_up_to_edges = 6});
  EXPECT_EQ(repaired.report.holes_filled, 1U);
  EXPECT_EQ(repaired.report.faces_added, 4U);  // a polygon of n corners has n - 2 triangles
  EXPECT_DOUBLE_EQ(repaired.report.area_mm2, 25.0);
  EXPECT_EQ(repaired.report.faces_turned, 0U);
  EXPECT_EQ(repaired.report.borders.size(), 1U);
  EXPECT_EQ(broken_promise(repaired.mesh), "");
  TriangleMesh open = octahedron({0, 0, 0}, 1.0);
  open.triangles.pop_back();
  EXPECT_TRUE(repair(open, {.fill_holes_up_to_edges = 3}).report.closed);
}

TEST(Repair, MergesPointsAsFarAsAsked) {
  TriangleMesh soup;
  const TriangleMesh sound = grid(5, 5);
  for (std::size_t f = 0; f < sound.triangles.size(); ++f) {
    for (const int corner : sound.triangles[f]) {
      soup.points.push_back(sound.points[corner] + Eigen::Vector3d(0, 0, 1e-6 * static_cast<double>(f % 3)));
    }
    const int first = static_cast<int>(3 * f);
    soup.triangles.push_back({first, first + 1, first + 2});
  }
  EXPECT_GT(repair(soup).report.components, 1U);
  const Repaired welded = repair(soup, {.weld_distance = 1e-6});
  EXPECT_EQ(welded.mesh.points.size(), 25U);
  EXPECT_EQ(welded.report.points_merged, soup.points.size() - 25U);
  EXPECT_EQ(welded.report.components, 1U);
  EXPECT_EQ(broken_promise(welded.mesh), "");
}

TEST(Repair, ACapIsFlippedAndLeavesNoCrack) {
  // Point 4 lies on the edge 1-2 of the square's diagonal; the face 1 4 2 there has no area.
  TriangleMesh mesh;
  mesh.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}, {0.5, 0.5, 0}};
  mesh.triangles = {{0, 1, 2}, {1, 4, 2}, {1, 3, 4}, {4, 3, 2}};
  const Repaired repaired = repair(mesh);
  EXPECT_EQ(repaired.report.flat_faces_flipped, 1U);
  EXPECT_EQ(repaired.report.flat_faces_removed, 0U);
  EXPECT_EQ(repaired.mesh.triangles.size(), 4U);
  ASSERT_EQ(repaired.report.borders.size(), 1U);
  EXPECT_EQ(repaired.report.borders[0].edges, 4);
  EXPECT_DOUBLE_EQ(repaired.report.area_mm2, 1.0);
  EXPECT_EQ(broken_promise(repaired.mesh), "");
}

TEST(Repair, NeedlesAreMerged) {
  // The octahedron with one corner doubled 1e-12 beside itself and the gap closed by two needles.
  TriangleMesh mesh = octahedron({0, 0, 0}, 1.0);
  mesh.points.push_back(mesh.points[4] + Eigen::Vector3d(1e-12, 0, 0));
  for (auto& triangle : mesh.triangles) {
    if (triangle[0] != 0) continue;
    std::replace(triangle.begin(), triangle.end(), 4, 6);
  }
  mesh.triangles.push_back({4, 6, 2});
  mesh.triangles.push_back({6, 4, 3});
  const Repaired repaired = repair(mesh);
  EXPECT_EQ(repaired.mesh.points.size(), 6U);
  EXPECT_EQ(repaired.mesh.triangles.size(), 8U);
  EXPECT_TRUE(repaired.report.closed);
  EXPECT_EQ(repaired.report.flat_faces_removed, 2U);
  EXPECT_EQ(broken_promise(repaired.mesh), "");
}

TEST(Repair, ClosedPiecesFaceOutwardAndCavitiesStay) {
  TriangleMesh mesh = octahedron({5e6, 0, 0}, 3.0, true);
  append(mesh, octahedron({5e6, 0, 0}, 1.0, true));   // a cavity in it
  append(mesh, octahedron({5e6, 9, 0}, 1.0, false));  // right as it is
  const Repaired repaired = repair(mesh);
  EXPECT_EQ(repaired.report.components_turned_outward, 1U);
  EXPECT_EQ(repaired.report.components, 3U);
  TriangleMesh near_origin = repaired.mesh;
  for (Eigen::Vector3d& point : near_origin.points) point.x() -= 5e6;
  // 4/3 r^3 each; the cavity counts against.
  EXPECT_NEAR(signed_volume(near_origin), 4.0 / 3.0 * (27.0 - 1.0 + 1.0), 1e-9);
  const Repaired room = repair(octahedron({0, 0, 0}, 3.0, true), {.closed_outward = false});
  EXPECT_NEAR(signed_volume(room.mesh), -36.0, 1e-12);
}

TEST(Repair, TwoSolidsThatTouchInAnEdgeComeApart) {
  // Two unit cubes, checkerboard-wise: their common edge has four faces.
  TriangleMesh mesh;
  for (const Eigen::Vector3d& corner : {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(1, 1, 0)}) {
    TriangleMesh cube;
    for (int i = 0; i < 8; ++i) cube.points.push_back(corner + Eigen::Vector3d(i & 1, i >> 1 & 1, i >> 2 & 1));
    for (const auto& q :
         {std::array{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}}) {
      cube.triangles.push_back({q[0], q[1], q[2]});
      cube.triangles.push_back({q[0], q[2], q[3]});
    }
    append(mesh, cube);
  }
  const Repaired repaired = repair(mesh);
  EXPECT_EQ(repaired.report.points_merged, 2U);
  EXPECT_EQ(repaired.report.edges_split, 1U);
  EXPECT_TRUE(repaired.report.closed);
  EXPECT_EQ(repaired.mesh.triangles.size(), 24U);
  EXPECT_EQ(repaired.report.faces_turned, 0U);
  EXPECT_NEAR(signed_volume(repaired.mesh), 2.0, 1e-14);
  EXPECT_EQ(broken_promise(repaired.mesh), "");
}

TEST(Repair, CountsCrossingTriangles) {
  TriangleMesh mesh = octahedron({0, 0, 0}, 1.0);
  mesh.points.insert(mesh.points.end(),
                     {{0.2, 0.2, -5}, {0.3, 0.2, 5}, {0.2, 0.3, 5}});  // a needle through two of its faces
  mesh.triangles.push_back({6, 7, 8});
  EXPECT_EQ(repair(mesh, {.count_self_intersections = true}).report.self_intersections, 2U);
  EXPECT_FALSE(repair(mesh).report.self_intersections);
}

/// Random damage: faces turned, repeated, made flat, points doubled, fins added.
TriangleMesh damaged(std::mt19937& random) {
  TriangleMesh mesh = grid(12, 9);
  append(mesh, octahedron({3, 3, 8}, 2.0));
  const auto any = [&](std::size_t n) {
    return static_cast<int>(std::uniform_int_distribution<std::size_t>(0, n - 1)(random));
  };
  for (int i = 0; i < 40; ++i) {
    const int face = any(mesh.triangles.size());
    const auto t = mesh.triangles[face];
    const int point = any(mesh.points.size());
    switch (any(7)) {
      case 0:
        std::swap(mesh.triangles[face][0], mesh.triangles[face][1]);
        break;
      case 1:
        mesh.triangles.push_back({t[1], t[0], t[2]});
        break;
      case 2:
        mesh.triangles.push_back({t[0], t[0], t[2]});
        break;
      case 3:
        mesh.points.push_back(mesh.points[t[0]]);
        mesh.triangles[face][0] = static_cast<int>(mesh.points.size()) - 1;
        break;
      case 4:
        if (point != t[0] && point != t[1]) mesh.triangles.push_back({t[0], t[1], point});
        break;
      case 5:
        mesh.points.push_back(0.5 * (mesh.points[t[0]] + mesh.points[t[1]]));
        mesh.triangles.push_back({t[0], t[1], static_cast<int>(mesh.points.size()) - 1});
        break;
      default:
        mesh.triangles.erase(mesh.triangles.begin() + face);
        break;
    }
  }
  return mesh;
}

TEST(Repair, AnyDamageGivesAManifoldAndASecondRepairKeepsItsFaces) {
  for (unsigned seed = 0; seed < 200; ++seed) {
    std::mt19937 random(seed);
    const TriangleMesh mesh = damaged(random);
    RepairParams params{.smallest_component_share = 0.0};
    if (seed % 2 == 1) params.fill_holes_up_to_edges = 8;
    const Repaired once = repair(mesh, params);
    ASSERT_EQ(broken_promise(once.mesh), "") << "seed " << seed;
    const Repaired twice = repair(once.mesh, {.smallest_component_share = 0.0});
    ASSERT_EQ(broken_promise(twice.mesh), "") << "seed " << seed;
    // Points that were split in place are equal and are welded and split again; the faces must be the same ones.
    EXPECT_EQ(twice.mesh.triangles.size(), once.mesh.triangles.size()) << "seed " << seed;
    EXPECT_EQ(twice.report.flat_faces_flipped, 0U) << "seed " << seed;
    EXPECT_EQ(twice.report.unused_points_removed, 0U) << "seed " << seed;
    EXPECT_DOUBLE_EQ(twice.report.area_mm2, once.report.area_mm2) << "seed " << seed;
  }
}

TEST(Repair, TheOrderOfFacesDoesNotChangeTheCounts) {
  std::mt19937 random(3);
  TriangleMesh mesh = grid(20, 20);
  for (int i = 0; i < 30; ++i) std::swap(mesh.triangles[i * 7][1], mesh.triangles[i * 7][2]);
  for (int i = 0; i < 10; ++i) mesh.triangles.push_back(mesh.triangles[i * 11]);
  mesh.triangles.push_back({0, 1, 399});
  const RepairReport first = repair(mesh).report;
  for (int round = 0; round < 10; ++round) {
    std::shuffle(mesh.triangles.begin(), mesh.triangles.end(), random);
    for (auto& triangle : mesh.triangles) std::rotate(triangle.begin(), triangle.begin() + round % 3, triangle.end());
    const Repaired repaired = repair(mesh);
    EXPECT_EQ(broken_promise(repaired.mesh), "");
    EXPECT_EQ(repaired.report.faces_turned, first.faces_turned);
    EXPECT_EQ(repaired.report.duplicate_faces_removed, first.duplicate_faces_removed);
    EXPECT_EQ(repaired.report.borders.size(), first.borders.size());
    EXPECT_EQ(border_edges(repaired.report), border_edges(first));
  }
}

TEST(Repair, RefusesWhatHasNoSurface) {
  EXPECT_THROW((void)repair({}), InvalidInput);
  EXPECT_THROW((void)repair({{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, {{0, 1, 2}}}), InvalidInput);
  EXPECT_THROW((void)repair(grid(2, 2), {.weld_distance = 0.5}), InvalidParams);
  EXPECT_THROW((void)repair(grid(2, 2), {.smallest_component_share = 1.0}), InvalidParams);
  EXPECT_THROW((void)repair(grid(2, 2), {.fill_holes_up_to_edges = 2}), InvalidParams);
}

// The shared collection; counts are those of the MANIFEST beside the files (an independent program in Python).
struct Case {
  const char* file;
  std::size_t points, triangles, loops;
  std::vector<const char*> warnings;  ///< what they must say, one each; none: valid
};

TEST(RepairOfBrokenFiles, AgreesWithTheManifest) {
  if (!fs::exists(kMeshes)) GTEST_SKIP() << kMeshes << " is absent: the shared collection of meshes is not installed";
  const std::vector<Case> cases{
      // The line that repeats itself runs against the faces beside it (edge 1-2 of "1 2 3 4" and of "2 6 5 1").
      {"assimp_box_longline.obj", 8, 12, 0, {"2 faces turned"}},
      {"assimp_box_utf16be.obj", 8, 12, 0, {}},
      {"assimp_cube_binary_starts_with_nl.ply", 8, 12, 0, {}},
      {"assimp_malformed2.obj", 8, 10, 1, {}},
      {"assimp_two_solids.stl", 6, 2, 2, {}},
      {"binary_named_solid.stl", 395, 702, 2, {}},
      {"cgal_degtri_four.obj", 5, 3, 1, {"1 face without area removed"}},
      {"crlf_continued.obj", 395, 702, 2, {}},
      {"draco_deg_faces.obj", 5, 3, 1, {"1 point without faces", "1 face with a repeated corner"}},
      {"draco_eof_test.obj", 3, 1, 1, {}},
      {"duplicate_faces.obj", 395, 702, 2, {"65 duplicate faces"}},
      {"extra_properties.ply", 4, 2, 1, {}},
      {"far_offset_double.ply", 395, 702, 2, {}},
      {"flipped_patch.stl", 395, 702, 2, {"turned to agree"}},
      {"floating_specks.obj", 395, 702, 2, {"100 points without faces", "60 tiny pieces removed (60 faces)"}},
      {"garbage_tail.stl", 395, 702, 2, {}},
      {"gc_hourglass_ico.obj", 24, 40, 0, {"1 point copied"}},
      {"quads.obj", 395, 702, 2, {}},
      {"self_intersecting.ply", 790, 1404, 4, {"166 pairs of triangles cross"}},
      {"trimesh_negative_indices.obj", 8, 12, 0, {}},
      {"trimesh_notenoughindices.obj", 3, 1, 1, {}},
      {"trimesh_soup.stl", 300, 100, 100, {"1248 pairs of triangles cross"}},
      {"tristrips.ply", 395, 702, 2, {}},
      {"unwelded_soup.obj", 395, 702, 2, {"1711 points merged"}},
  };
  for (const Case& expected : cases) {
    SCOPED_TRACE(expected.file);
    const Repaired repaired =
        repair(read_scan(kMeshes / "broken" / expected.file).mesh, {.count_self_intersections = true});
    EXPECT_EQ(broken_promise(repaired.mesh), "");
    EXPECT_EQ(repaired.mesh.points.size(), expected.points);
    EXPECT_EQ(repaired.mesh.triangles.size(), expected.triangles);
    EXPECT_EQ(repaired.report.borders.size(), expected.loops);
    const std::string said = fmt::format("{}", fmt::join(repaired.report.warnings, "\n"));
    EXPECT_EQ(repaired.report.warnings.size(), expected.warnings.size()) << said;
    for (const char* warning : expected.warnings) EXPECT_THAT(said, HasSubstr(warning));
  }
}

TEST(RepairOfBrokenFiles, CutsWhatIsNoManifold) {
  if (!fs::exists(kMeshes)) GTEST_SKIP() << kMeshes << " is absent: the shared collection of meshes is not installed";
  const auto repaired_file = [](const char* file) { return repair(read_scan(kMeshes / "broken" / file).mesh); };
  for (const char* file :
       {"index_out_of_range.obj", "nan_facets.stl", "nan_inf_vertices.ply", "range_grid_no_faces.ply"}) {
    EXPECT_EQ(broken_promise(repaired_file(file).mesh), "") << file;
  }
  const Repaired fin = repaired_file("fin_and_bowtie.obj");
  EXPECT_EQ(broken_promise(fin.mesh), "");
  EXPECT_EQ(fin.report.edges_split, 1U);
  // One point of the bow tie; the fin's two points on the edge.
  EXPECT_EQ(fin.report.points_split, 3U);
  const Repaired wrap = repaired_file("draco_non_manifold_wrap.obj");
  EXPECT_EQ(broken_promise(wrap.mesh), "");
  EXPECT_EQ(wrap.report.edges_split, 1U);
  EXPECT_EQ(wrap.mesh.triangles.size(), 12U);
  const Repaired moebius = repaired_file("gc_moebius.obj");
  EXPECT_EQ(broken_promise(moebius.mesh), "");
  EXPECT_EQ(moebius.report.unorientable_edges_cut, 4U);
  EXPECT_EQ(moebius.mesh.triangles.size(), 448U);
  const Repaired flat = repaired_file("zero_area.ply");
  EXPECT_EQ(broken_promise(flat.mesh), "");
  EXPECT_EQ(flat.mesh.triangles.size(), 702U);
  EXPECT_EQ(flat.report.flat_faces_removed + flat.report.faces_with_repeated_corner_removed, 4U);
  EXPECT_EQ(flat.report.borders.size(), 2U);
  // Its only face lies on a line.
  EXPECT_THROW((void)repaired_file("assimp_number_formats.obj"), InvalidInput);
}

struct ScanCase {
  const char* file;
  std::size_t unused, triangles, loops, border_edges, components, bow_ties;
};

const ScanCase kScans[] = {
    {"scans/armadillo_be.ply", 0, 86482, 0, 0, 1, 0},
    {"scans/bunny_range000.ply", 0, 77789, 86, 2413, 32, 34},
    {"scans/bunny_zipper.ply", 1113, 69451, 5, 223, 1, 0},
    {"scans/demosthenes.stl", 0, 16719, 1, 67, 1, 0},
    {"scans/mug_on_table.ply", 0, 65770, 99, 2436, 8, 20},
    {"scans/nefertiti_lowres.obj", 0, 70000, 0, 0, 1, 0},
    {"scans/ycb_master_chef_can.obj", 0, 15728, 0, 0, 1, 0},
    {"synthetic/arch_r20_n002_arch.obj", 0, 22792, 32, 620, 1, 1},
    {"synthetic/arch_r20_n002_plane.obj", 0, 22682, 30, 832, 1, 0},
    {"synthetic/arch_r20_n010_arch.obj", 0, 22773, 28, 609, 1, 0},
    {"synthetic/arch_r20_n010_plane.obj", 0, 22650, 29, 834, 1, 2},
    {"synthetic/halfcyl_r20_n002_left.obj", 0, 23004, 32, 630, 1, 3},
    {"synthetic/halfcyl_r20_n002_right.obj", 0, 22987, 24, 597, 1, 2},
    {"synthetic/halfcyl_r20_n010_left.obj", 0, 23012, 30, 612, 1, 2},
    {"synthetic/halfcyl_r20_n010_right.obj", 0, 23045, 30, 591, 1, 0},
};

class RepairOfScan : public testing::TestWithParam<ScanCase> {};

TEST_P(RepairOfScan, AgreesWithTheManifest) {
  if (!fs::exists(kMeshes)) GTEST_SKIP() << kMeshes << " is absent: the shared collection of meshes is not installed";
  const ScanCase& expected = GetParam();
  const ScanFile scan = read_scan(kMeshes / expected.file);
  EXPECT_THAT(scan.report.warnings, IsEmpty());
  const Repaired repaired = repair(scan.mesh, {.smallest_component_share = 0.0});
  const RepairReport& report = repaired.report;
  EXPECT_EQ(broken_promise(repaired.mesh), "");
  EXPECT_EQ(report.unused_points_removed, expected.unused);
  EXPECT_EQ(repaired.mesh.triangles.size(), expected.triangles);
  EXPECT_EQ(report.borders.size(), expected.loops);
  EXPECT_EQ(border_edges(report), expected.border_edges);
  EXPECT_EQ(report.components, expected.components);
  EXPECT_EQ(report.points_split, expected.bow_ties);
}

std::string test_name(const testing::TestParamInfo<ScanCase>& tested) { return fs::path(tested.param.file).stem(); }

INSTANTIATE_TEST_SUITE_P(Files, RepairOfScan, testing::ValuesIn(kScans), test_name);

TEST(RepairOfScans, TheDecimatedDragonBecomesManifold) {
  if (!fs::exists(kMeshes)) GTEST_SKIP() << kMeshes << " is absent: the shared collection of meshes is not installed";
  const ScanFile scan = read_scan(kMeshes / "scans" / "dragon_vrip_res3.obj");
  const Repaired repaired = repair(scan.mesh, {.smallest_component_share = 0.0});
  EXPECT_EQ(broken_promise(repaired.mesh), "");
  EXPECT_EQ(repaired.report.unused_points_removed, 16U);
  EXPECT_EQ(repaired.report.duplicate_faces_removed, 1254U);
  EXPECT_EQ(repaired.mesh.triangles.size(), 47794U - 1254U);
}

}  // namespace
}  // namespace interglow::mesh
