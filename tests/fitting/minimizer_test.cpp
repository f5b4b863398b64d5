// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/minimizer.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <atomic>
#include <cmath>

#include "diagnostics/error.h"
#include "fit_captures.h"
#include "fit_scenes.h"
#include "fitting/photometric_residuals.h"
#include "fitting/scene_fit.h"

namespace interglow::fitting {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

const std::vector<int> kAll{kLightU, kLightV, kTurnX, kTurnY,      kTurnZ,      kShiftX,     kShiftY,
                            kShiftZ, kFocal,  kBlur,  kPrincipalX, kPrincipalY, kDistortion, kW};

FitState some_state() {
  FitState state;
  state.light_direction = Vector3d(0.3, -0.4, -0.8).normalized();
  state.camera.rotation = Eigen::AngleAxisd(2.0, Vector3d(1.0, 2.0, -0.5).normalized()).toRotationMatrix();
  state.camera.pivot_in_camera = {3.0, -2.0, 300.0};
  state.camera.focal_px = 150.0;
  state.camera.width = 48;
  state.camera.height = 48;
  state.blur_px = 1.0;
  state.w = 1.3;
  return state;
}

/// Everything that a state holds, as numbers on which a cost can be built: each in some plausible ranges.
VectorXd numbers(const FitState& state) {
  VectorXd all(20);
  all << 10.0 * state.light_direction, 10.0 * state.camera.rotation.reshaped(), state.camera.pivot_in_camera / 30.0,
      10.0 * std::log(state.camera.focal_px), state.camera.principal_px / 5.0, state.camera.distortion, state.w;
  return all;
}

/// Least squares whose minimum is a given state, with derivatives along `moved`: what Ceres is handed must follow the
/// same conventions of turns and tilts, or it does not arrive.
Linearise towards(const FitState& truth, const std::vector<int>& free) {
  return [&truth, &free](FitState& state, bool with_derivatives) {
    const VectorXd residual = numbers(truth) - numbers(state);
    Linearisation result;
    result.cost = residual.squaredNorm();
    if (!with_derivatives) return result;
    MatrixXd rows(residual.size(), static_cast<Index>(free.size()) + 1);
    for (std::size_t k = 0; k < free.size(); ++k) {
      VectorXd step = VectorXd::Zero(kFirstScale);
      step[free[k]] = 1e-5;
      rows.col(static_cast<Index>(k)) = (numbers(moved(state, step)) - numbers(moved(state, -step))) / 2e-5;
    }
    rows.rightCols(1) = residual;
    TileQr qr(rows.cols());
    qr.add(rows);
    result.triangle = qr.triangle();
    return result;
  };
}

TEST(Minimizer, ArrivesAtAKnownStateOnSphereAndQuaternions) {
  const FitState truth = some_state();
  VectorXd step = VectorXd::Zero(kFirstScale);
  step.head(10) << 0.3, -0.2, 0.4, -0.5, 0.3, 4.0, -5.0, 20.0, 0.1, 2.0;
  step[kPrincipalY] = -3.0;
  step[kDistortion] = 0.05;
  step[kW] = -0.6;
  const std::vector<int> free{kLightU, kLightV, kTurnX,      kTurnY,      kTurnZ,      kShiftX, kShiftY,
                              kShiftZ, kFocal,  kPrincipalX, kPrincipalY, kDistortion, kW};
  FitState state = moved(truth, step);
  const FitStage stage =
      minimize(state, free, towards(truth, free), {.name = "test", .most_iterations = 50, .tolerance = 1e-20});
  EXPECT_LT((numbers(state) - numbers(truth)).norm(), 1e-6) << stage.end;
  EXPECT_NEAR(state.light_direction.norm(), 1.0, 1e-14);
  EXPECT_LT(stage.iterations, 15) << "a Gauss-Newton search with right derivatives is quick";
}

TEST(Minimizer, StaysWithinBounds) {
  // The best w is below 0, where no picture exists.
  FitState truth = some_state();
  truth.w = -0.5;
  const std::vector<int> free{kW};
  FitState state = some_state();
  minimize(state, free, towards(truth, free), {.name = "test", .most_iterations = 50, .tolerance = 1e-20});
  EXPECT_GT(state.w, 0.0);
  EXPECT_LT(state.w, 0.01);
}

TEST(Minimizer, WhatTheDataLeaveOpenStaysWhereItWas) {
  // The cost knows only the light; turns and w are believed to be at the start.
  const FitState truth = some_state();
  const std::vector<int> free{kLightU, kLightV, kTurnX, kTurnY, kTurnZ, kW};
  const FitState start = moved(truth, (VectorXd(kFirstScale) << 0.1, 0.1, VectorXd::Zero(kFirstScale - 2)).finished());
  const Linearise only_light = [&](FitState& state, bool with_derivatives) {
    Linearisation result;
    const Vector3d residual = 1e4 * (truth.light_direction - state.light_direction);
    result.cost = residual.squaredNorm();
    if (!with_derivatives) return result;
    MatrixXd rows = MatrixXd::Zero(3, 7);
    rows.leftCols(2) = 1e4 * light_tangents(state.light_direction);
    rows.col(6) = residual;
    TileQr qr(7);
    qr.add(rows);
    result.triangle = qr.triangle();
    return result;
  };
  FitState state = start;
  minimize(state, free, only_light, {.name = "test", .most_iterations = 50, .tolerance = 1e-16, .believed = start});
  EXPECT_LT((state.light_direction - truth.light_direction).norm(), 1e-6);
  EXPECT_LT((state.camera.rotation - start.camera.rotation).norm(), 1e-9);
  EXPECT_NEAR(state.w, start.w, 1e-12);
}

TEST(Minimizer, StopsWhenAskedTo) {
  const FitState truth = some_state();
  FitState state = moved(truth, (VectorXd(kFirstScale) << 0.3, 0.2, VectorXd::Zero(kFirstScale - 2)).finished());
  const std::vector<int> free{kLightU, kLightV};
  std::atomic<int> asked{0};
  const Progress stop{.report = {}, .cancelled = [&] { return ++asked > 1; }};
  EXPECT_THROW(minimize(state, free, towards(truth, free), {.name = "test", .most_iterations = 50}, stop), Cancelled);
}

TEST(Minimizer, SaysWhatIsWrongWithAStartThatCannotBe) {
  FitState state = some_state();
  const Linearise refuses = [](FitState&, bool) -> Linearisation { throw InvalidParams("no objects in sight"); };
  EXPECT_THROW(minimize(state, {kLightU, kLightV}, refuses, {.name = "test", .most_iterations = 5}), InvalidParams);
}

/// The gradient that Ceres sees, -2 Jᵀ r of the triangle, against Richardson differences of the robust cost with gains
/// and offsets refitted: checks derivatives, weights, elimination and compression together.
TEST(PhotometricResiduals, GradientIsThatOfTheRobustCost) {
  const test::FitSceneParams size{.around = 8, .along = 4, .bands = 3, .side_px = 24, .fluorescent = false};
  const ForwardModel model(test::half_cylinders(size), {.mesh = std::nullopt});
  // 1 sigma as Huber's limit: a third of the residuals count linearly.
  const FitParams params{.huber_sigmas = 1.0};
  const Capture capture = test::simulated_capture(test::half_cylinders(size), {.blur_px = 1.0});
  const FitData data = fit_data(capture, params);
  FitState state = model.initial_state();
  state.blur_px = 0.8;
  state.w = 1.05;
  state.light_direction = (state.light_direction + Vector3d(0.02, -0.01, 0.0)).normalized();
  const auto cost_at = [&](const VectorXd& step) {
    FitState there = moved(state, step);
    return fit_bands(model, data, model.evaluate(there, {}), params, there);
  };
  const Evaluation here = model.evaluate(state, kAll);
  const double cost = fit_bands(model, data, here, params, state);
  const CompressedAt at = compress(model, data, state, here, kAll, params);
  EXPECT_NEAR(at.cost / cost, 1.0, 1e-8);  // gains still move by a thousandth of their deviation
  EXPECT_GT(at.robust_share, 0.2);
  const auto count = static_cast<Index>(kAll.size());
  const VectorXd gradient =
      -2.0 * at.all.shared_triangle.leftCols(count).transpose() * at.all.shared_triangle.col(count);
  VectorXd numeric(count);
  const VectorXd ranges = plausible_ranges(state, kAll);
  for (Index k = 0; k < count; ++k) {
    VectorXd step = VectorXd::Zero(shared_count(model.scene()));
    const auto difference = [&](double h) {
      step[kAll[static_cast<std::size_t>(k)]] = h;
      return (cost_at(step) - cost_at(-step)) / (2.0 * h);
    };
    const double h = 2e-3 * ranges[k];
    numeric[k] = (4.0 * difference(0.5 * h) - difference(h)) / 3.0;
  }
  const VectorXd ours = gradient.cwiseProduct(ranges);
  const VectorXd theirs = numeric.cwiseProduct(ranges);
  EXPECT_GE(ours.dot(theirs) / (ours.norm() * theirs.norm()), 0.9999) << ours.transpose() << "\n" << theirs.transpose();
  EXPECT_NEAR(ours.norm() / theirs.norm(), 1.0, 1e-2);
}

}  // namespace
}  // namespace interglow::fitting
