// SPDX-License-Identifier: GPL-3.0-or-later
#include "rendering/camera_rays.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "diagnostics/error.h"

namespace interglow::rendering {
namespace {

using Eigen::Vector3d;

// The rule written beside the images of the other renderer, spelt out: sx = (j + a) / N, sy = (i + b) / N, h = tan(hfov
// / 2), dir = normalize(forward + (2 sx - 1) h right + (1 - 2 sy) h up), with the frame stated there for the Cornell
// box.
TEST(CameraRays, FollowTheRayRuleOfTheReferenceImages) {
  scene::Camera camera;
  camera.position = {278, 273, -800};
  camera.target = {278, 273, 0};
  camera.up = {0, 1, 0};
  camera.horizontal_fov_deg = 39.30764811610662;
  camera.width = camera.height = 256;
  const CameraRays rays = camera_rays(camera);
  const Vector3d forward(0, 0, 1);
  const Vector3d image_right(-1, 0, 0);
  const Vector3d image_up(0, 1, 0);
  const double h = std::tan(0.5 * camera.horizontal_fov_deg * std::numbers::pi / 180.0);
  for (const auto& [row, column] : {std::pair{0.5, 0.5}, {17.25, 200.75}, {255.0, 3.0}}) {
    const Vector3d expected =
        (forward + (2 * column / 256 - 1) * h * image_right + (1 - 2 * row / 256) * h * image_up).normalized();
    EXPECT_LT((rays.direction(column, row).normalized() - expected).norm(), 1e-15) << row << ' ' << column;
  }
}

TEST(CameraRays, PixelsAreSquareInWideImages) {
  scene::Camera camera;
  camera.width = 400;
  camera.height = 100;
  camera.horizontal_fov_deg = 90;
  const CameraRays rays = camera_rays(camera);
  EXPECT_NEAR((rays.direction(1, 0) - rays.direction(0, 0)).norm(), 2.0 / 400, 1e-15);
  EXPECT_NEAR((rays.direction(0, 1) - rays.direction(0, 0)).norm(), 2.0 / 400, 1e-15);
  EXPECT_NEAR(rays.pixel_side(), 2.0 / 400, 1e-15);
}

TEST(CameraRays, ProjectionUndoesTheRays) {
  scene::Camera camera;
  camera.position = {3, -4, 12};
  camera.target = {1, 2, 0};
  camera.width = 300;
  camera.height = 200;
  const CameraRays rays = camera_rays(camera);
  for (const auto& [row, column] : {std::pair{0.0, 0.0}, {100.0, 150.0}, {-20.5, 310.25}}) {
    const auto place = rays.project(rays.origin + 7.0 * rays.direction(column, row));
    ASSERT_TRUE(place);
    EXPECT_NEAR(place->x(), column, 1e-10);
    EXPECT_NEAR(place->y(), row, 1e-10);
  }
  EXPECT_FALSE(rays.project(rays.origin - rays.forward));
}

TEST(CameraRays, RefusesUpAlongTheView) {
  scene::Camera camera;
  camera.position = {0, 0, 10};
  camera.up = {0, 0, 2};
  try {
    camera_rays(camera);
    FAIL() << "accepted";
  } catch (const InvalidParams& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("up (0, 0, 2)"));
  }
}

}  // namespace
}  // namespace interglow::rendering
