// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/range_grid.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <utility>

namespace interglow::mesh::detail {

RangeGridTriangles triangulate_range_grid(const std::vector<Eigen::Vector3d>& points,
                                          const std::vector<int>& sample_of_cell, std::size_t columns,
                                          double edge_ratio) {
  const std::size_t rows = sample_of_cell.size() / columns;
  const auto sample = [&](std::size_t row, std::size_t column) { return sample_of_cell[row * columns + column]; };
  const auto distance = [&](int a, int b) { return (points[a] - points[b]).norm(); };

  std::vector<double> steps;
  for (std::size_t row = 0; row < rows; ++row) {
    for (std::size_t column = 0; column < columns; ++column) {
      const int here = sample(row, column);
      if (here < 0) continue;
      if (column + 1 < columns && sample(row, column + 1) >= 0)
        steps.push_back(distance(here, sample(row, column + 1)));
      if (row + 1 < rows && sample(row + 1, column) >= 0) steps.push_back(distance(here, sample(row + 1, column)));
    }
  }
  // Samples that are not finite would break the order that the median needs.
  std::erase_if(steps, [](double step) { return !(step >= 0.0); });
  RangeGridTriangles made;
  if (steps.empty()) return made;
  const auto median = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), median, steps.end());
  made.longest_edge = edge_ratio * *median;

  double area_toward_z = 0.0;
  const auto add = [&](int a, int b, int c) {
    if (!(std::max({distance(a, b), distance(b, c), distance(c, a)}) <= made.longest_edge)) {
      ++made.across_steps;
      return;
    }
    made.triangles.push_back({a, b, c});
    area_toward_z += (points[b] - points[a]).cross(points[c] - points[a]).z();
  };
  for (std::size_t row = 0; row + 1 < rows; ++row) {
    for (std::size_t column = 0; column + 1 < columns; ++column) {
      const std::array<int, 4> block{sample(row, column), sample(row, column + 1), sample(row + 1, column + 1),
                                     sample(row + 1, column)};
      const auto missing = std::count(block.begin(), block.end(), -1);
      if (missing == 1) {
        const auto gap = static_cast<std::size_t>(std::find(block.begin(), block.end(), -1) - block.begin());
        add(block[(gap + 1) % 4], block[(gap + 2) % 4], block[(gap + 3) % 4]);
      } else if (missing == 0) {
        const std::size_t first = distance(block[0], block[2]) <= distance(block[1], block[3]) ? 0 : 1;
        add(block[first], block[first + 1], block[first + 2]);
        add(block[first], block[first + 2], block[(first + 3) % 4]);
      }
    }
  }
  // Rows may run either way.
  if (area_toward_z < 0.0) {
    for (auto& triangle : made.triangles) std::swap(triangle[1], triangle[2]);
  }
  return made;
}

}  // namespace interglow::mesh::detail
