// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/scan_simulator.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "diagnostics/error.h"
#include "mesh/scan_file.h"
#include "tests/temporary_folder.h"

namespace interglow::mesh {
namespace {

TEST(ScanSimulator, NoiseHasTheAskedDeviation) {
  const auto objects = simulate_scan({.noise_sigma_mm = 0.1, .seed = 3});
  ASSERT_EQ(objects.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) {
    const auto& points = objects[i].scan.points;
    double sum = 0, square = 0;
    for (const Eigen::Vector3d& p : points) {
      const double height = std::hypot(p.x() - (i == 0 ? -20 : 20), p.z()) - 20;
      sum += height;
      square += height * height;
    }
    const double n = static_cast<double>(points.size());
    // |z| < 5 for a mean and a standard deviation of n normal samples.
    EXPECT_LT(std::abs(sum / n), 5 * 0.1 / std::sqrt(n));
    EXPECT_LT(std::abs(std::sqrt(square / n) - 0.1), 5 * 0.1 / std::sqrt(2 * n));
  }
}

TEST(ScanSimulator, SurfacesWithoutNoiseAreExactAndFaceTheScanner) {
  for (const SimulatedScene scene : {SimulatedScene::kHalfCylinders, SimulatedScene::kArchOnPlane,
                                     SimulatedScene::kVGroove, SimulatedScene::kSphere}) {
    for (const SimulatedObject& object : simulate_scan({.scene = scene, .noise_sigma_mm = 0})) {
      const double axis = object.name == "left" ? -20 : object.name == "right" ? 20 : 0;
      const bool is_groove = scene == SimulatedScene::kVGroove;
      for (const auto& t : object.scan.triangles) {
        const Eigen::Vector3d &a = object.scan.points[t[0]], &b = object.scan.points[t[1]],
                              &c = object.scan.points[t[2]];
        const Eigen::Vector3d normal = (b - a).cross(c - a).normalized(), centre = (a + b + c) / 3;
        Eigen::Vector3d truth;
        double height = 0;
        if (object.name == "plane") {
          truth = Eigen::Vector3d::UnitZ();
          height = a.z();
        } else if (is_groove) {  // 30° to either side of the vertical
          const double side = axis < 0 ? -1 : 1;
          truth = {-side * std::cos(std::numbers::pi / 6), 0, std::sin(std::numbers::pi / 6)};
          height = a.dot(truth);
        } else if (scene == SimulatedScene::kSphere) {
          truth = centre.normalized();
          height = a.norm() - 20;
        } else {
          truth = Eigen::Vector3d(centre.x() - axis, 0, centre.z()).normalized();
          height = std::hypot(a.x() - axis, a.z()) - 20;
        }
        ASSERT_NEAR(height, 0, 1e-12) << object.name;
        // Triangles of 0.5 mm on a radius of 20 mm lean by at most about a degree and a half.
        ASSERT_GT(normal.dot(truth), std::cos(0.03)) << object.name;
      }
    }
  }
}

TEST(ScanSimulator, LeavesOutTheStripAndTheHoles) {
  const auto full = simulate_scan({.strip_mm = 0});
  const auto objects = simulate_scan({.strip_mm = 0.7, .holes = 5});
  for (std::size_t i = 0; i < 2; ++i) {
    double nearest = 1e9;
    for (const Eigen::Vector3d& p : objects[i].scan.points) nearest = std::min(nearest, std::hypot(p.x(), p.z()));
    // The chord of 0.7 mm of arc, less 4 sigma of noise.
    EXPECT_GT(nearest, 0.62) << objects[i].name;
    EXPECT_LT(objects[i].scan.points.size(), full[i].scan.points.size());
    EXPECT_THAT(objects[i].truth_json, testing::HasSubstr("half_axes"));
  }
}

TEST(ScanSimulator, SameSeedSameBits) {
  const ScanSimulationParams params{.ragged_mm = 0.8, .holes = 3, .outlier_share = 0.01, .seed = 9};
  ScanSimulationParams other = params;
  other.seed = 10;
  EXPECT_EQ(simulate_scan(params)[0].scan.points, simulate_scan(params)[0].scan.points);
  EXPECT_NE(simulate_scan(params)[0].scan.points, simulate_scan(other)[0].scan.points);
}

TEST(ScanSimulator, WrittenFilesAreReadBack) {
  const ScanSimulationParams params{.length_mm = 5};
  const auto objects = simulate_scan(params);
  const test::TemporaryFolder folder;
  for (const char* extension : {"ply", "obj"}) {
    const auto written = write_simulated_scan(objects, params, folder.path(), "pair", extension);
    ASSERT_EQ(written.size(), 3u);
    for (std::size_t i = 0; i < 2; ++i) {
      const TriangleMesh read = read_scan(written[i]).mesh;
      EXPECT_EQ(read.triangles, objects[i].scan.triangles);
      ASSERT_EQ(read.points.size(), objects[i].scan.points.size());
      for (std::size_t k = 0; k < read.points.size(); ++k)  // every bit survives
        ASSERT_EQ(read.points[k], objects[i].scan.points[k]);
    }
  }
}

TEST(ScanSimulator, RefusesParametersOutOfRange) {
  EXPECT_THROW(simulate_scan({.radius_mm = -1}), InvalidParams);
  EXPECT_THROW(simulate_scan({.spacing_mm = 1e-6}), InvalidParams);
  EXPECT_THROW(simulate_scan({.scene = SimulatedScene::kSphere, .spacing_mm = 1e-6}), InvalidParams);
  try {
    simulate_scan({.jitter = 0.9});
    FAIL();
  } catch (const InvalidParams& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("jitter is 0.9"));
  }
}

}  // namespace
}  // namespace interglow::mesh
