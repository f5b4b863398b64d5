// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/attribution.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "fitting/photometric_residuals.h"

namespace interglow::fitting {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using radiosity::RowMatrix;

constexpr double kDegree = std::numbers::pi / 180.0;
/// Sine of the angle to the other parameters below which they imitate a cause.
constexpr double kAbsorbed = 1e-3;

/// A cause that ten times its size would leave within the noise counts as imitated as well.
constexpr double kUnseen = 0.1;

struct Change {
  Cause cause;
  RowMatrix channels;  ///< change of the picture at this size
};

/// Where other objects are moved for a gap: away from the first, by a share of its size.
scene::Scene with_gap(const scene::Scene& scene, double share, double& gap_mm) {
  scene::Scene moved = scene;
  const auto middle = [](const scene::Object& object) {
    Vector3d low = object.patches.points[0], high = low;
    for (const Vector3d& p : object.patches.points) {
      low = low.cwiseMin(p);
      high = high.cwiseMax(p);
    }
    return std::pair<Vector3d, double>(0.5 * (low + high), 0.5 * (high - low).minCoeff());
  };
  const auto [first, size] = middle(scene.objects[0]);
  gap_mm = share * size;
  for (std::size_t o = 1; o < moved.objects.size(); ++o) {
    const Vector3d away = middle(scene.objects[o]).first - first;
    if (!(away.norm() > 0.0)) continue;
    for (Vector3d& p : moved.objects[o].patches.points) p += gap_mm * away.normalized();
  }
  return moved;
}

}  // namespace

const char* name(AttributionVerdict verdict) {
  switch (verdict) {
    case AttributionVerdict::kNotNeeded:
      return "consistent with 1";
    case AttributionVerdict::kExplained:
      return "explained";
    case AttributionVerdict::kShared:
      return "shared";
    case AttributionVerdict::kUndetermined:
      break;
  }
  return "undetermined";
}

