// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/minimizer.h"

#include <ceres/ceres.h>
#include <ceres/normal_prior.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <optional>
#include <utility>

#include "diagnostics/error.h"

namespace interglow::fitting {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

constexpr double kWidestBlur = 20.0;      ///< [px]
constexpr double kLeastFactor = 1e-3;     ///< of w and scales
constexpr double kLargestRaise = 0.5;     ///< of a reflectance
constexpr double kLargestScale = 10.0;    ///< of a reflectance
constexpr double kLargestZoom = 0.7;      ///< change of the focal length's logarithm
constexpr double kNoisyStep = 0.03;       ///< fall of ½ Σ ρ, predicted for a step that failed, that ends the search
constexpr double kSmallestRadius = 1e-8;  ///< some 9 failures in a row
constexpr int kMostInvalid = 12;          ///< steps in a row to states that cannot be

/// Parameters that Ceres moves together.
struct Group {
  int first = 0;  ///< shared parameters first to last
  int last = 0;
  std::vector<double> value;

  Index tangents() const { return last - first + 1; }
};

std::vector<Group> free_groups(const FitState& state, const std::vector<int>& free) {
  const auto has = [&](int parameter) { return std::find(free.begin(), free.end(), parameter) != free.end(); };
  std::vector<Group> groups;
  const auto add = [&](int first, int last, std::vector<double> value) {
    if (has(first)) groups.push_back({first, last, std::move(value)});
  };
  const Vector3d& l = state.light_direction;
  const Eigen::Quaterniond q(state.camera.rotation);
  const Vector3d& shift = state.camera.pivot_in_camera;
  add(kLightU, kLightV, {l.x(), l.y(), l.z()});
  add(kTurnX, kTurnZ, {q.x(), q.y(), q.z(), q.w()});
  add(kShiftX, kShiftZ, {shift.x(), shift.y(), shift.z()});
  add(kFocal, kFocal, {std::log(state.camera.focal_px)});
  add(kPrincipalX, kPrincipalY, {state.camera.principal_px.x(), state.camera.principal_px.y()});
  add(kDistortion, kDistortion, {state.camera.distortion});
  add(kBlur, kBlur, {std::clamp(state.blur_px, kLeastBlur, kWidestBlur)});
  add(kW, kW, {state.w});
  for (Index m = 0; m < state.scale.size(); ++m) {
    const int parameter = kFirstScale + static_cast<int>(m);
    add(parameter, parameter, {state.scale[m]});
  }
  for (Index m = 0; m < state.raise.size(); ++m) {
    const int parameter = kFirstScale + static_cast<int>(state.scale.size() + m);
    add(parameter, parameter, {state.raise[m]});
  }
  return groups;
}

void set(FitState& state, const Group& group, const double* value) {
  switch (group.first) {
    case kLightU:
      state.light_direction = Vector3d(value[0], value[1], value[2]).normalized();
      break;
    case kTurnX:
      state.camera.rotation =
          Eigen::Quaterniond(value[3], value[0], value[1], value[2]).normalized().toRotationMatrix();
      break;
    case kShiftX:
      state.camera.pivot_in_camera = {value[0], value[1], value[2]};
      break;
    case kFocal:
      state.camera.focal_px = std::exp(value[0]);
      break;
    case kPrincipalX:
      state.camera.principal_px = {value[0], value[1]};
      break;
    case kDistortion:
      state.camera.distortion = value[0];
      break;
    case kBlur:
      state.blur_px = value[0];
      break;
    case kW:
      state.w = value[0];
      break;
    default:
      if (group.first - kFirstScale < state.scale.size()) {
        state.scale[group.first - kFirstScale] = value[0];
      } else {
        state.raise[group.first - kFirstScale - state.scale.size()] = value[0];
      }
  }
}

/// Step in the shared parameters that a change of the group's numbers is: tangents x numbers.
RowMajor lift(const Group& group, const double* value) {
  if (group.first == kLightU) return light_tangents(Vector3d(value[0], value[1], value[2]).normalized()).transpose();
  if (group.first == kTurnX) {
    RowMajor minus(3, 4);
    ceres::EigenQuaternionManifold().MinusJacobian(value, minus.data());
    return 2.0 * minus;  // the manifold's steps are half angles
  }
  return RowMajor::Identity(group.tangents(), group.tangents());
}

/// What a search has seen, shared with Ceres' callbacks. Exceptions do not pass through Ceres.
struct Search {
  const FitState start;
  const std::vector<int>& free;
  const std::vector<Group>& groups;
  const Linearise& linearise;
  std::optional<Linearisation> first{};  ///< at the start, until Ceres has asked for it
  std::optional<FitState> last{};        ///< where derivatives were taken last
  std::exception_ptr failure{};
};

class CompressedCost : public ceres::CostFunction {
 public:
  explicit CompressedCost(Search& search) : search_(search) {
    set_num_residuals(static_cast<int>(search.free.size()) + 2);
    for (const Group& group : search.groups)
      mutable_parameter_block_sizes()->push_back(static_cast<int>(group.value.size()));
  }

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const auto count = static_cast<Index>(search_.free.size());
    Eigen::Map<Eigen::VectorXd> residual(residuals, num_residuals());
    residual.setZero();
    for (std::size_t g = 0; jacobians != nullptr && g < search_.groups.size(); ++g) {
      if (jacobians[g] != nullptr)
        std::fill_n(jacobians[g], static_cast<std::size_t>(num_residuals()) * search_.groups[g].value.size(), 0.0);
    }
    // Zeros until the callback stops the search: Ceres would print that an evaluation failed.
    if (search_.failure) return true;
    Linearisation at;
    FitState state = search_.start;
    for (std::size_t g = 0; g < search_.groups.size(); ++g) set(state, search_.groups[g], parameters[g]);
    if (jacobians != nullptr && search_.first) {
      at = std::move(*std::exchange(search_.first, std::nullopt));
      state = *search_.last;
    } else {
      try {
        at = search_.linearise(state, jacobians != nullptr);
      } catch (const InvalidParams&) {  // a camera that no longer sees the objects
        return false;
      } catch (...) {
        search_.failure = std::current_exception();
        return true;
      }
    }
    if (jacobians == nullptr) {
      residual[0] = std::sqrt(at.cost);
      return true;
    }
    residual.head(count + 1) = -at.triangle.col(count);
    residual[count + 1] = std::sqrt(std::max(0.0, at.cost - residual.squaredNorm()));
    Index column = 0;
    for (std::size_t g = 0; g < search_.groups.size(); ++g) {
      const Group& group = search_.groups[g];
      if (jacobians[g] != nullptr) {
        Eigen::Map<RowMajor> jacobian(jacobians[g], num_residuals(), static_cast<Index>(group.value.size()));
        jacobian.topRows(count + 1) = at.triangle.middleCols(column, group.tangents()) * lift(group, parameters[g]);
      }
      column += group.tangents();
    }
    search_.last = std::move(state);
    return true;
  }

