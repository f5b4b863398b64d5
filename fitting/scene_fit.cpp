// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/scene_fit.h"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <utility>

#include "diagnostics/error.h"
#include "fitting/photometric_residuals.h"
#include "fitting/silhouette.h"

namespace interglow::fitting {
namespace {

using Eigen::VectorXd;

constexpr double kWideLamp = 0.05;    ///< half-angle of the first small picture's lamp [rad]
constexpr double kSmallSigma = 0.01;  ///< of small pictures, over a band's bright values
constexpr double kSmallBlur = 0.7;    ///< of small pictures, at least [px]
constexpr double kFirstBlur = 0.5;    ///< from which a free blur starts, at least [px]
/// Fall of Σ ρ that ends a search, over χ² per residual: a few hundredths of a standard deviation.
constexpr double kSmallFall = 2e-3;
constexpr double kFarRadius = 1e3;   ///< of the trust region in small pictures
constexpr double kNearRadius = 1e4;  ///< and at full size

LensCamera reduced(const LensCamera& camera, int factor) {
  LensCamera small = camera;
  small.width /= factor;
  small.height /= factor;
  small.focal_px /= factor;
  small.principal_px /= factor;
  return small;
}

/// The camera at full size that a small one's moves make of `full`.
LensCamera enlarged(const LensCamera& small, const LensCamera& full, int factor) {
  LensCamera result = small;
  result.width = full.width;
  result.height = full.height;
  result.focal_px *= factor;
  result.principal_px *= factor;
  return result;
}

/// One picture size: minimises over the free parameters of `params`. The evaluation with derivatives that came last is
/// kept, as the end of a search is where derivatives were taken last.
struct PhotometricSearch {
  const ForwardModel& model;
  const FitData& data;
  const FitParams& params;
  const FitState& start;
  const Progress& progress;
  std::vector<int> free;
  Evaluation last{};

  FitStage run(const std::string& name, FitState& state, int most_iterations, double tolerance, double first_radius) {
    const Linearise linearise = [&](FitState& at, bool with_derivatives) {
      Linearisation result;
      Evaluation here = model.evaluate(at, with_derivatives ? free : std::vector<int>{}, progress);
      result.cost = fit_bands(model, data, here, params, at);
      if (with_derivatives) {
        result.triangle = compress(model, data, at, here, free, params).all.shared_triangle;
        last = std::move(here);
      }
      return result;
    };
    return minimize(state, free, linearise,
                    {.name = name,
                     .most_iterations = most_iterations,
                     .tolerance = tolerance,
                     .first_radius = first_radius,
                     .residuals = static_cast<double>(data.residuals),
                     .priors = priors(start, start.camera, free, params),
                     .believed = start},
                    progress);
  }
};

void require_match(const ForwardModel& model, const image::SpectralImage& image, const LensCamera& camera) {
  if (image.width != camera.width || image.height != camera.height) {
    throw InvalidInput(
        fmt::format("The capture has {} × {} pixels, the scene's camera {} × {}. Set camera.width_px and height_px to "
                    "the capture's.",
                    image.width, image.height, camera.width, camera.height));
  }
  const VectorXd& wavelength = model.spectra().wavelength_nm;
  if (image.bands() != wavelength.size() || (image.wavelength_nm - wavelength).cwiseAbs().maxCoeff() > 0.5) {
    throw InvalidInput(fmt::format(
        "The capture has {} bands from {:.1f} to {:.1f} nm, the scene's camera {} from {:.1f} to {:.1f} nm. Set the "
        "scene's wavelengths and the camera's bands to the capture's.",
        image.bands(), image.wavelength_nm[0], image.wavelength_nm[image.bands() - 1], wavelength.size(), wavelength[0],
        wavelength[wavelength.size() - 1]));
  }
}

/// Silhouettes and pictures that grow from some 32 pixels to half size (or once at full size, if that is small).
void run_small_pictures(const ForwardModel& model, const FitParams& params, const FitState& start, SceneFit& fit,
                        const Progress& progress) {
  const LensCamera& like = start.camera;
  const double half_angle = fit.state.half_angle_rad;
  int factor = 1;
  while (std::max(like.width, like.height) / (2 * factor) >= 32) factor *= 2;
  for (bool first = true; factor > 1 || first; factor /= 2) {
    const FitData small = reduced(fit.data, factor, kSmallSigma);
    FitState state = fit.state;
    state.camera = reduced(state.camera, factor);
    if (first && params.pose) fit.stages.push_back(align_silhouettes(model, small, state, progress));
    // A wide lamp far from the answer: shadows that overlap attract one another.
    if (first) state.half_angle_rad = std::max(half_angle, kWideLamp);
    state.blur_px = std::max(kSmallBlur, fit.state.blur_px / factor);
    FitParams coarse = params;
    coarse.principal = coarse.distortion = coarse.reflectance = coarse.reflectance_offset = coarse.blur = false;
    coarse.focal = params.focal && !first;
    FitState small_start = start;
    small_start.camera = reduced(like, factor);
    PhotometricSearch search{model, small, coarse, small_start, progress, free_parameters(model.scene(), coarse)};
    fit.stages.push_back(search.run("small picture", state, first ? 30 : 8, 1e-3, kFarRadius));
    state.half_angle_rad = half_angle;
    state.camera = enlarged(state.camera, like, factor);
    state.blur_px = fit.state.blur_px;
    fit.state = state;
    first = false;
  }
}

}  // namespace

SceneFit fit_scene(const ForwardModel& model, const Capture& capture, const FitState& start, const FitParams& params,
                   const Progress& progress) {
  validate(params);
  require_match(model, capture.image, start.camera);
  SceneFit fit;
  fit.state = start;
  fit.free = free_parameters(model.scene(), params);
  fit.data = fit_data(capture, params);
  fit.noise_known = capture.noise.known();
  fit.residuals = fit.data.residuals;
  if (params.staged) {
    run_small_pictures(params.small_pictures != nullptr ? *params.small_pictures : model, params, start, fit, progress);
  }

  if (params.blur) fit.state.blur_px = std::max(fit.state.blur_px, kFirstBlur);
  PhotometricSearch search{model, fit.data, params, start, progress, fit.free};
  fit.stages.push_back(search.run("full picture", fit.state, params.most_iterations,
                                  kSmallFall / static_cast<double>(fit.residuals), kNearRadius));
  fit.converged = fit.stages.back().converged;

  if (fit.free.empty()) search.last = model.evaluate(fit.state, {}, progress);
  const CompressedAt at = compress(model, fit.data, fit.state, search.last, fit.free, params, {}, true);
  fit.compressed = at.all;
  fit.half_triangle = at.half_triangle;
  fit.score_scatter = at.score_scatter;
  fit.score_freedom = at.score_freedom;
  fit.cost = at.cost / static_cast<double>(fit.residuals);
  fit.chi_square = at.chi_square;
  fit.robust_share = at.robust_share;
  return fit;
}

}  // namespace interglow::fitting
