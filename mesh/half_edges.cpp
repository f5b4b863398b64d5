// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/half_edges.h"

#include <fmt/format.h>

#include <algorithm>
#include <tuple>

#include "diagnostics/error.h"

namespace interglow::mesh {

std::vector<int> opposite_edges(const std::vector<std::array<int, 3>>& triangles) {
  struct Edge {
    int low, high, index;
  };
  std::vector<Edge> edges;
  edges.reserve(3 * triangles.size());
  for (std::size_t t = 0; t < triangles.size(); ++t)
    for (int k = 0; k < 3; ++k) {
      const int a = triangles[t][k], b = triangles[t][(k + 1) % 3];
      edges.push_back({std::min(a, b), std::max(a, b), static_cast<int>(3 * t) + k});
    }
  std::sort(edges.begin(), edges.end(), [](const Edge& x, const Edge& y) {
    return std::tie(x.low, x.high, x.index) < std::tie(y.low, y.high, y.index);
  });
  std::vector<int> opposite(edges.size(), -1);
  for (std::size_t i = 0; i < edges.size();) {
    std::size_t end = i + 1;
    while (end < edges.size() && edges[end].low == edges[i].low && edges[end].high == edges[i].high) ++end;
    const auto start = [&](std::size_t e) { return triangles[edges[e].index / 3][edges[e].index % 3]; };
    if (end - i > 2 || (end - i == 2 && start(i) == start(i + 1)))
      throw InvalidInput(
          fmt::format("The edge between points {} and {} has {} triangles{}; a surface has one or two, of opposite "
                      "direction. Repair the "
                      "mesh first.",
                      edges[i].low, edges[i].high, end - i, end - i == 2 ? " of the same direction" : ""));
    if (end - i == 2) {
      opposite[edges[i].index] = edges[i + 1].index;
      opposite[edges[i + 1].index] = edges[i].index;
    }
    i = end;
  }
  return opposite;
}

TriangleMesh separate_fans(const TriangleMesh& mesh) {
  const std::vector<int> opposite = opposite_edges(mesh.triangles);
  TriangleMesh result = mesh;
  std::vector<char> done(opposite.size(), 0);
  std::vector<char> used(mesh.points.size(), 0);
  for (std::size_t corner = 0; corner < done.size(); ++corner) {
    if (done[corner]) continue;
    const int point = mesh.triangles[corner / 3][corner % 3];
    int target = point;
    if (used[point]) {
      target = static_cast<int>(result.points.size());
      result.points.push_back(mesh.points[point]);
    }
    used[point] = 1;
    const auto take = [&](int edge) {
      done[edge] = 1;
      result.triangles[edge / 3][edge % 3] = target;
    };
    const int start = static_cast<int>(corner);
    take(start);
    int edge = start;
    while (opposite[previous_edge(edge)] >= 0) {
      edge = opposite[previous_edge(edge)];
      if (edge == start) break;
      take(edge);
    }
    for (edge = start; opposite[edge] >= 0;) {
      edge = next_edge(opposite[edge]);
      if (done[edge]) break;
      take(edge);
    }
  }
  used.resize(result.points.size(), 1);
  if (std::find(used.begin(), used.end(), 0) == used.end()) return result;
  std::vector<int> index(result.points.size(), -1);
  TriangleMesh compact;
  for (std::size_t i = 0; i < result.points.size(); ++i) {
    if (!used[i]) continue;
    index[i] = static_cast<int>(compact.points.size());
    compact.points.push_back(result.points[i]);
  }
  for (const auto& t : result.triangles) compact.triangles.push_back({index[t[0]], index[t[1]], index[t[2]]});
  return compact;
}

}  // namespace interglow::mesh
