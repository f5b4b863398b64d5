// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit_study.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <random>

namespace interglow::test {
namespace {

using Eigen::Index;
using Eigen::Vector3d;
using Eigen::VectorXd;
using fitting::FitState;
using fitting::ForwardModel;

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kCounts = 3500.0;  ///< of the brightest value

/// What the captures are simulated with.
std::unique_ptr<ForwardModel> finer_model(const StudyParams& params) {
  FitSceneParams fine = params.scene;
  fine.around = params.captured_around;
  fine.along = params.scene.along + 1;
  fitting::FitMeshParams mesh = params.mesh;
  mesh.most_turn_deg *= 0.5;
  mesh.contact_halvings += 1;
  mesh.most_faces = 100000;
  return std::make_unique<ForwardModel>(half_cylinders(fine), fitting::ForwardParams{.mesh = mesh});
}

/// What a 12-bit camera makes of the model's picture.
fitting::Capture captured(const ForwardModel& model, const FitState& state, std::mt19937_64& random) {
  fitting::Capture capture;
  capture.image = fitting::picture(model, state, model.evaluate(state, {}));
  capture.use.assign(static_cast<std::size_t>(state.camera.width) * static_cast<std::size_t>(state.camera.height), 1);
  capture.value_per_count.assign(static_cast<std::size_t>(capture.image.bands()), 1.0F);
  capture.noise = {1.5, 0.25, 1.0, 0.0};
  std::normal_distribution<double> normal;
  for (float& value : capture.image.value) {
    const double counts = static_cast<double>(value);
    value =
        static_cast<float>(std::round(counts + std::sqrt(1.5 * 1.5 + 0.25 * std::max(counts, 0.0)) * normal(random)));
  }
  return capture;
}

/// Gains that bring the brightest value to a 12-bit camera's range.
void expose(const ForwardModel& model, FitState& state) {
  const image::SpectralImage picture = fitting::picture(model, state, model.evaluate(state, {}));
  state.gain.setConstant(kCounts / static_cast<double>(*std::max_element(picture.value.begin(), picture.value.end())));
}

VectorXd no_step(const FitState& state) { return VectorXd::Zero(fitting::kFirstScale + 2 * state.scale.size()); }

Vector3d random_direction(std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  Vector3d axis;
  for (double& x : axis) x = normal(random);
  return axis.normalized();
}

/// Truth minus estimate, along the estimate's own parameters.
VectorXd error_of(const FitState& truth, const FitState& found) {
  VectorXd error = no_step(found);
  const Eigen::Matrix<double, 3, 2> tangents = fitting::light_tangents(found.light_direction);
  error.segment<2>(fitting::kLightU) = tangents.transpose() * (truth.light_direction - found.light_direction);
  const Eigen::AngleAxisd turn(truth.camera.rotation * found.camera.rotation.transpose());
  error.segment<3>(fitting::kTurnX) = turn.angle() * turn.axis();
  for (int parameter = fitting::kShiftX; parameter < fitting::kFirstScale; ++parameter)
    error[parameter] = fitting::value_of(truth, parameter) - fitting::value_of(found, parameter);
  return error;
}

}  // namespace

StartStudy study_starts(const StudyParams& params, int starts, double turn_deg, double distance_share,
                        double light_deg) {
  const ForwardModel model(half_cylinders(params.scene), {.mesh = params.mesh});
  std::mt19937_64 random(params.seed);
  FitState truth = model.initial_state();
  truth.blur_px = 0.7;
  truth.w = 1.2;
  expose(model, truth);
  const fitting::Capture capture = captured(*finer_model(params), truth, random);
  fitting::FitParams near;
  near.staged = false;
  const fitting::SceneFit best = fitting::fit_scene(model, capture, truth, near);
  const ForwardModel coarse(half_cylinders(params.scene), fitting::coarser({.mesh = params.mesh}));
  fitting::FitParams far;
  far.small_pictures = &coarse;
  StartStudy study;
  for (; study.tried < starts; ++study.tried) {
    VectorXd step = no_step(truth);
    step.segment<3>(fitting::kTurnX) = turn_deg * kDegree * random_direction(random);
    step[fitting::kShiftZ] = (random() % 2 == 0 ? 1.0 : -1.0) * distance_share * truth.camera.pivot_in_camera.z();
    const double bearing = 2.0 * std::numbers::pi * std::generate_canonical<double, 53>(random);
    step[fitting::kLightU] = light_deg * kDegree * std::cos(bearing);
    step[fitting::kLightV] = light_deg * kDegree * std::sin(bearing);
    step[fitting::kW] = 1.0 - truth.w;
    FitState start = fitting::moved(truth, step);
    start.blur_px = 0.0;
    start.gain.setOnes();
    const fitting::SceneFit fit = fitting::fit_scene(model, capture, start, far);
    const double excess = (fit.cost - best.cost) * static_cast<double>(fit.residuals) / std::max(1.0, best.chi_square);
    const bool reached = excess < 1.0;
    study.reached += reached ? 1 : 0;
    if (params.report) {
      std::string line = fmt::format("start {}: {} (cost above the best {:.2f}, w {:.4f});", study.tried,
                                     reached ? "arrived" : "LOST", excess, fit.state.w);
      for (const fitting::FitStage& stage : fit.stages)
        line += fmt::format(" {} {} × {}: {:.3g},", stage.name, stage.width, stage.iterations, stage.cost);
      params.report(line);
    }
  }
  return study;
}

std::vector<Covered> study_intervals(const StudyParams& params, int captures) {
  const ForwardModel model(half_cylinders(params.scene), {.mesh = params.mesh});
  const ForwardModel coarse(half_cylinders(params.scene), fitting::coarser({.mesh = params.mesh}));
  const auto fine = finer_model(params);
  std::mt19937_64 random(params.seed);
  const auto between = [&](double low, double high) {
    return low + (high - low) * std::generate_canonical<double, 53>(random);
  };
  fitting::FitParams near;
  near.staged = false;
  std::vector<Covered> result;
  for (int n = 0; n < captures; ++n) {
    VectorXd step = no_step(model.initial_state());
    step[fitting::kLightU] = between(-0.3, 0.3);
    step[fitting::kLightV] = between(-0.3, 0.3);
    step.segment<3>(fitting::kTurnX) = between(0.0, 0.15) * random_direction(random);
    step[fitting::kShiftZ] = between(-15.0, 15.0);
    step[fitting::kFocal] = between(-0.03, 0.03);
    step[fitting::kBlur] = between(0.5, 1.0);
    step[fitting::kW] = between(-0.2, 0.5);
    FitState truth = fitting::moved(model.initial_state(), step);
    expose(model, truth);
    for (double& gain : truth.gain) gain *= between(0.8, 1.0);
    for (double& offset : truth.offset) offset = between(0.0, 0.005) * kCounts;
    const fitting::Capture capture = captured(*fine, truth, random);

    VectorXd away = no_step(truth);
    away.segment<3>(fitting::kTurnX) = 0.5 * kDegree * random_direction(random);
    away.segment<2>(fitting::kLightU).setConstant(between(-1.0, 1.0) * kDegree);
    away[fitting::kShiftZ] = between(-2.0, 2.0);
    away[fitting::kW] = between(-0.1, 0.1);
    const fitting::SceneFit fit = fitting::fit_scene(model, capture, fitting::moved(truth, away), near);
    const fitting::Uncertainty found = fitting::examine(model, fit, near, {.profile = false, .coarser = &coarse});
    const VectorXd error = error_of(truth, fit.state);
    std::string line = fmt::format("capture {}: χ² {:.3f}, {} iterations ({}), error / deviation", n, fit.chi_square,
                                   fit.stages.back().iterations, fit.stages.back().end);
    for (std::size_t k = 0; k < found.parameters.size(); ++k) {
      const fitting::ParameterEstimate& one = found.parameters[k];
      if (result.size() <= k) result.push_back({one.name, 0, 0, 0.0});
      const bool light = one.parameter <= fitting::kLightV;  // names of tilts move with the light
      if (light) result[k].name = one.parameter == fitting::kLightU ? "light, across" : "light, along";
      if (!one.determined) {
        line += " -";
        continue;
      }
      const double z = error[one.parameter] / one.sd;
      ++result[k].determined;
      result[k].covered += std::abs(z) <= 1.959964 ? 1 : 0;
      result[k].z_square += z * z;
      line += fmt::format(" {:.2f} ({:.1f})", z, one.mesh_shift / one.sd);
    }
    if (params.report) params.report(line);
  }
  return result;
}

}  // namespace interglow::test
