// SPDX-License-Identifier: GPL-3.0-or-later
/// Millions of residuals compressed exactly to a triangle: least squares needs no more of them.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace interglow::fitting {

/// The triangular factor R of a tall matrix A = Q R whose rows come in tiles; RᵀR = AᵀA, without squaring the
/// condition. Q is never kept. Rows are taken in the order they come, so the bits do not depend on threads.
class TileQr {
 public:
  explicit TileQr(Eigen::Index columns) : triangle_(Eigen::MatrixXd::Zero(columns, columns)) {}

  /// @param rows  any number of them. Cost O(rows × columns²).
  void add(const Eigen::MatrixXd& rows);
  const Eigen::MatrixXd& triangle() const { return triangle_; }

 private:
  Eigen::MatrixXd triangle_;
};

/// min |J x - r|² with parameters of their own for each band: columns (own, shared, right sides) of every band's
/// triangle.
struct CompressedBands {
  Eigen::Index own = 0;               ///< parameters of one band alone
  Eigen::Index shared = 0;            ///< parameters of all bands
  std::vector<Eigen::MatrixXd> band;  ///< triangles
  /// What remains for the shared parameters and right sides after the own ones have taken what they can.
  Eigen::MatrixXd shared_triangle;

  /// Own parameters of a band that go with a shared step, for right side `side`.
  Eigen::VectorXd own_step(std::size_t of_band, const Eigen::VectorXd& shared_step, Eigen::Index side = 0) const;
  /// How the own parameters move with the shared ones, own x shared.
  Eigen::MatrixXd own_response(std::size_t of_band) const;
};

/// Eliminates the own parameters, band by band in order. An own column that is 0 stays 0.
CompressedBands join_bands(std::vector<Eigen::MatrixXd> triangles, Eigen::Index own, Eigen::Index shared);

}  // namespace interglow::fitting
