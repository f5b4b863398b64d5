// SPDX-License-Identifier: GPL-3.0-or-later
/// Removes triangles without area, without opening cracks.
#pragma once

#include <cstddef>

#include "mesh/triangle_mesh.h"

namespace interglow::mesh::detail {

struct FlatFaces {
  TriangleMesh mesh;  ///< same points, some unused now
  std::size_t points_merged = 0;
  std::size_t repeated_corner = 0;  ///< removed
  std::size_t duplicates = 0;       ///< removed; the first of them stays
  std::size_t removed = 0;
  std::size_t flipped = 0;
};

/// Removes faces with a repeated corner and faces that are there already, then those without area (height at most 1e-8
/// of the longest edge, the rounding of single-precision files): where two corners coincide in this sense they are
/// merged; where a corner lies on the opposite edge, that edge is flipped with the face on its other side, and with no
/// such face the triangle is dropped.
FlatFaces remove_flat_faces(TriangleMesh mesh);

}  // namespace interglow::mesh::detail
