// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/uncertainty.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
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
      : model(scene, {}),
        params(with),
        fit(fit_scene(model, test::simulated_capture(scene, options), model.initial_state(), with)),
        uncertainty(examine(model, fit, with, {.profile = false})) {}

  std::string sentences() const {
    std::string all;
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
  const ForwardModel model(scene, {});
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
