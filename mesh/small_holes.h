// SPDX-License-Identifier: GPL-3.0-or-later
/// Closes the small holes of a scan.
#pragma once

#include "mesh/triangle_mesh.h"

namespace interglow::mesh {

struct HolesFilled {
  TriangleMesh mesh;
  int holes = 0;
};

/// Covers every border loop whose largest extent along an axis is at most `diameter_mm` by triangles between its own
/// points; the remesher then fits the surface across.
/// @pre     each point has one fan of triangles (`separate_fans`)
/// @throws  InvalidInput as `opposite_edges`
/// Cost: O(n log n), and up to the cube of a loop's length.
HolesFilled fill_small_holes(const TriangleMesh& mesh, double diameter_mm);

}  // namespace interglow::mesh
