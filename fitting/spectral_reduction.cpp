// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/spectral_reduction.h"

#include <Eigen/SVD>
#include <algorithm>
#include <numbers>

namespace interglow::fitting {
namespace {

using radiosity::RowMatrix;

// At most this share of what leaves a surface meets another one; deeper bounces count less by it each.
constexpr double kBounceShare = 0.7;
constexpr int kMostBounces = 60;
/// By which the lamp's spectrum and its first reflections count more than what follows.
constexpr double kFirst = 100.0;

/// Rows that span the same space up to `least`, scaled by their singular values.
RowMatrix compressed(const RowMatrix& rows, double least) {
  if (rows.rows() == 0) return rows;
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(rows, Eigen::ComputeThinU | Eigen::ComputeThinV);
  Eigen::Index rank = 0;
  while (rank < svd.singularValues().size() && svd.singularValues()[rank] > least) ++rank;
  return svd.singularValues().head(rank).asDiagonal() * svd.matrixV().leftCols(rank).transpose();
}

RowMatrix leaving(const RowMatrix& arriving, const spectral::DonaldsonMatrix& donaldson) {
  RowMatrix result = arriving * donaldson.reflectance.asDiagonal();
  if (donaldson.luminesces()) result += arriving * donaldson.luminescence.transpose();
  return result;
}

}  // namespace

SpectralReduction reduce_spectra(const scene::Scene& scene, const Eigen::VectorXd& light, double tolerance) {
  SpectralReduction result;
  const Eigen::Index bands = scene.grid.size();
  const int first = scene.camera.first_band;
  const int last = scene.camera.last_band < 0 ? static_cast<int>(bands) - 1 : scene.camera.last_band;
  result.wavelength_nm = scene.grid.centers_nm().segment(first, last - first + 1);

  const auto bounce = [&](const RowMatrix& arriving) {
    RowMatrix all(0, bands);
    for (const spectral::Material& material : scene.materials) {
      const RowMatrix one = leaving(arriving, material.donaldson);
      all.conservativeResize(all.rows() + one.rows(), bands);
      all.bottomRows(one.rows()) = one;
    }
    return all;
  };
  RowMatrix arriving = bounce(light.transpose());
  const double largest = arriving.rowwise().norm().maxCoeff();
  RowMatrix all(1 + arriving.rows(), bands);
  all.row(0) = light.transpose() * std::min(1.0, largest / light.norm());
  all.bottomRows(arriving.rows()) = arriving;
  all *= kFirst;
  for (int k = 1; k < kMostBounces && arriving.rows() > 0; ++k) {
    arriving = compressed(kBounceShare * bounce(arriving), 0.1 * tolerance * largest);
    all.conservativeResize(all.rows() + arriving.rows(), bands);
    all.bottomRows(arriving.rows()) = arriving;
    all = compressed(all, 0.1 * tolerance * largest);
  }
  result.spectrum = compressed(all, tolerance * largest);
  for (Eigen::Index r = 0; r < result.modes(); ++r) result.spectrum.row(r).normalize();

  result.light = light.transpose() * result.spectrum.transpose();
  result.palette = result.spectrum.middleCols(first, last - first + 1) / std::numbers::pi;
  for (const spectral::Material& material : scene.materials) {
    const RowMatrix direct = leaving(light.transpose(), material.donaldson);
    const RowMatrix indirect = leaving(result.spectrum, material.donaldson);
    result.from_direct.emplace_back(direct * result.spectrum.transpose());
    result.from_indirect.emplace_back(indirect * result.spectrum.transpose());
  }
  return result;
}

}  // namespace interglow::fitting
