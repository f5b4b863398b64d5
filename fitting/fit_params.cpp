// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/fit_params.h"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "diagnostics/error.h"

namespace interglow::fitting {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

bool is_scale(const FitState& state, int parameter) {
  return parameter >= kFirstScale && parameter < kFirstScale + state.scale.size();
}

}  // namespace

void validate(const FitParams& params) {
  const auto positive = [](double value, const char* name) {
    if (!(value > 0.0) || !std::isfinite(value))
      throw InvalidParams(fmt::format("{} is {}, expected a finite value above 0.", name, value));
  };
  positive(params.reflectance_sigma, "reflectance_sigma");
  positive(params.reflectance_offset_sigma, "reflectance_offset_sigma");
  positive(params.principal_sigma_px, "principal_sigma_px");
  positive(params.distortion_sigma, "distortion_sigma");
  if (!(params.huber_sigmas >= 1.0))
    throw InvalidParams(fmt::format("huber_sigmas is {}, expected at least 1.", params.huber_sigmas));
  if (!(params.model_sigma >= 0.0 && params.model_sigma <= 1.0))
    throw InvalidParams(fmt::format("model_sigma is {}, expected a value in [0, 1].", params.model_sigma));
  if (params.most_iterations < 1)
    throw InvalidParams(fmt::format("most_iterations is {}, expected at least 1.", params.most_iterations));
}

std::vector<int> free_parameters(const scene::Scene& scene, const FitParams& params) {
  std::vector<int> free;
  const auto add = [&](bool wanted, int first, int last) {
    for (int k = first; wanted && k <= last; ++k) free.push_back(k);
  };
  add(params.light, kLightU, kLightV);
  add(params.pose, kTurnX, kShiftZ);
  add(params.focal, kFocal, kFocal);
  add(params.principal, kPrincipalX, kPrincipalY);
  add(params.distortion, kDistortion, kDistortion);
  add(params.blur, kBlur, kBlur);
  add(params.w, kW, kW);
  const int materials = static_cast<int>(scene.materials.size());
  add(params.reflectance, kFirstScale, kFirstScale + materials - 1);
  add(params.reflectance_offset, kFirstScale + materials, kFirstScale + 2 * materials - 1);
  return free;
}

std::vector<Prior> priors(const FitState& state, const LensCamera& like, const std::vector<int>& free,
                          const FitParams& params) {
  std::vector<Prior> result;
  for (std::size_t k = 0; k < free.size(); ++k) {
    if (free[k] == kPrincipalX || free[k] == kPrincipalY) {
      result.push_back({k, like.principal_px[free[k] - kPrincipalX], params.principal_sigma_px});
    } else if (free[k] == kDistortion) {
      result.push_back({k, 0.0, params.distortion_sigma});
    } else if (free[k] >= kFirstScale) {
      const bool scale = is_scale(state, free[k]);
      result.push_back({k, scale ? 1.0 : 0.0, scale ? params.reflectance_sigma : params.reflectance_offset_sigma});
    }
  }
  return result;
}

double value_of(const FitState& state, int parameter) {
  if (is_scale(state, parameter)) return state.scale[parameter - kFirstScale];
  if (parameter >= kFirstScale) return state.raise[parameter - kFirstScale - state.scale.size()];
  switch (parameter) {
    case kShiftX:
    case kShiftY:
    case kShiftZ:
      return state.camera.pivot_in_camera[parameter - kShiftX];
    case kFocal:
      return std::log(state.camera.focal_px);
    case kPrincipalX:
    case kPrincipalY:
      return state.camera.principal_px[parameter - kPrincipalX];
    case kDistortion:
      return state.camera.distortion;
    case kBlur:
      return state.blur_px;
    case kW:
      return state.w;
    default:
      return 0.0;
  }
}

VectorXd plausible_ranges(const FitState& state, const std::vector<int>& free) {
  VectorXd ranges(static_cast<Index>(free.size()));
  for (std::size_t k = 0; k < free.size(); ++k) {
    const int parameter = free[k];
    double range = 0.1;  // distortion, reflectances, logarithm of the focal length
    if (parameter <= kTurnZ) range = std::numbers::pi / 18.0;
    if (parameter >= kShiftX && parameter <= kShiftZ) range = 0.1 * state.camera.pivot_in_camera.z();
    if (parameter == kPrincipalX || parameter == kPrincipalY) range = 0.05 * state.camera.width;
    if (parameter == kBlur) range = 1.0;
    if (parameter == kW) range = 0.5;
    ranges[static_cast<Index>(k)] = range;
  }
  return ranges;
}

MatrixXd prior_rows(const FitState& state, const LensCamera& like, const std::vector<int>& free,
                    const FitParams& params) {
  const std::vector<Prior> all = priors(state, like, free, params);
  MatrixXd rows = MatrixXd::Zero(static_cast<Index>(all.size()), static_cast<Index>(free.size()) + 1);
  for (std::size_t i = 0; i < all.size(); ++i) {
    const auto row = static_cast<Index>(i);
    rows(row, static_cast<Index>(all[i].free)) = 1.0 / all[i].sigma;
    rows(row, rows.cols() - 1) = (all[i].mean - value_of(state, free[all[i].free])) / all[i].sigma;
  }
  return rows;
}

}  // namespace interglow::fitting
