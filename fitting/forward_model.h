// SPDX-License-Identifier: GPL-3.0-or-later
/// The picture that a scene would give, as a smooth function of light, camera and photometry, with its derivatives.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "diagnostics/progress.h"
#include "fitting/fit_mesh.h"
#include "fitting/lens_camera.h"
#include "fitting/spectral_reduction.h"
#include "image/spectral_image.h"
#include "radiosity/elements.h"
#include "radiosity/solution.h"
#include "radiosity/transport.h"
#include "scene/scene.h"

namespace interglow::fitting {

struct ForwardParams {
  radiosity::TransportParams transport{};
  /// How the scene's faces are made finer (fit_mesh); empty: they stay as they are, with flat outlines.
  std::optional<FitMeshParams> mesh = FitMeshParams{};
  /// Indirect bounces; empty: all.
  std::optional<int> bounces{};
  /// What the compact spectra leave out, relative to the largest spectrum of one bounce, in [1e-10, 1e-2].
  double spectral_tolerance = 1e-4;
  /// What the light may lack of its equation, relative to the largest direct part, in [1e-14, 1e-3].
  double solve_tolerance = 1e-8;
};

void validate(const ForwardParams& params);  ///< Throws InvalidParams, naming field, value and range.

/// Everything that a fit can move.
struct FitState {
  Eigen::Vector3d light_direction{0.0, 0.0, -1.0};  ///< unit, the way the light travels
  double half_angle_rad = 0.0;                      ///< of the source; not fitted
  LensCamera camera;
  double blur_px = 0.0;    ///< standard deviation of the Gaussian point spread; below kLeastBlur: none
  double w = 1.0;          ///< factor on all indirect light, rr + li + rl: w/w′
  Eigen::VectorXd scale;   ///< of each material's Donaldson matrix
  Eigen::VectorXd raise;   ///< added to each material's reflectance in all bands, after the scale
  Eigen::VectorXd gain;    ///< one a band
  Eigen::VectorXd offset;  ///< one a band, in the unit of the capture
};

inline constexpr double kLeastBlur = 0.2;  ///< [px]; a narrower Gaussian does not reach the next pixel

/// Parameters shared by all bands, in this order; the state of a fit moves along them by `moved`.
enum SharedParameter : int {
  kLightU = 0,  ///< tilt of the light along light_tangents().col(0) [rad], and col(1)
  kLightV,
  kTurnX,  ///< camera, see LensCamera::moved
  kTurnY,
  kTurnZ,
  kShiftX,
  kShiftY,
  kShiftZ,
  kFocal,
  kPrincipalX,
  kPrincipalY,
  kDistortion,
  kBlur,  ///< [px]
  kW,
  kFirstScale,  ///< one a material, then the offsets of their reflectances
};

int shared_count(const scene::Scene& scene);
/// "light tilt along (0.00, 1.00, 0.00)", "turn about the camera's x axis", "reflectance scale of red", …
std::string parameter_name(const scene::Scene& scene, const FitState& state, int parameter);
std::string parameter_unit(int parameter);

/// Two unit vectors across the light.
Eigen::Matrix<double, 3, 2> light_tangents(const Eigen::Vector3d& direction);

/// State after a step in the shared parameters.
FitState moved(const FitState& state, const Eigen::VectorXd& shared_step);

/// Picture before gain and offset: I_b(p) = gain_b Σ_c channels(p, c) palette(c, b) + offset_b.
struct Evaluation {
  radiosity::RowMatrix channels;                 ///< pixels x channels, blurred
  std::vector<radiosity::RowMatrix> derivative;  ///< one a shared parameter; 0 x 0 for those not asked for
  radiosity::RowMatrix direct;                   ///< the part of `channels` that is direct light
  Eigen::VectorXd coverage;                      ///< share of each pixel that objects cover, blurred
};

/// Share of each pixel that objects cover, and its derivatives by camera parameters.
struct CoverageEvaluation {
  Eigen::VectorXd value;
  std::vector<Eigen::VectorXd> derivative;  ///< one a parameter that was asked for, in that order
};

/// Form factors once for a geometry; light, camera, blur, w and reflectance scales move without new ones.
///
/// Light: the direct irradiance of elements and pixels is an area-exact cosine times visible share. The indirect light
/// solves C = F (v a + C A) on a few spectral modes (SpectralReduction); it is linear in v, so its derivative by a tilt
/// of the light is one more solve with the derivative of v, and by a reflectance one more with the light that the
/// material sends out. Camera: exact coverage of pixels by what is seen of each triangle (coverage.h). Derivatives of
/// v, of the direct picture and of coverage are central differences over steps far below a pixel of these exact areas,
/// which are smooth; everything behind them is analytic.
class ForwardModel {
 public:
  /// @throws InvalidInput unless the scene has one directional light and no other light; InvalidParams
  ForwardModel(const scene::Scene& scene, const ForwardParams& params, const Progress& progress = {});
  ~ForwardModel();
  ForwardModel(const ForwardModel&) = delete;
  ForwardModel& operator=(const ForwardModel&) = delete;

  /// With the faces of the model.
  const scene::Scene& scene() const;
  const SpectralReduction& spectra() const;
  const radiosity::Elements& elements() const;
  const radiosity::Transport& transport() const;
  Eigen::Index channels() const;
  /// Modes of SpectralReduction in the camera's bands: channels x camera bands.
  const radiosity::RowMatrix& palette() const;

  /// The scene's own light and camera, no blur, all factors 1, offsets 0.
  FitState initial_state() const;

  /// @param wanted  shared parameters whose derivatives are computed
  /// Cost: solves and gathers for the light; one exact coverage, and two more for each camera parameter wanted.
  Evaluation evaluate(const FitState& state, const std::vector<int>& wanted, const Progress& progress = {}) const;

  /// Coverage alone: no light is solved for. @param wanted  of kTurnX to kDistortion
  CoverageEvaluation coverage(const LensCamera& camera, double blur_px, const std::vector<int>& wanted) const;

  /// Replaces the bounces (attribution refits with fewer). Form factors are kept.
  void set_bounces(std::optional<int> bounces);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The picture itself, in the camera's bands.
image::SpectralImage picture(const ForwardModel& model, const FitState& state, const Evaluation& evaluation);

/// Rows of `image` (row-major pixels) blurred by a sampled Gaussian, mirrored at the borders; or its derivative by
/// sigma.
radiosity::RowMatrix blurred(const radiosity::RowMatrix& image, int width, int height, double sigma_px,
                             bool derivative = false);

}  // namespace interglow::fitting
