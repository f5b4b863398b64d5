// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/reduced_system.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <Eigen/Cholesky>

#include <cmath>

#include "diagnostics/error.h"

namespace interglow::radiosity {
namespace {

/// Least squared pivot of I - √S T √S that is not rounding: its entries are of size 1 and carry a few 1e-16.
constexpr double kLeastPivot = 1e-14;
/// Sweeps after which coupling both ways is given up; a share of 20 % anti-Stokes needs about ten.
constexpr int kMaxSweeps = 1000;
/// Sweeps in a row with a growing change that prove divergence.
constexpr int kGrowingSweeps = 20;

[[noreturn]] void throw_singular(Eigen::Index band) {
  throw NumericalFailure(fmt::format(
      "the radiosity system is singular in band {}: light that neither leaves the scene nor is absorbed goes round for "
      "ever "
      "(a closed scene with reflectance 1, or form factors whose rows sum to more than 1). Open the scene, or give "
      "its surfaces a reflectance below 1.",
      band));
}

}  // namespace

ReducedSystem::ReducedSystem(const SourceSpace& space, std::vector<const spectral::DonaldsonMatrix*> materials)
    : space_(space), materials_(std::move(materials)) {
  const Eigen::Index bands = materials_.empty() ? 0 : materials_.front()->bands();
  const auto count = static_cast<Eigen::Index>(materials_.size());
  for (Eigen::Index b = 0; b < bands; ++b) {
    Eigen::VectorXd reflectance(count);
    for (Eigen::Index m = 0; m < count; ++m) reflectance[m] = materials_[static_cast<std::size_t>(m)]->reflectance[b];
    std::size_t f = 0;
    while (f < factors_.size() && factors_[f].reflectance != reflectance) ++f;
    if (f == factors_.size()) factors_.push_back({.reflectance = reflectance, .first_band = b, .lower = {}});
    factor_of_band_.push_back(f);
  }
  for (const spectral::DonaldsonMatrix* material : materials_) {
    if (!material->luminesces()) continue;
    luminesces_ = true;
    for (Eigen::Index b = 0; b < bands; ++b) {
      if ((material->luminescence.row(b).tail(bands - b).array() != 0.0).any()) stokes_only_ = false;
    }
  }
}

void ReducedSystem::restart() {
  for (Factor& factor : factors_) factor.lower.resize(0, 0);
}

Eigen::VectorXd ReducedSystem::per_source(const Eigen::VectorXd& per_material) const {
  Eigen::VectorXd values(space_.sources());
  for (std::size_t m = 0; m < space_.materials().size(); ++m) {
    for (const Eigen::Index j : space_.materials()[m].source) values[j] = per_material[static_cast<Eigen::Index>(m)];
  }
  return values;
}

void ReducedSystem::extend_factor(Factor& factor) const {
  const Eigen::Index old = factor.lower.rows();
  const Eigen::Index size = space_.sources();
  if (size == old) return;
  const Eigen::VectorXd root = per_source(factor.reflectance.cwiseSqrt());
  const Eigen::MatrixXd& exchange = space_.exchange();
  Eigen::MatrixXd rows = -(root.tail(size - old).asDiagonal() * exchange.bottomRows(size - old) * root.asDiagonal());
  rows.rightCols(size - old).diagonal().array() += 1.0;
  factor.lower.conservativeResize(size, size);
  factor.lower.rightCols(size - old).setZero();
  Eigen::MatrixXd left = rows.leftCols(old);
  factor.lower.topLeftCorner(old, old).triangularView<Eigen::Lower>().transpose().solveInPlace<Eigen::OnTheRight>(left);
  factor.lower.bottomLeftCorner(size - old, old) = left;
  const Eigen::LLT<Eigen::MatrixXd> corner(rows.rightCols(size - old) - left * left.transpose());
  const Eigen::MatrixXd corner_lower = corner.matrixL();
  if (corner.info() != Eigen::Success || !(corner_lower.diagonal().array().square().minCoeff() > kLeastPivot)) {
    throw_singular(factor.first_band);
  }
  factor.lower.bottomRightCorner(size - old, size - old) = corner_lower;
}

Eigen::MatrixXd ReducedSystem::scatter(const Factor& factor, const Eigen::MatrixXd& c) const {
  // With T y =: h and g = √S h the system is (I - √S T √S) g = √S T c: no division by S, which may be 0.
  const Eigen::VectorXd root = per_source(factor.reflectance.cwiseSqrt());
  Eigen::MatrixXd g = root.asDiagonal() * (space_.exchange() * c);
  factor.lower.triangularView<Eigen::Lower>().solveInPlace(g);
  factor.lower.triangularView<Eigen::Lower>().transpose().solveInPlace(g);
  return c + root.asDiagonal() * g;
}

void ReducedSystem::solve(const Eigen::MatrixXd& reflected_input, const Eigen::MatrixXd& luminescent_input,
                          double tolerance, Amplitudes& amplitudes) {
  const Eigen::Index size = space_.sources();
  const Eigen::Index bands = reflected_input.cols();
  amplitudes.reflected.resize(size, bands);
  tbb::parallel_for(std::size_t{0}, factors_.size(), [&](std::size_t f) {
    Factor& factor = factors_[f];
    extend_factor(factor);
    std::vector<Eigen::Index> mine;
    for (Eigen::Index b = 0; b < bands; ++b) {
      if (factor_of_band_[static_cast<std::size_t>(b)] == f) mine.push_back(b);
    }
    Eigen::MatrixXd c(size, static_cast<Eigen::Index>(mine.size()));
    for (std::size_t k = 0; k < mine.size(); ++k) c.col(static_cast<Eigen::Index>(k)) = reflected_input.col(mine[k]);
    const Eigen::MatrixXd y = scatter(factor, c);
    for (std::size_t k = 0; k < mine.size(); ++k)
      amplitudes.reflected.col(mine[k]) = y.col(static_cast<Eigen::Index>(k));
  });
  if (!luminesces_) return;
  const Eigen::Index known = amplitudes.luminescent.rows();
  amplitudes.luminescent.conservativeResize(size, bands);
  amplitudes.luminescent.bottomRows(size - known).setZero();
  sweep_luminescence(luminescent_input, tolerance, amplitudes);
}

void ReducedSystem::sweep_luminescence(const Eigen::MatrixXd& input, double tolerance, Amplitudes& amplitudes) const {
  const Eigen::Index bands = input.cols();
  // Irradiance of both histories at the sources; kept up to date band by band (Gauss-Seidel), so that purely
  // Stokes-shifted luminescence is solved exactly by one sweep.
  Eigen::MatrixXd irradiance = space_.exchange() * (amplitudes.reflected + amplitudes.luminescent);
  double last_change = 0.0;
  int growing = 0;
  for (int sweep = 0; sweep < kMaxSweeps; ++sweep) {
    double change = 0.0;
    double size = 0.0;
    for (Eigen::Index b = 0; b < bands; ++b) {
      Eigen::VectorXd c = input.col(b);
      for (std::size_t m = 0; m < materials_.size(); ++m) {
        if (!materials_[m]->luminesces()) continue;
        const Eigen::VectorXd emitted = materials_[m]->luminescence.row(b).transpose();
        for (const Eigen::Index j : space_.materials()[m].source) c[j] += irradiance.row(j).dot(emitted);
      }
      const Eigen::VectorXd y = scatter(factors_[factor_of_band_[static_cast<std::size_t>(b)]], c);
      change += (y - amplitudes.luminescent.col(b)).squaredNorm();
      size += y.squaredNorm();
      amplitudes.luminescent.col(b) = y;
      irradiance.col(b) = space_.exchange() * (amplitudes.reflected.col(b) + y);
    }
    change = std::sqrt(change);
    if (stokes_only_ || change <= tolerance * std::sqrt(size)) return;
    growing = sweep > 0 && !(change < last_change) ? growing + 1 : 0;
    // At rounding the change no longer falls either; that is the end, not divergence.
    if (growing > 0 && change <= 1e-14 * std::sqrt(size)) return;
    if (growing >= kGrowingSweeps || !std::isfinite(change)) {
      throw NumericalFailure(
          fmt::format("luminescence excites itself without end: each generation of re-emitted light is {:.3g} times "
                      "the one before. A "
                      "material emits more than it absorbs, or emits where it is excited (anti-Stokes) in a closed "
                      "scene; check the "
                      "warnings about its Donaldson matrix.",
                      change / last_change));
    }
    last_change = change;
  }
  throw NumericalFailure(
      fmt::format("luminescence coupled to shorter wavelengths did not settle in {} sweeps over the bands (last change "
                  "{:.3g}, wanted "
                  "{:.3g}). Check the anti-Stokes entries of the Donaldson matrices, or ask for a number of bounces.",
                  kMaxSweeps, last_change, tolerance));
}

}  // namespace interglow::radiosity
