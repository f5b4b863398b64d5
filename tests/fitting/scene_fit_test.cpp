// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/scene_fit.h"

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <Eigen/Dense>
#include <cmath>
#include <numbers>
#include <random>

#include "diagnostics/error.h"
#include "fit_captures.h"
#include "fit_scenes.h"

namespace interglow::fitting {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

double angle_deg(const Vector3d& a, const Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180.0 / std::numbers::pi;
}

/// The state turned and moved away from the truth by this much.
FitState away(const FitState& truth, double turn_deg, double distance_share, double light_deg) {
  VectorXd step = VectorXd::Zero(kFirstScale + 2 * truth.scale.size());
  const double turn = turn_deg * std::numbers::pi / 180.0;
  step[kTurnX] = 0.6 * turn;
  step[kTurnY] = -0.5 * turn;
  step[kTurnZ] = 0.62 * turn;
  step[kShiftZ] = distance_share * truth.camera.pivot_in_camera.z();
  step[kLightU] = 0.7 * light_deg * std::numbers::pi / 180.0;
  step[kLightV] = -0.7 * light_deg * std::numbers::pi / 180.0;
  return moved(truth, step);
}

TEST(TileQr, CompressesExactly) {
  // The solution and residual norm of the whole from the triangle of tiles, against a QR of the whole.
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  MatrixXd whole = MatrixXd::NullaryExpr(1000, 6, [&] { return normal(random); });
  TileQr tiles(6);
  for (int first = 0; first < 1000; first += 37) tiles.add(whole.middleRows(first, std::min(37, 1000 - first)));
  const VectorXd truth = whole.leftCols(5).householderQr().solve(whole.col(5));
  const VectorXd ours =
      tiles.triangle().topLeftCorner(5, 5).triangularView<Eigen::Upper>().solve(tiles.triangle().col(5).head(5));
  EXPECT_LT((ours - truth).norm(), 1e-12);
  EXPECT_NEAR(std::abs(tiles.triangle()(5, 5)), (whole.col(5) - whole.leftCols(5) * truth).norm(), 1e-10);
}

TEST(CompressedBands, EliminatesTheBandsOwnParameters) {
  // Two bands, one own column each, two shared: against one dense system with all four parameters.
  std::mt19937 random(8);
  std::normal_distribution<double> normal;
  MatrixXd dense = MatrixXd::Zero(60, 5);
  std::vector<MatrixXd> triangles;
  for (int b = 0; b < 2; ++b) {
    const MatrixXd rows = MatrixXd::NullaryExpr(30, 4, [&] { return normal(random); });
    TileQr qr(4);
    qr.add(rows);
    triangles.push_back(qr.triangle());
    dense.block(30 * b, b, 30, 1) = rows.col(0);
    dense.block(30 * b, 2, 30, 3) = rows.rightCols(3);
  }
  const VectorXd truth = dense.leftCols(4).householderQr().solve(dense.col(4));
  const CompressedBands bands = join_bands(triangles, 1, 2);
  const VectorXd shared = bands.shared_triangle.topLeftCorner(2, 2).triangularView<Eigen::Upper>().solve(
      bands.shared_triangle.col(2).head(2));
  EXPECT_LT((shared - truth.tail(2)).norm(), 1e-12);
  for (std::size_t b = 0; b < 2; ++b)
    EXPECT_NEAR(bands.own_step(b, shared)[0], truth[static_cast<Eigen::Index>(b)], 1e-12);
}

TEST(SceneFit, FindsTheStateThatAPictureWasMadeWith) {
  // The model's own picture without noise: the optimum is exactly known, and its cost is 0. The gain is held, as light
  // along parallel cylinders trades with it.
  const ForwardModel model(
      test::half_cylinders({.around = 6, .along = 3, .bands = 2, .side_px = 24, .fluorescent = false}),
      {.mesh = std::nullopt});
  FitState truth = model.initial_state();
  truth.w = 1.2;
  truth.gain.setConstant(8000.0);
  Capture capture;
  capture.image = picture(model, truth, model.evaluate(truth, {}));
  capture.use.assign(24 * 24, 1);
  capture.value_per_count.assign(2, 1.0F);
  FitState start = away(truth, 0.5, 0.005, 2.0);
  start.w = 1.0;
  const SceneFit fit = fit_scene(model, capture, start, {.blur = false, .gain = false, .staged = false});
  EXPECT_TRUE(fit.converged) << fit.stages.back().end;
  EXPECT_LT(fit.chi_square, 1e-4);
  EXPECT_LT(reprojection_rms_px(fit.state.camera, truth.camera, model.scene().objects[0].patches.points), 1e-2);
  EXPECT_LT(angle_deg(fit.state.light_direction, truth.light_direction), 0.05);
  EXPECT_NEAR(fit.state.w, 1.2, 1e-3);
}

TEST(SceneFit, HasTheSameBitsOnOneAndOnTwoThreads) {
  const scene::Scene scene =
      test::half_cylinders({.around = 4, .along = 2, .bands = 2, .side_px = 12, .fluorescent = false});
  const Capture capture = test::simulated_capture(scene, {});
  const auto fitted = [&](int threads) {
    SceneFit fit;
    tbb::task_arena(threads).execute([&] {
      const ForwardModel model(scene, {.mesh = std::nullopt});
      fit = fit_scene(model, capture, away(model.initial_state(), 0.5, 0.005, 1.0), {.most_iterations = 3});
    });
    return fit;
  };
  const SceneFit one = fitted(1);
  const SceneFit two = fitted(2);
  EXPECT_EQ(one.cost, two.cost);
  EXPECT_EQ(one.state.w, two.state.w);
  EXPECT_EQ(one.state.light_direction, two.state.light_direction);
  EXPECT_EQ(one.state.camera.rotation, two.state.camera.rotation);
  EXPECT_EQ(one.state.gain, two.state.gain);
  EXPECT_EQ(one.score_scatter, two.score_scatter);
}

TEST(SceneFit, CapturesOfAnotherSizeOrOtherBandsAreRefused) {
  const ForwardModel model(test::half_cylinders({.around = 6, .along = 3, .bands = 4, .side_px = 12}),
                           {.mesh = std::nullopt});
  const auto message = [&](int bands, int side) -> std::string {
    const Capture capture =
        test::simulated_capture(test::half_cylinders({.around = 6, .along = 3, .bands = bands, .side_px = side}), {});
    try {
      fit_scene(model, capture, model.initial_state(), {});
    } catch (const InvalidInput& error) {
      return error.what();
    }
    return {};
  };
  EXPECT_NE(message(4, 16).find("16 × 16"), std::string::npos) << message(4, 16);
  EXPECT_NE(message(5, 12).find("5 bands"), std::string::npos) << message(5, 12);
}

}  // namespace
}  // namespace interglow::fitting
