// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/compression.h"

#include <Eigen/QR>
#include <cmath>
#include <utility>

namespace interglow::fitting {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

void TileQr::add(const MatrixXd& rows) {
  const Index columns = triangle_.cols();
  MatrixXd stacked(columns + rows.rows(), columns);
  stacked.topRows(columns) = triangle_;
  stacked.bottomRows(rows.rows()) = rows;
  const Eigen::HouseholderQR<Eigen::Ref<MatrixXd>> qr(stacked);
  triangle_ = stacked.topRows(columns).triangularView<Eigen::Upper>();
}

namespace {

/// Solves the own rows of a triangle for several right sides; a parameter without influence stays at 0.
MatrixXd solve_own(const MatrixXd& triangle, Index own, const MatrixXd& right) {
  MatrixXd result = right;
  for (Index k = own - 1; k >= 0; --k) {
    for (Index j = k + 1; j < own; ++j) result.row(k) -= triangle(k, j) * result.row(j);
    const double pivot = triangle(k, k);
    // Rounding of a column that the ones before it explain.
    if (std::abs(pivot) <= 1e-12 * triangle.col(k).head(k + 1).norm()) {
      result.row(k).setZero();
    } else {
      result.row(k) /= pivot;
    }
  }
  return result;
}

}  // namespace

VectorXd CompressedBands::own_step(std::size_t of_band, const VectorXd& shared_step, Index side) const {
  const MatrixXd& triangle = band[of_band];
  return solve_own(triangle, own,
                   triangle.block(0, own + shared + side, own, 1) - triangle.block(0, own, own, shared) * shared_step);
}

MatrixXd CompressedBands::own_response(std::size_t of_band) const {
  return solve_own(band[of_band], own, -band[of_band].block(0, own, own, shared));
}

CompressedBands join_bands(std::vector<MatrixXd> triangles, Index own, Index shared) {
  CompressedBands result;
  result.own = own;
  result.shared = shared;
  result.band = std::move(triangles);
  const Index columns = result.band.empty() ? shared : result.band.front().cols() - own;
  TileQr joined(columns);
  for (const MatrixXd& triangle : result.band) joined.add(triangle.bottomRightCorner(columns, columns));
  result.shared_triangle = joined.triangle();
  return result;
}

}  // namespace interglow::fitting
