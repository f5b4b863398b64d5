// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit_recovery.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "fit_captures.h"
#include "fitting/scene_fit.h"

namespace interglow::test {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

Recovery recover(const RecoveryParams& params) {
  constexpr double kDegree = std::numbers::pi / 180.0;
  constexpr double kW = 1.3;
  const auto scene_of = [&](const FitSceneParams& size) {
    return params.arch ? arch_on_plane(size) : half_cylinders(size);
  };
  FitSceneParams fine = params.scene;
  fine.around = params.truth_around;
  fine.along = params.truth_around / 2;
  scene::Scene captured = scene_of(fine);
  double sign = 1.0;
  for (spectral::Material& material : captured.materials) {
    if (params.reflectance == ReflectanceError::kOffset) material.donaldson.reflectance.array() += 0.02;
    if (params.reflectance == ReflectanceError::kScale) {
      material.donaldson.reflectance *= 1.0 + 0.02 * sign;
      material.donaldson.luminescence *= 1.0 + 0.02 * sign;
    }
    sign = -sign;
  }
  CaptureOptions options{.w = kW, .seed = params.seed};
  if (params.spoilt) {
    options.blur_px = 1.0;
    options.veil_share = 0.03;
    options.offset_share = 0.005;
    options.gain_spread = 0.1;
  }
  const fitting::Capture capture = traced_capture(captured, params.paths, options);

  const fitting::ForwardModel model(scene_of(params.scene), {});
  const fitting::FitState truth = model.initial_state();
  VectorXd step = VectorXd::Zero(fitting::shared_count(model.scene()));
  const double turn = params.start_deg * kDegree;
  step[fitting::kTurnX] = 0.6 * turn;
  step[fitting::kTurnY] = -0.5 * turn;
  step[fitting::kTurnZ] = 0.62 * turn;
  step[fitting::kShiftZ] = 0.01 * params.start_deg * truth.camera.pivot_in_camera.z();
  step[fitting::kLightU] = 0.7 * turn;
  step[fitting::kLightV] = -0.7 * turn;
  const fitting::SceneFit fit =
      fitting::fit_scene(model, capture, fitting::moved(truth, step),
                         {.reflectance = params.reflectance == ReflectanceError::kScale,
                          .reflectance_offset = params.reflectance == ReflectanceError::kOffset,
                          .staged = params.start_deg > 1.0});

  Recovery result;
  std::vector<Vector3d> points;
  for (const scene::Object& object : model.scene().objects)
    points.insert(points.end(), object.patches.points.begin(), object.patches.points.end());
  result.reprojection_px = fitting::reprojection_rms_px(fit.state.camera, truth.camera, points);
  result.fov_share = fit.state.camera.horizontal_fov_deg() / truth.camera.horizontal_fov_deg() - 1.0;
  const Vector3d& found = fit.state.light_direction;
  const Vector3d& light = truth.light_direction;
  result.light_deg = std::atan2(found.cross(light).norm(), found.dot(light)) / kDegree;
  result.light_across_deg = (std::atan2(found.x(), -found.z()) - std::atan2(light.x(), -light.z())) / kDegree;
  result.w_share = fit.state.w / kW - 1.0;
  result.chi_square = fit.chi_square;
  result.converged = fit.converged;
  const auto count = static_cast<Index>(fit.free.size());
  const MatrixXd triangle = fit.compressed.shared_triangle.topLeftCorner(count, count);
  const MatrixXd covariance = (triangle.transpose() * triangle).completeOrthogonalDecomposition().pseudoInverse();
  for (Index k = 0; k < count; ++k) {
    const double sd = std::sqrt(std::max(covariance(k, k), 0.0));
    if (fit.free[static_cast<std::size_t>(k)] == fitting::kFocal) result.fov_sd = sd;
    if (fit.free[static_cast<std::size_t>(k)] == fitting::kW) result.w_sd = sd / fit.state.w;
  }
  return result;
}

}  // namespace interglow::test
