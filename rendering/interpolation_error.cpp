// SPDX-License-Identifier: GPL-3.0-or-later
#include "rendering/interpolation_error.h"

#include <Eigen/Eigenvalues>
#include <cmath>
#include <cstddef>
#include <limits>

namespace interglow::rendering {
namespace {

using Eigen::Vector3d;

constexpr int kFewestTriangles = 3;
/// Neighbours whose spread across the surface is this much smaller along one direction than along the other determine
/// no gradient.
constexpr double kFlattest = 1e-3;

}  // namespace

InterpolationError::InterpolationError(
    const std::vector<Vector3d>& positions,
    const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>& values,
    const std::vector<std::array<int, 3>>& triangles, const Eigen::VectorXd& weight)
    : position_(positions), value_(values), weight_(weight), known_(positions.size(), 0) {
  const auto count = static_cast<Eigen::Index>(positions.size());
  gradient_.setZero(3 * count, values.cols());
  std::vector<int> of_corner(positions.size(), 0);
  std::vector<Eigen::Matrix3d> spread(positions.size(), Eigen::Matrix3d::Zero());
  // Σ d dᵀ/|d|² g = Σ d Δv/|d|²: a neighbour counts as much as another at twice the distance.
  for (const std::array<int, 3>& triangle : triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      const int at = triangle[k];
      ++of_corner[static_cast<std::size_t>(at)];
      for (const int to : {triangle[(k + 1) % 3], triangle[(k + 2) % 3]}) {
        const Vector3d d = positions[static_cast<std::size_t>(to)] - positions[static_cast<std::size_t>(at)];
        const double squared = d.squaredNorm();
        if (!(squared > 0.0)) continue;
        spread[static_cast<std::size_t>(at)] += d * d.transpose() / squared;
        gradient_.middleRows(3 * at, 3) += d / squared * (values.row(to) - values.row(at));
      }
    }
  }
  for (Eigen::Index p = 0; p < count; ++p) {
    const auto at = static_cast<std::size_t>(p);
    if (of_corner[at] < kFewestTriangles) continue;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(spread[at]);
    const Vector3d size = eigen.eigenvalues();
    if (!(size[1] > kFlattest * size[2])) continue;
    known_[at] = 1;
    // In the plane that the neighbours span.
    const Eigen::Matrix<double, 3, 2> plane = eigen.eigenvectors().rightCols<2>();
    const Eigen::Matrix3d inverse = plane * size.tail<2>().cwiseInverse().asDiagonal() * plane.transpose();
    gradient_.middleRows(3 * p, 3) = (inverse * gradient_.middleRows(3 * p, 3)).eval();
  }
}

double InterpolationError::at_middle(int from, int to) const {
  const auto a = static_cast<std::size_t>(from);
  const auto b = static_cast<std::size_t>(to);
  if (known_[a] == 0 || known_[b] == 0) return std::numeric_limits<double>::infinity();
  const Vector3d edge = position_[b] - position_[a];
  double sum = 0.0;
  for (Eigen::Index c = 0; c < value_.cols(); ++c) {
    const double from_slope = edge.dot(gradient_.col(c).segment<3>(3 * from));
    const double to_slope = edge.dot(gradient_.col(c).segment<3>(3 * to));
    const double rise = value_(to, c) - value_(from, c);
    sum +=
        weight_[c] * (0.125 * std::abs(from_slope - to_slope) + 0.25 * std::abs(rise - 0.5 * (from_slope + to_slope)));
  }
  return sum;
}

}  // namespace interglow::rendering
