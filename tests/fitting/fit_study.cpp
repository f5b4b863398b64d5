// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit_study.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <random>

#include "traced_light.h"

namespace interglow::test {
namespace {

using Eigen::Index;
using Eigen::Vector3d;
using Eigen::VectorXd;
using fitting::FitState;
using fitting::ForwardModel;

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kCounts = 3500.0;  ///< of the brightest value
constexpr double kReadCounts = 1.5;
constexpr double kShotGain = 0.25;
constexpr int kParts = 8;  ///< of a traced picture
/// About which poses turn, whatever the model's mesh [mm].
const Vector3d kPivot(0.0, 0.0, 5.0);

scene::Scene scene_of(const StudyParams& params, const FitSceneParams& size) {
  return params.arch ? arch_on_plane(size) : half_cylinders(size);
}

/// What the captures are simulated with.
std::unique_ptr<ForwardModel> finer_model(const StudyParams& params) {
  FitSceneParams fine = params.scene;
  fine.around = params.captured_around;
  fine.along = params.scene.along + 1;
  fitting::FitMeshParams mesh = params.mesh;
  mesh.most_turn_deg *= 0.5;
  mesh.contact_halvings += 1;
  mesh.most_faces = 100000;
  return std::make_unique<ForwardModel>(scene_of(params, fine), fitting::ForwardParams{.mesh = mesh});
}

/// Mean counts of every value, pixels x bands, and how far they are uncertain.
struct Picture {
  radiosity::RowMatrix counts, variance;
};

/// What a 12-bit camera makes of it: its noise, less what the picture has already.
fitting::Capture captured(const ForwardModel& model, const FitState& state, const Picture& picture,
                          std::mt19937_64& random) {
  fitting::Capture capture;
  const Index bands = picture.counts.cols();
  capture.image.width = state.camera.width;
  capture.image.height = state.camera.height;
  capture.image.wavelength_nm = model.spectra().wavelength_nm;
  capture.use.assign(static_cast<std::size_t>(picture.counts.rows()), 1);
  capture.value_per_count.assign(static_cast<std::size_t>(bands), 1.0F);
  capture.noise = {kReadCounts, kShotGain, 1.0, 0.0};
  std::normal_distribution<double> normal;
  for (Index p = 0; p < picture.counts.rows(); ++p) {
    for (Index b = 0; b < bands; ++b) {
      const double counts = picture.counts(p, b);
      const double variance = kReadCounts * kReadCounts + kShotGain * std::max(counts, 0.0) - picture.variance(p, b);
      capture.image.value.push_back(
          static_cast<float>(std::round(counts + std::sqrt(std::max(0.0, variance)) * normal(random))));
    }
  }
  return capture;
}

Picture simulated(const ForwardModel& model, const FitState& state) {
  const radiosity::RowMatrix radiance = model.evaluate(state, {}).channels * model.palette();
  Picture picture;
  picture.counts = (radiance * state.gain.asDiagonal()).rowwise() + state.offset.transpose();
  picture.variance.setZero(picture.counts.rows(), picture.counts.cols());
  return picture;
}

/// Gains that bring the brightest value to a 12-bit camera's range.
void expose(const ForwardModel& model, FitState& state) {
  state.gain.setConstant(kCounts / (model.evaluate(state, {}).channels * model.palette()).maxCoeff());
}

/// Traced picture of capture `n` under the truth's light, from its camera.
Picture traced(const StudyParams& params, int n, scene::Scene& scene, const FitState& truth) {
  scene.directional_lights[0].direction = truth.light_direction;
  scene.camera = fitting::pinhole_camera(truth.camera, scene.camera);
  TracedLight light;
  const std::uint64_t seed = 100003 * params.seed + static_cast<std::uint64_t>(n);
  const Vector3d& light_at = truth.light_direction;
  const Vector3d& eye = scene.camera.position;
  const Vector3d& target = scene.camera.target;
  const auto view = fmt::format("{} {} {} {} {} {} {} {} {} {}", light_at.x(), light_at.y(), light_at.z(), eye.x(),
                                eye.y(), eye.z(), target.x(), target.y(), target.z(), scene.camera.horizontal_fov_deg);
  const auto file = fmt::format("{}_{}px_{}bands_{}paths_{}around_{}_{:x}.bin", params.arch ? "arch" : "cylinders",
                                params.scene.side_px, params.scene.bands, params.paths, params.traced_around, seed,
                                std::hash<std::string>{}(view));
  if (params.keep) {
    light = read_traced_light(*params.keep / file, kParts, truth.camera.width * truth.camera.height, truth.gain.size());
  }
  if (light.parts() == 0) {
    light = trace_light(scene, kParts, params.paths, seed);
    if (params.keep) write_traced_light(*params.keep / file, light);
  }
  Picture picture;
  picture.counts.setZero(light.direct[0].rows(), light.direct[0].cols());
  radiosity::RowMatrix square = picture.counts;
  for (int k = 0; k < light.parts(); ++k) {
    const auto part = static_cast<std::size_t>(k);
    const radiosity::RowMatrix seen = fitting::blurred(light.direct[part] + truth.w * light.indirect[part],
                                                       truth.camera.width, truth.camera.height, truth.blur_px) *
                                      truth.gain.asDiagonal();
    picture.counts += seen / light.parts();
    square += seen.cwiseAbs2() / light.parts();
  }
  picture.variance = (square - picture.counts.cwiseAbs2()).cwiseMax(0.0) / (light.parts() - 1);
  picture.counts.rowwise() += truth.offset.transpose();
  return picture;
}

VectorXd no_step(const FitState& state) { return VectorXd::Zero(fitting::kFirstScale + 2 * state.scale.size()); }

Vector3d random_direction(std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  Vector3d axis;
  for (double& x : axis) x = normal(random);
  return axis.normalized();
}

/// Estimate minus truth, along the estimate's own parameters.
VectorXd error_of(const FitState& truth, const FitState& found) {
  VectorXd error = no_step(found);
  const Eigen::Matrix<double, 3, 2> tangents = fitting::light_tangents(found.light_direction);
  error.segment<2>(fitting::kLightU) = tangents.transpose() * (found.light_direction - truth.light_direction);
  const Eigen::AngleAxisd turn(found.camera.rotation * truth.camera.rotation.transpose());
  error.segment<3>(fitting::kTurnX) = turn.angle() * turn.axis();
  for (int parameter = fitting::kShiftX; parameter < fitting::kFirstScale; ++parameter)
    error[parameter] = fitting::value_of(found, parameter) - fitting::value_of(truth, parameter);
  return error;
}

}  // namespace

StartStudy study_starts(const StudyParams& params, int starts, double turn_deg, double distance_share,
                        double light_deg) {
  const ForwardModel model(scene_of(params, params.scene), {.mesh = params.mesh});
  std::mt19937_64 random(params.seed);
  FitState truth = model.initial_state();
  truth.blur_px = 0.7;
  truth.w = 1.2;
  expose(model, truth);
  const auto fine = finer_model(params);
  const fitting::Capture capture = captured(*fine, truth, simulated(*fine, truth), random);
  fitting::FitParams near;
  near.staged = false;
  const fitting::SceneFit best = fitting::fit_scene(model, capture, truth, near);
  const ForwardModel coarse(scene_of(params, params.scene), fitting::coarser({.mesh = params.mesh}));
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

IntervalStudy study_intervals(const StudyParams& params, int first, int captures) {
  const ForwardModel model(scene_of(params, params.scene), {.mesh = params.mesh});
  const ForwardModel coarse(scene_of(params, params.scene), fitting::coarser({.mesh = params.mesh}));
  const ForwardModel coarsest(scene_of(params, params.scene),
                              fitting::coarser(fitting::coarser({.mesh = params.mesh})));
  const bool trace = params.paths > 0;
  const auto fine = trace ? nullptr : finer_model(params);
  FitSceneParams size = params.scene;
  size.around = params.traced_around;
  size.along = params.traced_around / 2;
  scene::Scene traced_scene = trace ? scene_of(params, size) : scene::Scene{};
  IntervalStudy study;
  std::vector<Covered>& result = study.parameters;
  fitting::FitParams near;
  near.staged = false;
  for (int n = first; n < first + captures; ++n) {
    std::seed_seq seeds{params.seed, static_cast<std::uint64_t>(n)};
    std::mt19937_64 random(seeds);
    const auto between = [&](double low, double high) {
      return low + (high - low) * std::generate_canonical<double, 53>(random);
    };
    FitState middle = model.initial_state();
    middle.camera = fitting::lens_camera(model.scene().camera, kPivot);
    VectorXd step = no_step(middle);
    step[fitting::kLightU] = between(-0.3, 0.3);
    step[fitting::kLightV] = between(-0.3, 0.3);
    step.segment<3>(fitting::kTurnX) = between(0.0, 0.15) * random_direction(random);
    step[fitting::kShiftZ] = between(-15.0, 15.0);
    step[fitting::kFocal] = between(-0.03, 0.03);
    step[fitting::kBlur] = between(0.5, 1.0);
    step[fitting::kW] = between(-0.2, 0.5);
    FitState truth = fitting::moved(middle, step);
    expose(model, truth);
    for (double& gain : truth.gain) gain *= between(0.8, 1.0);
    for (double& offset : truth.offset) offset = between(0.0, 0.005) * kCounts;
    const Picture picture = trace ? traced(params, n, traced_scene, truth) : simulated(*fine, truth);
    const fitting::Capture capture = captured(model, truth, picture, random);
    const radiosity::RowMatrix camera_variance =
        kReadCounts * kReadCounts + kShotGain * picture.counts.array().max(0.0);
    study.tracer_share += picture.variance.cwiseQuotient(camera_variance).mean() / captures;
    study.too_noisy += (picture.variance.array() > camera_variance.array()).cast<double>().mean() / captures;

    VectorXd away = no_step(truth);
    away.segment<3>(fitting::kTurnX) = 0.5 * kDegree * random_direction(random);
    away.segment<2>(fitting::kLightU).setConstant(between(-1.0, 1.0) * kDegree);
    away[fitting::kShiftZ] = between(-2.0, 2.0);
    away[fitting::kW] = between(-0.1, 0.1);
    const fitting::SceneFit fit = fitting::fit_scene(model, capture, fitting::moved(truth, away), near);
    const fitting::Uncertainty found =
        fitting::examine(model, fit, near, {.profile = false, .coarser = &coarse, .coarsest = &coarsest});
    const VectorXd error = error_of(truth, found.state);
    std::string line = fmt::format("capture {}: χ² {:.3f}, {} iterations ({}), error / deviation", n, fit.chi_square,
                                   fit.stages.back().iterations, fit.stages.back().end);
    for (std::size_t k = 0; k < found.parameters.size(); ++k) {
      const fitting::ParameterEstimate& one = found.parameters[k];
      if (result.size() <= k) result.push_back({.name = one.name});
      const bool light = one.parameter <= fitting::kLightV;  // names of tilts move with the light
      if (light) result[k].name = one.parameter == fitting::kLightU ? "light, across" : "light, along";
      if (!one.determined) {
        line += " -";
        continue;
      }
      const double z = error[one.parameter] / one.sd;
      ++result[k].determined;
      result[k].covered += std::abs(z) <= 1.959964 ? 1 : 0;
      result[k].z_sum += z;
      result[k].error_sum += error[one.parameter];
      result[k].sd_sum += one.sd;
      result[k].z_square += z * z;
      line += fmt::format(" {:.2f} ({:.2f} {:.2f})", z, one.mesh_shift / one.sd, one.mesh_sd / one.sd);
    }
    if (params.report) params.report(line);
  }
  return study;
}

}  // namespace interglow::test
