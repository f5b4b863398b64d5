// SPDX-License-Identifier: GPL-3.0-or-later
/// Triangles between the neighbouring samples of a range image.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <vector>

namespace interglow::mesh::detail {

struct RangeGridTriangles {
  std::vector<std::array<int, 3>> triangles;  ///< counter-clockwise seen from +z, where the scanner stands
  std::size_t across_steps = 0;               ///< triangles left out for an edge longer than `longest_edge`
  double longest_edge = 0.0;
};

/// Joins each block of 2 x 2 cells with three or four samples; a block of four is cut along its shorter diagonal.
/// A triangle with an edge longer than `edge_ratio` times the median distance of neighbouring samples is left out.
/// @param sample_of_cell  row by row, index into `points` or -1 where the scanner saw nothing
RangeGridTriangles triangulate_range_grid(const std::vector<Eigen::Vector3d>& points,
                                          const std::vector<int>& sample_of_cell, std::size_t columns,
                                          double edge_ratio);

}  // namespace interglow::mesh::detail
