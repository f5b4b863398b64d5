// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/small_holes.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <set>
#include <utility>

#include "mesh/half_edges.h"
#include "mesh/hole_filling.h"

namespace interglow::mesh {

HolesFilled fill_small_holes(const TriangleMesh& mesh, double diameter_mm) {
  HolesFilled result{mesh, 0};
  const std::vector<int> opposite = opposite_edges(mesh.triangles);
  const auto start = [&](std::size_t e) { return mesh.triangles[e / 3][e % 3]; };
  const auto end = [&](std::size_t e) { return mesh.triangles[e / 3][(e % 3 + 1) % 3]; };
  std::vector<int> next(mesh.points.size(), -1);
  for (std::size_t e = 0; e < opposite.size(); ++e)
    if (opposite[e] < 0) next[end(e)] = start(e);  // a hole runs against its triangles
  std::set<std::pair<int, int>> edges;             // between border points: what a cover must not double
  for (std::size_t e = 0; e < opposite.size(); ++e)
    if (opposite[e] >= 0 && next[start(e)] >= 0 && next[end(e)] >= 0) edges.insert(std::minmax(start(e), end(e)));

  for (int first = 0; first < static_cast<int>(next.size()); ++first) {
    std::vector<int> loop;
    Eigen::AlignedBox3d box;
    for (int v = first; next[v] >= 0;) {
      loop.push_back(v);
      box.extend(mesh.points[v]);
      v = std::exchange(next[v], -1);
    }
    if (loop.size() < 3 || box.sizes().maxCoeff() > diameter_mm) continue;
    std::vector<Eigen::Vector3d> corners;
    for (int v : loop) corners.push_back(mesh.points[v]);
    std::vector<std::array<int, 3>> cover = detail::span_loop(corners);
    bool is_new = !cover.empty();
    for (auto& t : cover) {
      for (int& v : t) v = loop[v];
      for (int k = 0; k < 3; ++k) is_new = is_new && !edges.contains(std::minmax(t[k], t[(k + 1) % 3]));
    }
    if (!is_new) continue;  // a diagonal exists already on the other side
    for (const auto& t : cover)
      for (int k = 0; k < 3; ++k) edges.insert(std::minmax(t[k], t[(k + 1) % 3]));
    result.mesh.triangles.insert(result.mesh.triangles.end(), cover.begin(), cover.end());
    ++result.holes;
  }
  return result;
}

}  // namespace interglow::mesh