Attribution attribute_w(ForwardModel& model, const ForwardParams& forward, const SceneFit& fit, const FitParams& params,
                        const Uncertainty& uncertainty, const Progress& progress) {
  Attribution result;
  const auto found = std::find(fit.free.begin(), fit.free.end(), static_cast<int>(kW));
  if (found == fit.free.end()) {
    result.sentence = "w/w' was not fitted.";
    return result;
  }
  const auto w_column = static_cast<Index>(found - fit.free.begin());
  const auto count = static_cast<Index>(fit.free.size());
  const FitState& state = fit.state;
  std::vector<int> wanted(static_cast<std::size_t>(shared_count(model.scene())));
  for (std::size_t k = 0; k < wanted.size(); ++k) wanted[k] = static_cast<int>(k);
  const Evaluation here = model.evaluate(state, wanted, progress);

  std::vector<Change> changes;
  const auto add = [&](const std::string& what, const std::string& size, RowMatrix channels) {
    Change change;
    change.cause.name = what;
    change.cause.size = size;
    change.channels = std::move(channels);
    changes.push_back(std::move(change));
  };
  // Causes that act on indirect light are taken at w = 1: they stand in for w, and do not multiply it.
  const double of_w = 1.0 / std::max(state.w, 1e-3);
  if (forward.bounces) {
    model.set_bounces(std::nullopt);
    add("missing bounces", fmt::format("the model stops at {}, the capture goes on", *forward.bounces),
        of_w * (model.evaluate(state, {}, progress).channels - here.channels));
  } else {
    model.set_bounces(2);
    add("missing bounces", "the capture's light ends after 2 indirect bounces, the model's goes on",
        of_w * (model.evaluate(state, {}, progress).channels - here.channels));
  }
  model.set_bounces(forward.bounces);
  if (model.scene().objects.size() > 1) {
    double gap_mm = 0.0;
    const scene::Scene apart = with_gap(model.scene(), 0.02, gap_mm);
    ForwardParams same_faces = forward;
    if (same_faces.mesh) same_faces.mesh = FitMeshParams{.most_turn_deg = 90.0, .contact_halvings = 0};
    const ForwardModel gap(apart, same_faces, progress);
    FitState there = state;
    const Evaluation moved_apart = gap.evaluate(there, {}, progress);
    if (moved_apart.channels.cols() == here.channels.cols()) {
      add("contact gap", fmt::format("{:.2f} mm (2 % of the first object)", gap_mm),
          (moved_apart.direct - here.direct) +
              of_w * ((moved_apart.channels - moved_apart.direct) - (here.channels - here.direct)));
    }
  }
  add("light tilt", "1 degree across", kDegree * here.derivative[kLightU]);
  add("light tilt", "1 degree along", kDegree * here.derivative[kLightV]);
  for (std::size_t m = 0; m < model.scene().materials.size(); ++m) {
    add("reflectance of " + model.scene().materials[m].name, "2 % higher",
        0.02 * here.derivative[static_cast<std::size_t>(kFirstScale) + m]);
    add("reflectance of " + model.scene().materials[m].name, "0.02 higher in all bands",
        0.02 * here.derivative[static_cast<std::size_t>(kFirstScale) + model.scene().materials.size() + m]);
  }
  const Eigen::RowVectorXd mean = here.channels.colwise().mean();
  add("veil", "3 % of the light, spread over the picture", (-0.03 * here.channels).rowwise() + 0.03 * mean);
  // Channels may be negative: brightness is that of bands.
  const double brightest = (here.channels * model.palette()).maxCoeff();
  add("offset", "0.5 % of the brightest, coloured like the mean of the picture",
      RowMatrix::Zero(here.channels.rows(), here.channels.cols()).rowwise() +
          0.005 * brightest / std::max((mean * model.palette()).maxCoeff(), 1e-300) * mean);
  const double pixel_mm = state.camera.pivot_in_camera.z() / state.camera.focal_px;
  add("misregistration", "0.5 px to the right", 0.5 * pixel_mm * here.derivative[kShiftX]);
  add("misregistration", "0.5 px down", 0.5 * pixel_mm * here.derivative[kShiftY]);
  const double wider = std::hypot(std::max(state.blur_px, kLeastBlur), 0.5);
  FitState soft = state;
  soft.blur_px = wider;
  add("blur", "0.5 px more (in quadrature)", model.evaluate(soft, {}, progress).channels - here.channels);

  std::vector<RowMatrix> sides;
  for (const Change& change : changes) sides.push_back(change.channels);
  const CompressedAt at = compress(model, fit.data, state, here, fit.free, params, sides);
  const MatrixXd& triangle = at.all.shared_triangle;
  // Priors belong to the fit; they see no residual beyond their own.
  const MatrixXd priors = prior_rows(state, state.camera, fit.free, params);
  MatrixXd system(triangle.rows() + priors.rows(), triangle.cols());
  system.setZero();
  system.topRows(triangle.rows()) = triangle;
  if (priors.rows() > 0) system.bottomRows(priors.rows()).leftCols(count + 1) = priors;

  const VectorXd ranges = plausible_ranges(state, fit.free);
  const double excess = std::sqrt(std::max(1.0, fit.chi_square));
  const Subspace space = split_directions(system, ranges, excess / UncertaintyParams{}.weak_share);
  const MatrixXd basis = ranges.asDiagonal() * space.strong;
  const MatrixXd columns = system.leftCols(count) * basis;
  const Eigen::ColPivHouseholderQR<MatrixXd> qr(columns);
  const ParameterEstimate* w = uncertainty.find(kW);
  const double fitted_w = uncertainty.state.w;
  const double inflation = w != nullptr && w->model_sd > 0.0 ? std::max(1.0, w->sd / w->model_sd) : excess;
  const auto without = [&](const VectorXd& v) -> VectorXd { return v - columns * qr.solve(v); };
  // What w changes that the other parameters do not.
  MatrixXd others = system.leftCols(count);
  others.col(w_column).setZero();
  const Subspace rest = split_directions(others, ranges, excess / UncertaintyParams{}.weak_share);
  const Eigen::ColPivHouseholderQR<MatrixXd> rest_qr(others * ranges.asDiagonal() * rest.strong);
  const auto beside = [&](const VectorXd& v) -> VectorXd {
    return v - others * ranges.asDiagonal() * rest.strong * rest_qr.solve(v);
  };
  const VectorXd own = beside(system.col(w_column));
  const VectorXd residual = without(system.col(count));
  for (std::size_t k = 0; k < changes.size(); ++k) {
    Cause cause = changes[k].cause;
    const VectorXd change = system.col(count + 1 + static_cast<Index>(k));
    cause.shift = (basis * qr.solve(change))[w_column];
    const VectorXd rest_of_change = beside(change);
    const double cosine = std::abs(rest_of_change.dot(own)) / std::max(rest_of_change.norm() * own.norm(), 1e-300);
    cause.angle_deg = std::acos(std::min(1.0, cosine)) / kDegree;
    const VectorXd left = without(change);
    // Gains and offsets are gone from the rows: of what they imitate wholly only rounding is left.
    cause.absorbed = left.norm() < kAbsorbed * change.norm() || left.norm() < kUnseen * inflation;
    if (!cause.absorbed) {
      cause.amplitude = left.dot(residual) / left.squaredNorm();
      cause.amplitude_sd = inflation / left.norm();
      cause.w_with = fitted_w - cause.amplitude * cause.shift;
      cause.supported = std::abs(cause.amplitude) > 3.0 * cause.amplitude_sd && std::abs(cause.amplitude) <= 3.0 &&
                        std::abs(cause.w_with - 1.0) < 0.7 * std::abs(fitted_w - 1.0);
    } else {
      cause.w_with = fitted_w;
    }
    result.causes.push_back(cause);
  }

  const double sd = w != nullptr ? w->sd : 0.0;
  if (w == nullptr || !w->determined) {
    result.verdict = AttributionVerdict::kUndetermined;
    result.sentence = "The capture does not determine w/w', so nothing can be said about its cause.";
    return result;
  }
  if (std::abs(fitted_w - 1.0) < 2.0 * sd) {
    result.verdict = AttributionVerdict::kNotNeeded;
    result.sentence = fmt::format("w/w' = {:.4f} ± {:.4f} agrees with 1: nothing needs a cause.", fitted_w, sd);
    return result;
  }
  std::vector<const Cause*> supported;
  for (const Cause& cause : result.causes) {
    if (cause.supported) supported.push_back(&cause);
  }
  std::sort(supported.begin(), supported.end(),
            [](const Cause* a, const Cause* b) { return std::abs(a->w_with - 1.0) < std::abs(b->w_with - 1.0); });
  const auto tolerance = std::max(3.0 * sd, 0.01);
  std::vector<const Cause*> whole;
  for (const Cause* cause : supported) {
    if (std::abs(cause->w_with - 1.0) < tolerance) whole.push_back(cause);
  }
  if (whole.size() == 1) {
    result.verdict = AttributionVerdict::kExplained;
    result.sentence = fmt::format(
        "w/w' = {:.4f} ± {:.4f} is explained by {}: the residuals hold {:.2f} ± {:.2f} times \"{}\", with which w/w' "
        "is {:.4f}.",
        fitted_w, sd, whole[0]->name, whole[0]->amplitude, whole[0]->amplitude_sd, whole[0]->size, whole[0]->w_with);
  } else if (supported.size() >= 2) {
    result.verdict = AttributionVerdict::kShared;
    result.sentence =
        fmt::format("w/w' = {:.4f} ± {:.4f}: more than one cause fits the residuals, among them {} and {}.", fitted_w,
                    sd, supported[0]->name, supported[1]->name);
  } else {
    result.verdict = AttributionVerdict::kUndetermined;
    result.sentence = fmt::format(
        "w/w' = {:.4f} ± {:.4f}: {} of the causes tried brings it to 1 in a way that the residuals "
        "support.",
        fitted_w, sd, supported.empty() ? "none" : "only part is taken by " + supported[0]->name + "; none");
  }
  return result;
}

}  // namespace interglow::fitting
