// SPDX-License-Identifier: GPL-3.0-or-later
/// What repair takes from CGAL, kept to one source file.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <vector>

#include "mesh/triangle_mesh.h"

namespace interglow::mesh::detail {

/// Triangles that span a closed loop of points (positions in `loop`), with the loop's direction; minimal in the worst
/// dihedral angle, then in area (CGAL). Empty if there is none. Cost: about n² for n points, n³ at worst.
std::vector<std::array<int, 3>> span_loop(const std::vector<Eigen::Vector3d>& loop);

/// Pairs of triangles that meet without having a corner (by position) in common; exact predicates.
std::size_t count_self_intersections(const TriangleMesh& mesh);

}  // namespace interglow::mesh::detail
