// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/patch_mesh.h"

#include <Eigen/Geometry>
#include <map>
#include <utility>

namespace interglow::mesh {

Eigen::Vector3d vector_area(const PatchMesh& mesh, const Face& face) {
  const auto& a = mesh.points[static_cast<std::size_t>(face[0])];
  const auto& b = mesh.points[static_cast<std::size_t>(face[1])];
  const auto& c = mesh.points[static_cast<std::size_t>(face[2])];
  if (corner_count(face) == 3) return 0.5 * (b - a).cross(c - a);
  return 0.5 * (c - a).cross(mesh.points[static_cast<std::size_t>(face[3])] - b);
}

double total_area(const PatchMesh& mesh) {
  double area = 0.0;
  for (const Face& face : mesh.faces) area += vector_area(mesh, face).norm();
  return area;
}

bool is_closed(const PatchMesh& mesh) {
  std::map<std::pair<int, int>, int> directed_edges;
  for (const Face& face : mesh.faces) {
    const int corners = corner_count(face);
    for (int k = 0; k < corners; ++k) {
      const int from = face[static_cast<std::size_t>(k)];
      const int to = face[static_cast<std::size_t>((k + 1) % corners)];
      if (++directed_edges[{from, to}] > 1) return false;
    }
  }
  for (const auto& [edge, count] : directed_edges) {
    if (!directed_edges.contains({edge.second, edge.first})) return false;
  }
  return !mesh.faces.empty();
}

}  // namespace interglow::mesh
