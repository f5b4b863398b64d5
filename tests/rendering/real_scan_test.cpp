// SPDX-License-Identifier: GPL-3.0-or-later
// Real scans from file to picture, coarsely: what repair and remeshing make of them must hold up light transport.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>

#include "mesh/scan_file.h"
#include "radiosity/direct_light.h"
#include "radiosity/error_estimate.h"
#include "radiosity/solution.h"
#include "rendering/render.h"
#include "scene/scene_builder.h"
#include "scene/scene_file.h"
#include "tests/temporary_folder.h"

namespace interglow::rendering {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;

const fs::path kFolder = fs::path(INTERGLOW_SHARED_DATA) / "meshes" / "scans";

struct ScanCase {
  const char* file;
  Vector3d seen_from;  ///< direction from the scan towards the camera, on the side that was scanned
  Vector3d up;
  /// Share of the scan's area that 2000 patches may lose or gain: folds, scales and claws smaller than a patch.
  double area_share;
  /// Share of patches with an angle below 20°: next to ragged borders, and between creases nearer to one another than
  /// patches are long (the rims of the can; the cuts where the dragon was no manifold).
  double sliver_share;
};
std::ostream& operator<<(std::ostream& out, const ScanCase& scan) { return out << scan.file; }

const Vector3d kY = Vector3d::UnitY();
const Vector3d kZ = Vector3d::UnitZ();
const ScanCase kCases[] = {
    {"armadillo_be.ply", {0.3, 0.4, -1.0}, kY, 0.2, 0.02},
    {"bunny_range000.ply", {0.2, 0.3, 1.0}, kY, 0.1, 0.02},
    {"bunny_zipper.ply", {0.2, 0.3, 1.0}, kY, 0.1, 0.02},
    {"demosthenes.stl", {1.0, 0.4, 0.3}, kY, 0.1, 0.02},
    {"dragon_vrip_res3.obj", {0.2, 0.3, 1.0}, kY, 0.2, 0.2},
    {"mug_on_table.ply", {0.1, -0.3, -1.0}, -kY, 0.1, 0.02},
    {"nefertiti_lowres.obj", {0.3, -1.0, 0.2}, kZ, 0.1, 0.02},
    {"ycb_master_chef_can.obj", {1.0, 0.3, 0.5}, kZ, 0.1, 0.3},
};

class RealScan : public testing::TestWithParam<ScanCase> {};

TEST_P(RealScan, BecomesASolvedImage) {
  const fs::path file = kFolder / GetParam().file;
  if (!fs::exists(file)) GTEST_SKIP() << file << " is absent: the shared collection of meshes is not in this clone";

  // As large as a hand, whatever its unit.
  const mesh::TriangleMesh raw = mesh::read_scan(file).mesh;
  Vector3d low = raw.points.front(), high = low;
  for (const auto& triangle : raw.triangles) {
    for (const int corner : triangle) {
      low = low.cwiseMin(raw.points[static_cast<std::size_t>(corner)]);
      high = high.cwiseMax(raw.points[static_cast<std::size_t>(corner)]);
    }
  }
  const double unit = 100.0 / (high - low).norm();
  const Vector3d center = 0.5 * unit * (low + high);
  const Vector3d eye = center + 400.0 * GetParam().seen_from.normalized();
  const Vector3d up = GetParam().up;
  const auto vector = [](const Vector3d& v) {
    return "[" + std::to_string(v.x()) + ", " + std::to_string(v.y()) + ", " + std::to_string(v.z()) + "]";
  };
  const test::TemporaryFolder folder;
  std::ofstream(folder / "scene.toml") << "[wavelengths]\ncenters_nm = [500, 600]\n[material.clay]\nreflectance = 0.6\n"
                                       << "[object.scan]\nmesh = '" << file.string() << "'\nunit_mm = " << unit
                                       << "\nmaterial = 'clay'\npatches = 2000\nclose_holes_mm = 6\n"
                                       << "[light.sun]\nkind = 'directional'\nspectrum = 1\nirradiance_W_m2 = 500\n"
                                       << "direction = " << vector(-GetParam().seen_from - up) << "\n"
                                       << "[light.sky]\nkind = 'sky'\nspectrum = 1\nradiance_W_m2_sr = 50\n"
                                       << "[camera]\nposition_mm = " << vector(eye)
                                       << "\ntarget_mm = " << vector(center) << "\nup = " << vector(up)
                                       << "\nhorizontal_fov_deg = 16\nwidth_px = 32\nheight_px = 32\n";
  const scene::BuiltScene built = scene::build_scene(scene::read_scene_file(folder / "scene.toml"));
  const scene::Scene& scene = built.scene;
  const mesh::RemeshReport& remeshed = built.objects.front().remesh;
  EXPECT_NEAR(remeshed.patches, 2000, 200);
  EXPECT_NEAR(remeshed.patch_area_mm2 / remeshed.scan_area_mm2, 1.0, GetParam().area_share);
  // A patch of edge a misses a fold of half its size by a quarter of a.
  EXPECT_LT(remeshed.distance.rms_mm, 0.25 * remeshed.edge_length_mm);
  EXPECT_LT(remeshed.angles.share_below_20_deg, GetParam().sliver_share);

  const radiosity::Elements elements = radiosity::make_elements(scene);
  const radiosity::Transport transport = radiosity::Transport::build(elements, {.tolerance = 1e-2});
  // Nothing sees more than everything, unless surfaces pass through each other. Twice the tolerance of a row.
  if (remeshed.crossings == 0) {
    EXPECT_LT(transport.report().max_row_sum, 1.02);
  } else {
    EXPECT_THAT(built.warnings, testing::Contains(testing::HasSubstr("pass through each other")));
  }
  const radiosity::RowMatrix direct =
      radiosity::total(radiosity::direct_light(scene, elements, transport), elements.size(), scene.grid.size());
  const radiosity::Solution solution = radiosity::solve(transport, scene.materials, elements.material, direct, {});
  ASSERT_TRUE(solution.converged);
  const radiosity::EnergyBalance balance = radiosity::energy_balance(scene, elements, transport, solution);
  EXPECT_LT(balance.relative_error, 1e-6);
  EXPECT_GT(balance.escaped, 0.0);
  const radiosity::ErrorEstimate error = radiosity::estimate_errors(scene, elements, transport, solution);
  EXPECT_TRUE(std::isfinite(error.total.element));

  const RenderedImages images = render(scene, elements, solution, {.samples_per_side = 2, .gather_tolerance = 1e-2});
  double covered = 0.0, light = 0.0;
  for (const float share : images.coverage) covered += share;
  for (const float value : images.total.value) {
    ASSERT_TRUE(std::isfinite(value) && value >= 0.0F) << value;
    light += value;
  }
  // The bounding sphere fills a third of the picture.
  EXPECT_GT(covered, 0.05 * static_cast<double>(images.coverage.size()));
  EXPECT_LT(covered, 0.5 * static_cast<double>(images.coverage.size()));
  EXPECT_GT(light, 0.0);
}

INSTANTIATE_TEST_SUITE_P(Files, RealScan, testing::ValuesIn(kCases), [](const auto& scan) {
  std::string name = fs::path(scan.param.file).stem().string();
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
});

TEST(RealScans, NoFileIsForgotten) {
  if (!fs::exists(kFolder))
    GTEST_SKIP() << kFolder << " is absent: the shared collection of meshes is not in this clone";
  for (const auto& entry : fs::directory_iterator(kFolder)) {
    EXPECT_TRUE(std::any_of(std::begin(kCases), std::end(kCases), [&](const ScanCase& scan) {
      return entry.path().filename() == scan.file;
    })) << entry.path();
  }
}

}  // namespace
}  // namespace interglow::rendering