 private:
  Search& search_;
};

class Watch : public ceres::IterationCallback {
 public:
  Watch(Search& search, const MinimizerParams& params, const Progress& progress)
      : search_(search), params_(params), progress_(progress) {}

  ceres::CallbackReturnType operator()(const ceres::IterationSummary& summary) override {
    try {
      progress_.update(params_.name, static_cast<double>(summary.iteration) / params_.most_iterations);
    } catch (...) {
      if (!search_.failure) search_.failure = std::current_exception();
    }
    if (search_.failure) return ceres::SOLVER_ABORT;
    const double predicted =
        summary.relative_decrease != 0.0 ? summary.cost_change / summary.relative_decrease : kNoisyStep;
    const bool failed = summary.iteration > 0 && summary.step_is_valid && !summary.step_is_successful;
    return failed && predicted < kNoisyStep ? ceres::SOLVER_TERMINATE_SUCCESSFULLY : ceres::SOLVER_CONTINUE;
  }

 private:
  Search& search_;
  const MinimizerParams& params_;
  const Progress& progress_;
};

void set_bounds(ceres::Problem& problem, Group& group, int materials) {
  double* value = group.value.data();
  const auto within = [&](double low, double high) {
    problem.SetParameterLowerBound(value, 0, low);
    problem.SetParameterUpperBound(value, 0, high);
  };
  // Ceres ignores bounds of blocks on a manifold: those below have none.
  if (group.first == kBlur) within(kLeastBlur, kWidestBlur);
  if (group.first == kFocal) within(*value - kLargestZoom, *value + kLargestZoom);
  if (group.first == kW) problem.SetParameterLowerBound(value, 0, kLeastFactor);
  if (group.first >= kFirstScale && group.first < kFirstScale + materials) within(kLeastFactor, kLargestScale);
  if (group.first >= kFirstScale + materials) within(-kLargestRaise, kLargestRaise);
}

