// SPDX-License-Identifier: GPL-3.0-or-later
/// How far a function on a triangulated surface departs from linear interpolation, guessed from its values at the
/// corners.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

namespace interglow::rendering {

class InterpolationError {
 public:
  /// @param positions  of the corners [mm]
  /// @param values     corners x channels
  /// @param triangles  indices of corners
  /// @param weight     size of one unit of each channel, >= 0
  /// Fits a gradient to the neighbours of every corner. Cost O(triangles x channels).
  InterpolationError(const std::vector<Eigen::Vector3d>& positions,
                     const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>& values,
                     const std::vector<std::array<int, 3>>& triangles, const Eigen::VectorXd& weight);

  /// Error of linear interpolation at the middle of an edge, in the unit of the weight: that of the cubic with the
  /// values and slopes at the ends, |g_a·e - g_b·e| / 8, and a quarter of the rise that the slopes leave unexplained
  /// (a kink in between), summed over the channels. Infinite where a corner has fewer than three triangles: its slope
  /// would follow from the values that it is to explain.
  double at_middle(int from, int to) const;

 private:
  const std::vector<Eigen::Vector3d>& position_;
  const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>& value_;
  Eigen::VectorXd weight_;
  std::vector<char> known_;
  /// Three rows a corner: the gradient.
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> gradient_;
};

}  // namespace interglow::rendering
