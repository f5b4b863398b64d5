// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/uncertainty.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "fitting/photometric_residuals.h"
#include "fitting/slippage.h"

namespace interglow::fitting {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

/// Singular values below this share of the largest are rounding of differences and form factors.
constexpr double kRounding = 1e-7;
/// A parameter takes part in a direction with at least this share of its length.
constexpr double kTakesPart = 0.25;
constexpr double kGrey = 0.01;             ///< relative variation of a reflectance that counts as none
constexpr double kRichardson = 3.0;        ///< 2² - 1: order 2 in the width of patches
constexpr double kLeastRatio = 2.0;        ///< of shifts when patches become twice as wide: order 1
constexpr double kInterval95 = 3.8414588;  ///< χ² with one degree of freedom

MatrixXd with_priors(const SceneFit& fit, const FitParams& params) {
  const auto count = static_cast<Index>(fit.free.size());
  TileQr joined(count + 1);
  joined.add(fit.compressed.shared_triangle.leftCols(count + 1));
  const MatrixXd priors = prior_rows(fit.state, fit.state.camera, fit.free, params);
  if (priors.rows() > 0) joined.add(priors);
  return joined.triangle();
}

/// Axis that the surfaces' normals hardly leave their plane along, if there is one: that of cylinders.
std::optional<Vector3d> normals_axis(const radiosity::Elements& elements) {
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (Index e = 0; e < elements.size(); ++e)
    spread += elements.area_mm2[e] * elements.normal.row(e).transpose() * elements.normal.row(e);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(spread);
  if (eigen.eigenvalues()[0] > 1e-4 * eigen.eigenvalues()[2]) return std::nullopt;
  Vector3d axis = eigen.eigenvectors().col(0);
  Index longest = 0;
  axis.cwiseAbs().maxCoeff(&longest);
  if (axis[longest] < 0.0) axis = -axis;
  return axis.unaryExpr([](double x) { return std::abs(x) < 0.005 ? 0.0 : x; });  // no "-0.00" in a name
}

/// Slips as orthonormal columns in the range-scaled space of the free parameters: the camera turns with the surfaces,
/// and the light stays where the camera sees it.
MatrixXd slip_directions(const Slippage& slips, const SceneFit& fit, const VectorXd& ranges) {
  const auto count = static_cast<Index>(fit.free.size());
  const auto is_free = [&](int parameter) {
    return std::find(fit.free.begin(), fit.free.end(), parameter) != fit.free.end();
  };
  if (slips.slips.empty() || !is_free(kTurnX)) return MatrixXd::Zero(count, 0);
  const auto of = static_cast<Index>(slips.slips.size());
  const Eigen::Matrix<double, 3, 2> tangents = light_tangents(fit.state.light_direction);
  MatrixXd full = MatrixXd::Zero(fit.free.back() + 1 + kFirstScale, of);
  Eigen::Matrix3Xd tilt(3, of);
  for (Index k = 0; k < of; ++k) {
    const Slip& slip = slips.slips[static_cast<std::size_t>(k)];
    tilt.col(k) = -slip.turn.cross(fit.state.light_direction);
    full.block(kLightU, k, 2, 1) = tangents.transpose() * tilt.col(k);
    full.block(kTurnX, k, 3, 1) = fit.state.camera.rotation * slip.turn;
    full.block(kShiftX, k, 3, 1) = fit.state.camera.rotation * slip.shift;
  }
  // A light that is held allows those slips alone that leave it where it is.
  if (!is_free(kLightU)) {
    const Eigen::FullPivLU<MatrixXd> lu(tilt);
    if (lu.rank() == of) return MatrixXd::Zero(count, 0);
    full = full * lu.kernel();
  }
  MatrixXd scaled(count, full.cols());
  for (Index k = 0; k < count; ++k) scaled.row(k) = full.row(fit.free[static_cast<std::size_t>(k)]) / ranges[k];
  const Eigen::HouseholderQR<MatrixXd> qr(scaled);
  return qr.householderQ() * MatrixXd::Identity(count, full.cols());
}

struct Spread {
  MatrixXd covariance;
  MatrixXd by_weights;  ///< if the weights were the whole truth
};

/// Uncertainty::covariance, in the space scaled by the ranges, where the belief is the identity.
/// @param seen  triangle without what slips
Spread spread_of(const MatrixXd& seen, const SceneFit& fit, const VectorXd& ranges, const MatrixXd& open) {
  const Index count = ranges.size();
  const MatrixXd scaled = seen.leftCols(count) * ranges.asDiagonal();
  const MatrixXd identity = MatrixXd::Identity(count, count);
  const MatrixXd keep = identity - open * open.transpose();
  const MatrixXd scores = keep * ranges.asDiagonal() * fit.score_scatter * ranges.asDiagonal() * keep + identity;
  const Eigen::LLT<MatrixXd> llt(scaled.transpose() * scaled + identity);
  const MatrixXd root = llt.matrixL().solve(identity);
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(root * scores * root.transpose());
  // Scores of a few squares scatter by chance: what they could if the weights were right (Marchenko and Pastur) counts
  // as what the weights say.
  const double least = std::max(1.0, fit.chi_square);
  const double chance =
      least * std::pow(1.0 + std::sqrt(static_cast<double>(count) / std::max(1.0, fit.score_freedom)), 2);
  const VectorXd values = eigen.eigenvalues().unaryExpr([&](double v) { return v > chance ? v : least; });
  const MatrixXd vectors = ranges.asDiagonal() * root.transpose() * eigen.eigenvectors();
  return {vectors * values.asDiagonal() * vectors.transpose(),
          ranges.asDiagonal() * root.transpose() * root * ranges.asDiagonal()};
}

/// How far the width of the patches has moved the free parameters, and the covariance of that.
struct MeshShift {
  VectorXd shift;
  MatrixXd covariance;
};

/// Extrapolates to patches of no width. A picture's change when patches become twice as wide moves the parameters by
/// d = (H + B)⁻¹ Jᵀ W change to first order: d1 from this mesh to the next wider, d2 from there to the widest. Errors
/// of order p make d2 = 2^p d1, and the fit lies d1 / (2^p - 1) off. One order is found for all parameters, in the
/// measure of what the capture sees, so that they move together; what d2 has beside that and the difference to order 2
/// count as uncertain.
MeshShift mesh_shift_of(const ForwardModel& model, const UncertaintyParams& meshes, const SceneFit& fit,
                        const FitParams& params, const Spread& spread, const Progress& progress) {
  const auto count = static_cast<Index>(fit.free.size());
  const MeshShift none{VectorXd::Zero(count), MatrixXd::Zero(count, count)};
  if (meshes.coarser == nullptr) return none;
  const Evaluation here = model.evaluate(fit.state, fit.free, progress);
  const Evaluation coarse = meshes.coarser->evaluate(fit.state, {}, progress);
  if (coarse.channels.cols() != here.channels.cols()) return none;
  std::vector<radiosity::RowMatrix> changes{here.channels - coarse.channels};
  if (meshes.coarsest != nullptr) {
    const Evaluation coarsest = meshes.coarsest->evaluate(fit.state, {}, progress);
    if (coarsest.channels.cols() == here.channels.cols()) changes.emplace_back(coarse.channels - coarsest.channels);
  }
  const MatrixXd triangle = compress(model, fit.data, fit.state, here, fit.free, params, changes).all.shared_triangle;
  const MatrixXd score = triangle.leftCols(count).transpose() * triangle.rightCols(static_cast<Index>(changes.size()));
  const MatrixXd d = spread.by_weights * score;
  double ratio = 0.0;
  if (changes.size() > 1) ratio = score.col(0).dot(d.col(1)) / std::max(score.col(0).dot(d.col(0)), 1e-300);
  MeshShift result = none;
  if (ratio < kLeastRatio) {  // not seen, or not yet on the way to a limit
    result.shift = d.col(0) / kRichardson;
    result.covariance = std::pow(1.0 - 1.0 / kRichardson, 2) * d.col(0) * d.col(0).transpose();
    return result;
  }
  result.shift = d.col(0) / (ratio - 1.0);
  const VectorXd beside = (d.col(1) - ratio * d.col(0)) / (ratio * (ratio - 1.0));
  result.covariance = std::pow(1.0 / (ratio - 1.0) - 1.0 / kRichardson, 2) * d.col(0) * d.col(0).transpose() +
                      beside * beside.transpose();
  return result;
}

/// What the scene leaves open whatever is captured.
std::vector<std::string> notes_of(const ForwardModel& model, const Slippage& slips) {
  std::vector<std::string> notes;
  if (!slips.body.empty()) {
    notes.push_back("The surfaces are " + slips.body +
                    ": turned about it they look the same, and a turn of the camera trades with a tilt of the light. "
                    "Facets are not counted as something that is seen.");
  }
  // Spectra that every reflection multiplies: where all are alike and even, no band tells once from twice reflected.
  const auto& materials = model.scene().materials;
  bool grey = true;
  for (const spectral::Material& material : materials) {
    const VectorXd& r = material.donaldson.reflectance;
    grey = grey && material.donaldson.luminescence.size() == 0 && r.maxCoeff() - r.minCoeff() < kGrey * r.mean();
  }
  if (grey) {
    notes.push_back(
        "All reflectances are grey: light between the objects has the colour of direct light, so that only its place "
        "in "
        "the picture tells w/w', and the ratio of shading terms does not exist.");
  }
  return notes;
}

std::string sentence_of(const ForwardModel& model, const SceneFit& fit, const VectorXd& unit, const VectorXd& step) {
  // Participants, the strongest first; the two tilts of the light are one.
  std::vector<std::pair<double, std::string>> parts;
  const Eigen::Matrix<double, 3, 2> tangents = light_tangents(fit.state.light_direction);
  Vector3d tilt = Vector3d::Zero();
  double tilt_share = 0.0;
  for (std::size_t k = 0; k < fit.free.size(); ++k) {
    const double share = unit[static_cast<Index>(k)];
    if (fit.free[k] <= kLightV) {
      tilt += share * tangents.col(fit.free[k]);
      tilt_share = std::hypot(tilt_share, share);
    } else if (std::abs(share) >= kTakesPart) {
      parts.emplace_back(std::abs(share), parameter_name(model.scene(), fit.state, fit.free[k]));
    }
  }
  if (tilt_share >= kTakesPart) {
    tilt.normalize();
    const std::optional<Vector3d> axis = normals_axis(model.elements());
    const std::string along =
        axis && std::abs(axis->dot(tilt)) > 0.85
            ? fmt::format("light tilt along the axis of the surfaces ({:.2f}, {:.2f}, {:.2f})", axis->x(), axis->y(),
                          axis->z())
            : fmt::format("light tilt along ({:.2f}, {:.2f}, {:.2f})", tilt.x(), tilt.y(), tilt.z());
    parts.emplace_back(tilt_share, along);
  }
  std::sort(parts.begin(), parts.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  // How far the bands' gains move with it, relative to themselves.
  if (fit.compressed.own > 0) {
    double square = 0.0;
    for (std::size_t b = 0; b < fit.compressed.band.size(); ++b)
      square += std::pow((fit.compressed.own_response(b) * step)[0] / fit.state.gain[static_cast<Index>(b)], 2);
    if (std::sqrt(square / static_cast<double>(fit.compressed.band.size())) > 0.02) parts.emplace_back(0.0, "the gain");
  }
  std::string text;
  if (parts.size() == 1) return parts[0].second + " changes nothing that the capture shows";
  for (std::size_t k = 0; k < parts.size(); ++k)
    text += (k == 0 ? "" : k == 1 ? " trades with " : k + 1 == parts.size() ? " and " : ", ") + parts[k].second;
  return text;
}

/// Rise of χ² at a state over the optimum, gains and offsets refitted.
double rise_at(const ForwardModel& model, const SceneFit& fit, const FitParams& params, FitState state,
               double inflation, const Progress& progress) {
  const Evaluation there = model.evaluate(state, {}, progress);
  return (fit_bands(model, fit.data, there, params, state) - fit.cost * static_cast<double>(fit.residuals)) / inflation;
}

WProfile profile_of(const ForwardModel& model, const SceneFit& fit, const FitParams& params, const MatrixXd& triangle,
                    const Subspace& space, const VectorXd& ranges, Index column, double sd, double inflation,
                    const Progress& progress) {
  const auto count = static_cast<Index>(fit.free.size());
  WProfile profile;
  // In the determined directions: the step that moves w by 1 and costs least.
  const MatrixXd basis = ranges.asDiagonal() * space.strong;
  const MatrixXd system = triangle.leftCols(count) * basis;
  const MatrixXd inverse = (system.transpose() * system).ldlt().solve(MatrixXd::Identity(basis.cols(), basis.cols()));
  const VectorXd along = basis.row(column).transpose();
  const VectorXd ridge = basis * inverse * along / along.dot(inverse * along);
  for (const double sigmas : {-3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0}) {
    VectorXd full = VectorXd::Zero(shared_count(model.scene()));
    for (Index k = 0; k < count; ++k) full[fit.free[static_cast<std::size_t>(k)]] = sigmas * sd * ridge[k];
    FitState state = moved(fit.state, full);
    state.blur_px = std::max(state.blur_px, kLeastBlur);
    profile.w.push_back(state.w);
    profile.rise.push_back(sigmas == 0.0 ? 0.0 : rise_at(model, fit, params, state, inflation, progress));
  }
  // The root of the rise is nearly linear in w on either side.
  const auto crossing = [&](int direction) {
    double previous_w = fit.state.w;
    double previous = 0.0;
    for (int k = 1; k <= 3; ++k) {
      const auto at = static_cast<std::size_t>(3 + direction * k);
      const double root = std::sqrt(std::max(0.0, profile.rise[at]));
      if (root >= std::sqrt(kInterval95)) {
        return previous_w + (std::sqrt(kInterval95) - previous) / (root - previous) * (profile.w[at] - previous_w);
      }
      previous_w = profile.w[at];
      previous = root;
    }
    return direction * std::numeric_limits<double>::infinity();
  };
  profile.low = crossing(-1);
  profile.high = crossing(1);
  return profile;
}

}  // namespace

const ParameterEstimate* Uncertainty::find(int parameter) const {
  for (const ParameterEstimate& one : parameters) {
    if (one.parameter == parameter) return &one;
  }
  return nullptr;
}

ForwardParams coarser(const ForwardParams& params) {
  ForwardParams result = params;
  if (result.mesh) {
    result.mesh->most_turn_deg = std::min(90.0, 2.0 * result.mesh->most_turn_deg);
    result.mesh->contact_halvings = std::max(0, result.mesh->contact_halvings - 1);
    result.mesh->most_faces = std::max(1, result.mesh->most_faces / 4);
  }
  return result;
}

Subspace split_directions(const MatrixXd& triangle, const VectorXd& ranges, double least_strength) {
  const Index count = ranges.size();
  const Eigen::JacobiSVD<MatrixXd> svd(triangle.leftCols(count) * ranges.asDiagonal(), Eigen::ComputeFullV);
  const VectorXd& values = svd.singularValues();
  Index strong = 0;
  while (strong < count && values[strong] >= least_strength && values[strong] > kRounding * values[0]) ++strong;
  return {svd.matrixV().leftCols(strong), values.head(strong), svd.matrixV().rightCols(count - strong),
          values.tail(count - strong)};
}

Uncertainty examine(const ForwardModel& model, const SceneFit& fit, const FitParams& fit_params,
                    const UncertaintyParams& params, const Progress& progress) {
  Uncertainty result;
  const auto count = static_cast<Index>(fit.free.size());
  const MatrixXd triangle = with_priors(fit, fit_params);
  const VectorXd ranges = plausible_ranges(fit.state, fit.free);
  // Residuals larger than their weights say make everything less sure.
  const double excess = std::sqrt(std::max(1.0, fit.chi_square));
  // Motions of the surfaces into themselves: facets alone tell how far they have gone, and facets are the mesh's.
  const Slippage slips = slippage(model.scene(), fit.state.camera.pivot);
  const MatrixXd open = slip_directions(slips, fit, ranges);
  MatrixXd seen = triangle;
  seen.leftCols(count) = triangle.leftCols(count) * ranges.asDiagonal();
  seen.leftCols(count) -= seen.leftCols(count) * open * open.transpose();
  seen.leftCols(count) = seen.leftCols(count) * ranges.cwiseInverse().asDiagonal();
  const Subspace space = split_directions(seen, ranges, excess / params.weak_share);
  const MatrixXd basis = ranges.asDiagonal() * space.strong;
  const Spread spread = spread_of(seen, fit, ranges, open);
  const MeshShift mesh = mesh_shift_of(model, params, fit, fit_params, spread, progress);
  result.covariance = spread.covariance + mesh.covariance;
  VectorXd correction = VectorXd::Zero(shared_count(model.scene()));
  for (Index k = 0; k < count; ++k) correction[fit.free[static_cast<std::size_t>(k)]] = -mesh.shift[k];
  result.state = moved(fit.state, correction);
  if (fit_params.blur) result.state.blur_px = std::max(result.state.blur_px, kLeastBlur);
  result.correlation = MatrixXd::Zero(count, count);
  for (Index i = 0; i < count; ++i) {
    for (Index j = 0; j < count; ++j)
      result.correlation(i, j) = result.covariance(i, j) / std::sqrt(result.covariance(i, i) * result.covariance(j, j));
  }
  result.notes = notes_of(model, slips);

  for (Index d = 0; d < space.weak.cols(); ++d) {
    WeakDirection weak;
    weak.step = ranges.cwiseProduct(space.weak.col(d));
    const bool rounding = !(space.weak_strength[d] > kRounding * (space.strength.size() > 0 ? space.strength[0] : 1.0));
    weak.sd_share = rounding ? std::numeric_limits<double>::infinity() : excess / space.weak_strength[d];
    weak.sentence = sentence_of(model, fit, space.weak.col(d), weak.step);
    result.weak.push_back(weak);
  }

  // Two halves of the picture, each from the optimum by one step in the determined directions.
  VectorXd half_step = VectorXd::Zero(count);
  if (fit.half_triangle.size() == 2 && space.strong.cols() > 0) {
    const auto step_of = [&](const MatrixXd& half) -> VectorXd {
      return basis * (half.leftCols(count) * basis).colPivHouseholderQr().solve(half.col(count));
    };
    half_step = step_of(fit.half_triangle[0]) - step_of(fit.half_triangle[1]);
  }
  for (Index k = 0; k < count; ++k) {
    ParameterEstimate one;
    one.parameter = fit.free[static_cast<std::size_t>(k)];
    one.name = parameter_name(model.scene(), fit.state, one.parameter);
    one.unit = parameter_unit(one.parameter);
    one.value = value_of(result.state, one.parameter);
    one.sd = std::sqrt(result.covariance(k, k));
    one.model_sd = std::sqrt(spread.by_weights(k, k));
    one.mesh_shift = mesh.shift[k];
    one.mesh_sd = std::sqrt(mesh.covariance(k, k));
    one.determined =
        one.sd <= params.weak_share * ranges[k] && !(one.parameter == kBlur && fit.state.blur_px <= kLeastBlur + 1e-9);
    bool named = one.determined;
    for (Index d = 0; d < space.weak.cols(); ++d) named = named || std::abs(space.weak(k, d)) >= kTakesPart;
    if (!named) {
      const bool angle = one.unit == "rad";
      const std::string unit = angle ? " degrees" : one.unit == "1" ? "" : " " + one.unit;
      result.notes.push_back(fmt::format("{}: held too weakly, with a standard deviation of {:.2g}{}.", one.name,
                                         one.sd * (angle ? 180.0 / std::numbers::pi : 1.0), unit));
    }
    // Each half knows half as much: their difference has twice the standard deviation.
    one.half_difference_sigmas = one.sd > 0.0 ? half_step[k] / (2.0 * one.sd) : 0.0;
    result.parameters.push_back(one);
  }

  const ParameterEstimate* w = result.find(kW);
  const double inflation = w != nullptr && w->determined && w->model_sd > 0.0
                               ? std::max(1.0, std::pow(w->sd / w->model_sd, 2))
                               : excess * excess;
  if (params.profile && w != nullptr && w->determined && w->sd < 0.3 * fit.state.w) {
    const Index column = std::find(fit.free.begin(), fit.free.end(), static_cast<int>(kW)) - fit.free.begin();
    result.profile = profile_of(model, fit, fit_params, seen, space, ranges, column, w->sd, inflation, progress);
    const double taken_off = result.state.w - fit.state.w;
    for (double& value : result.profile->w) value += taken_off;
    result.profile->low += taken_off;
    result.profile->high += taken_off;
  }
  if (fit_params.light) {
    if (const std::optional<Vector3d> axis = normals_axis(model.elements())) {
      FitState twin = fit.state;
      twin.light_direction -= 2.0 * twin.light_direction.dot(*axis) * *axis;
      if ((twin.light_direction - fit.state.light_direction).norm() > 1e-3) {
        result.twin_rise = rise_at(model, fit, fit_params, twin, inflation, progress);
        if (result.twin_rise < 9.0) result.twin_light = twin.light_direction;
      }
    }
  }
  return result;
}

}  // namespace interglow::fitting
