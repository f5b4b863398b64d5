// SPDX-License-Identifier: GPL-3.0-or-later
/// Which triangles meet at which edges of an indexed triangle mesh.
#pragma once

#include <array>
#include <vector>

#include "mesh/triangle_mesh.h"

namespace interglow::mesh {

/// Edge k of triangle t runs from its corner k to its corner (k + 1) % 3 and has the index 3 t + k.
/// Entry 3 t + k: the edge of the neighbouring triangle that runs the other way, or -1 at a border.
/// @throws InvalidInput if an edge has three or more triangles, or two in the same direction, naming the points
/// Cost: O(n log n).
std::vector<int> opposite_edges(const std::vector<std::array<int, 3>>& triangles);

/// Gives each fan of triangles around a point a point of its own where several fans share one (bow ties), and drops
/// points without triangles. A mesh with neither is returned unchanged.
TriangleMesh separate_fans(const TriangleMesh& mesh);

inline int next_edge(int edge) { return edge % 3 == 2 ? edge - 2 : edge + 1; }
inline int previous_edge(int edge) { return edge % 3 == 0 ? edge + 2 : edge - 1; }

}  // namespace interglow::mesh
