// SPDX-License-Identifier: GPL-3.0-or-later
/// Turns any set of triangles into oriented manifold surfaces, by cutting and turning only.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "mesh/triangle_mesh.h"

namespace interglow::mesh::detail {

/// For each face and each of its edges (corner k to k + 1): 3 * face + edge on the other side, or -1 on a border.
using Neighbours = std::vector<std::array<int, 3>>;

struct Manifold {
  TriangleMesh mesh;
  std::size_t edges_split = 0;
  std::size_t points_split = 0;
  std::size_t unused_points = 0;
  std::size_t faces_turned = 0;
  std::size_t unorientable_edges = 0;
  std::size_t faces_detached = 0;
};

/// Joins faces at edges that two of them share; at an edge of more, joins the pairs that continue one another flattest,
/// those with agreeing orientations first. Turns faces to agree with the larger part of their component, cuts where
/// none can (keeping joints that agree as given), gives each fan of faces its own point and drops unused points.
/// @pre indices in range, no face with a repeated corner
Manifold make_manifold(const TriangleMesh& mesh);

/// @pre every edge has at most two faces, which run through it in opposite directions
Neighbours neighbours_across_edges(const TriangleMesh& manifold);

}  // namespace interglow::mesh::detail
