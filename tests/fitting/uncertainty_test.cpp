// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/uncertainty.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <numbers>
#include <string>

#include "fit_captures.h"
#include "fit_scenes.h"
#include "fitting/attribution.h"

namespace interglow::fitting {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

struct Fitted {
  ForwardModel model;
  FitParams params;
  SceneFit fit;
  Uncertainty uncertainty;

  Fitted(const scene::Scene& scene, const FitParams& with, const test::CaptureOptions& options = {})
      : model(scene, {.mesh = {}}),
        params(with),
        fit(fit_scene(model, test::simulated_capture(scene, options), model.initial_state(), with)),
        uncertainty(examine(model, fit, with, {.profile = false})) {}

  std::string sentences() const {
    std::string all;
    for (const std::string& note : uncertainty.notes) all += note + "\n";
    for (const WeakDirection& weak : uncertainty.weak) all += weak.sentence + "\n";
    return all;
  }
};

constexpr test::FitSceneParams kSmall{.around = 8, .along = 4, .bands = 3, .side_px = 24, .fluorescent = false};
/// From the truth, at full size: what is asked is what the data determine there.
constexpr FitParams kNear{.focal = false, .blur = false, .staged = false, .most_iterations = 3};

TEST(Uncertainty, LightAlongParallelCylindersTradesWithTheGain) {
  // No normal has a part along the axis, and a light without a part across it throws no shadow: exactly degenerate.
  scene::Scene scene = test::half_cylinders(kSmall);
  scene.directional_lights[0].direction = Vector3d(0.0, -0.3, -1.0).normalized();
  const Fitted cylinders(scene, kNear);
  EXPECT_NE(cylinders.sentences().find("light tilt along the axis of the surfaces (0.00, 1.00, 0.00)"),
            std::string::npos)
      << cylinders.sentences();
  EXPECT_NE(cylinders.sentences().find("the gain"), std::string::npos) << cylinders.sentences();
  EXPECT_TRUE(cylinders.uncertainty.find(kW)->determined);
}

TEST(Uncertainty, WithTheGainKnownTheMirroredLightIsListed) {
  scene::Scene scene = test::half_cylinders(kSmall);
  scene.directional_lights[0].direction = Vector3d(0.0, -0.3, -1.0).normalized();
  FitParams params = kNear;
  params.gain = false;
  test::CaptureOptions options;
  options.scale = 8000.0;
  const ForwardModel model(scene, {.mesh = {}});
  FitState start = model.initial_state();
  start.gain.setConstant(8000.0);
  const SceneFit fit = fit_scene(model, test::simulated_capture(scene, options), start, params);
  const Uncertainty found = examine(model, fit, params, {.profile = false});
  ASSERT_TRUE(found.twin_light.has_value()) << found.twin_rise;
  EXPECT_NEAR(found.twin_light->y(), -fit.state.light_direction.y(), 1e-9);
  EXPECT_TRUE(found.find(kLightV)->determined);
}

TEST(Uncertainty, OnePlaneDeterminesNeitherLightNorW) {
  const Fitted plane(test::single_plane(kSmall), kNear);
  EXPECT_FALSE(plane.uncertainty.find(kLightU)->determined);
  EXPECT_FALSE(plane.uncertainty.find(kLightV)->determined);
  EXPECT_FALSE(plane.uncertainty.find(kW)->determined);
  EXPECT_NE(plane.sentences().find("w/w' changes nothing"), std::string::npos) << plane.sentences();
}

/// A ball of radius 20 mm in faces of 30 degrees, with the normals of the sphere.
scene::Scene ball() {
  scene::Scene scene = test::single_plane(kSmall);
  mesh::PatchMesh& mesh = scene.objects[0].patches;
  mesh = {};
  constexpr int kAround = 12;
  constexpr int kDown = 6;
  const auto normal = [](int i, int j) {
    const double polar = std::numbers::pi * j / kDown;
    const double bearing = 2.0 * std::numbers::pi * i / kAround;
    return Vector3d(std::sin(polar) * std::cos(bearing), std::sin(polar) * std::sin(bearing), std::cos(polar));
  };
  const auto at = [](int i, int j) { return j == 0 ? 0 : j == kDown ? 1 : 2 + (j - 1) * kAround + i % kAround; };
  mesh.points = {Vector3d(0, 0, 20), Vector3d(0, 0, -20)};
  for (int j = 1; j < kDown; ++j) {
    for (int i = 0; i < kAround; ++i) mesh.points.push_back(20.0 * normal(i, j));
  }
  const auto add = [&](int a, int b, int c) {
    mesh.faces.push_back({a, b, c, -1});
    const auto n = [&](int k) { return mesh.points[static_cast<std::size_t>(k)].normalized(); };
    mesh.corner_normals.push_back({n(a), n(b), n(c), n(c)});
  };
  for (int j = 0; j < kDown; ++j) {
    for (int i = 0; i < kAround; ++i) {
      if (j > 0) add(at(i, j), at(i, j + 1), at(i + 1, j));
      if (j + 1 < kDown) add(at(i + 1, j), at(i, j + 1), at(i + 1, j + 1));
    }
  }
  mesh.closed = true;
  return scene;
}

// Any turn about the centre looks the same under a light that turns along. The mesh's facets do show, and must not
// count. What is determined is the light as the camera sees it.
TEST(Uncertainty, ABallDeterminesTheLightInTheCamerasFrameAlone) {
  const Fitted sphere(ball(), {.focal = false, .blur = false, .staged = false, .most_iterations = 2});
  EXPECT_NE(sphere.sentences().find("a sphere about (0.0, 0.0, 0.0) mm"), std::string::npos) << sphere.sentences();
  for (const int parameter : {kLightU, kLightV, kTurnX, kTurnY, kTurnZ})
    EXPECT_FALSE(sphere.uncertainty.find(parameter)->determined) << sphere.uncertainty.find(parameter)->sd;
  EXPECT_TRUE(sphere.uncertainty.find(kShiftX)->determined) << sphere.uncertainty.find(kShiftX)->sd;
  // In the camera: turn × R l + R δl.
  const FitState& state = sphere.fit.state;
  const Vector3d seen = state.camera.rotation * state.light_direction;
  MatrixXd motion(3, 5);
  motion.leftCols(2) = state.camera.rotation * light_tangents(state.light_direction);
  for (int k = 0; k < 3; ++k) motion.col(2 + k) = Vector3d::Unit(k).cross(seen);
  const MatrixXd covariance = motion * sphere.uncertainty.covariance.topLeftCorner(5, 5) * motion.transpose();
  constexpr double kDegree = std::numbers::pi / 180.0;
  EXPECT_LT(std::sqrt(covariance.trace()), 1.0 * kDegree);
  EXPECT_GT(sphere.uncertainty.find(kLightU)->sd, 3.0 * kDegree);
}

// Seen from 20 times as far through a 20 times narrower field, distance and focal length are one.
TEST(Uncertainty, FromFarDistanceTradesWithFocalLength) {
  scene::Scene scene = test::half_cylinders(kSmall);
  scene.camera.position = 20.0 * (scene.camera.position - scene.camera.target) + scene.camera.target;
  scene.camera.horizontal_fov_deg /= 20.0;
  const Fitted far(scene, {.blur = false, .staged = false, .most_iterations = 2});
  EXPECT_FALSE(far.uncertainty.find(kShiftZ)->determined);
  EXPECT_FALSE(far.uncertainty.find(kFocal)->determined);
  const std::string all = far.sentences();
  EXPECT_TRUE(all.find("camera distance trades with focal length") != std::string::npos ||
              all.find("focal length (logarithm) trades with camera distance") != std::string::npos)
      << all;
  EXPECT_TRUE(far.uncertainty.find(kW)->determined);
}

// With one grey for both, every band says the same; the note says what is left to tell w from the gain.
TEST(Uncertainty, EqualGreysAreNamed) {
  scene::Scene scene = test::half_cylinders(kSmall);
  for (spectral::Material& material : scene.materials) material.donaldson.reflectance.setConstant(0.6);
  FitParams params = kNear;
  params.reflectance = true;
  const Fitted grey(scene, params);
  EXPECT_NE(grey.sentences().find("All reflectances are grey"), std::string::npos) << grey.sentences();
  const Fitted coloured(test::half_cylinders(kSmall), params);
  EXPECT_EQ(coloured.sentences().find("grey"), std::string::npos) << coloured.sentences();
}

// The capture is a picture on patches some four times as narrow, without noise: what the fit is off by is their width,
// and what is left of it after the extrapolation is of higher order.
TEST(Uncertainty, WhatThePatchesWidthMovedIsTakenOff) {
  const scene::Scene scene =
      test::half_cylinders({.around = 4, .along = 4, .bands = 3, .side_px = 16, .fluorescent = false});
  const ForwardParams wide{.mesh = FitMeshParams{.most_turn_deg = 20.0, .contact_halvings = 0}};
  const ForwardModel narrow(scene, {.mesh = FitMeshParams{.most_turn_deg = 5.0, .contact_halvings = 0}});
  const ForwardModel model(scene, wide);
  const ForwardModel coarse(scene, coarser(wide));
  const ForwardModel coarsest(scene, coarser(coarser(wide)));
  FitState truth = model.initial_state();
  truth.gain.setConstant(8000.0);
  Capture capture;
  capture.image = picture(narrow, truth, narrow.evaluate(truth, {}));
  capture.use.assign(16 * 16, 1);
  capture.value_per_count.assign(3, 1.0F);
  capture.noise = {1.5, 0.25, 1.0, 0.0};
  const SceneFit fit = fit_scene(model, capture, truth, kNear);
  const Uncertainty found = examine(model, fit, kNear, {.profile = false, .coarser = &coarse, .coarsest = &coarsest});
  const double before = fit.state.w - 1.0;
  const double after = found.state.w - 1.0;
  EXPECT_LT(std::abs(after), 0.5 * std::abs(before)) << before << " becomes " << after;
  EXPECT_EQ(found.find(kW)->value, found.state.w);
  EXPECT_NEAR(fit.state.w - found.state.w, found.find(kW)->mesh_shift, 1e-12);
  EXPECT_LT(std::abs(after), 1.96 * found.find(kW)->mesh_sd) << "of which " << found.find(kW)->mesh_shift;
}

TEST(Uncertainty, ADeterminedTriangleHasNoWeakDirectionAndTheRightVariance) {
  // sd = range / singular value for a diagonal triangle.
  const MatrixXd triangle = VectorXd(Eigen::Vector3d(100.0, 50.0, 1e-9)).asDiagonal();
  const Subspace space = split_directions(triangle, VectorXd::Ones(3), 10.0);
  ASSERT_EQ(space.strong.cols(), 2);
  EXPECT_NEAR(space.strength[0], 100.0, 1e-10);
  EXPECT_NEAR(std::abs(space.weak(2, 0)), 1.0, 1e-12);
}

}  // namespace
}  // namespace interglow::fitting