void add_priors(ceres::Problem& problem, std::vector<Group>& groups, const std::vector<int>& free,
                const std::vector<Prior>& priors) {
  for (const Prior& prior : priors) {
    const int parameter = free[prior.free];
    for (Group& group : groups) {
      if (parameter < group.first || parameter > group.last) continue;
      MatrixXd weight = MatrixXd::Zero(1, group.tangents());
      Eigen::VectorXd mean = Eigen::VectorXd::Zero(group.tangents());
      weight(0, parameter - group.first) = 1.0 / prior.sigma;
      mean[parameter - group.first] = prior.mean;
      problem.AddResidualBlock(new ceres::NormalPrior(weight, mean), nullptr, group.value.data());
    }
  }
}

/// Residuals (number - believed number) / range of the groups up to w; twice that for quaternions, whose numbers are
/// half angles.
void add_beliefs(ceres::Problem& problem, std::vector<Group>& groups, const FitState& believed,
                 const std::vector<int>& free) {
  const std::vector<Group> means = free_groups(believed, free);
  for (std::size_t g = 0; g < groups.size(); ++g) {
    const int first = groups[g].first;
    if (first != kLightU && first != kTurnX && first != kShiftX && first != kFocal && first != kW) continue;
    const auto size = static_cast<Index>(groups[g].value.size());
    const Eigen::Map<Eigen::VectorXd> value(groups[g].value.data(), size);
    Eigen::VectorXd mean = Eigen::Map<const Eigen::VectorXd>(means[g].value.data(), size);
    double weight = 1.0 / plausible_ranges(believed, {first})[0];
    if (first == kTurnX) {
      weight *= 2.0;
      if (mean.dot(value) < 0.0) mean = -mean;  // the same turn
    }
    problem.AddResidualBlock(new ceres::NormalPrior(weight * MatrixXd::Identity(size, size), mean), nullptr,
                             groups[g].value.data());
  }
}

std::string reason(const ceres::Solver::Summary& summary) {
  switch (summary.termination_type) {
    case ceres::CONVERGENCE:
      return "cost no longer falls";
    case ceres::USER_SUCCESS:
      return "step below the rounding of the cost";
    case ceres::NO_CONVERGENCE:
      return "iteration limit";
    default:
      return "no step lowers the cost";
  }
}

}  // namespace

FitStage minimize(FitState& state, const std::vector<int>& free, const Linearise& linearise,
                  const MinimizerParams& params, const Progress& progress) {
  std::vector<Group> groups = free_groups(state, free);
  for (const Group& group : groups) set(state, group, group.value.data());
  Search search{state, free, groups, linearise};
  FitStage stage;
  stage.name = params.name;
  stage.width = state.camera.width;
  if (groups.empty()) {
    stage.cost_before = stage.cost = linearise(state, false).cost / params.residuals;
    stage.converged = true;
    stage.end = "nothing to move";
    return stage;
  }

  search.last = search.start;
  search.first = linearise(*search.last, true);
  Watch watch(search, params, progress);
  ceres::Problem problem;
  std::vector<double*> blocks;
  for (Group& group : groups) {
    blocks.push_back(group.value.data());
    problem.AddParameterBlock(group.value.data(), static_cast<int>(group.value.size()));
    if (group.first == kLightU) problem.SetManifold(group.value.data(), new ceres::SphereManifold<3>);
    if (group.first == kTurnX) problem.SetManifold(group.value.data(), new ceres::EigenQuaternionManifold);
    set_bounds(problem, group, static_cast<int>(state.scale.size()));
  }
  problem.AddResidualBlock(new CompressedCost(search), nullptr, blocks);
  add_priors(problem, groups, free, params.priors);
  if (params.believed) add_beliefs(problem, groups, *params.believed, free);

  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  options.max_num_iterations = params.most_iterations;
  options.function_tolerance = params.tolerance;
  options.gradient_tolerance = 0.0;
  options.parameter_tolerance = 1e-14;
  options.initial_trust_region_radius = params.first_radius;
  options.min_trust_region_radius = kSmallestRadius;
  options.max_num_consecutive_invalid_steps = kMostInvalid;
  // Steps are projected onto the bounds; a search along them would cost pictures.
  options.max_num_line_search_step_size_iterations = 0;
  options.callbacks.push_back(&watch);
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  if (search.failure) std::rethrow_exception(search.failure);

  // Ceres ends where it took derivatives last.
  state = *search.last;
  stage.iterations = static_cast<int>(summary.iterations.size()) - 1;
  stage.cost_before = 2.0 * summary.initial_cost / params.residuals;
  stage.cost = 2.0 * summary.final_cost / params.residuals;
  stage.converged = summary.termination_type == ceres::CONVERGENCE || summary.termination_type == ceres::USER_SUCCESS;
  stage.end = reason(summary);
  return stage;
}

}  // namespace interglow::fitting
