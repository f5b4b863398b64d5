// SPDX-License-Identifier: GPL-3.0-or-later
/// Smaller faces on exactly the same surface.
#pragma once

#include "mesh/patch_mesh.h"

namespace interglow::mesh {

/// Divides every face into congruent ones (parallelograms; other quads into similar rows) whose edges are at most
/// `edge_length_mm` long: a triangle into n², a quad into m × n, each by its own edges. The surface stays the same to
/// rounding; corner normals are interpolated and normalised. Points on an edge are shared where both sides divide it
/// alike; elsewhere the finer side has points inside the coarser side's edge, which light transport does not mind.
/// @throws InvalidParams unless edge_length_mm is positive and finite, or if more than 50 million faces would result
/// Cost O(faces made).
PatchMesh subdivide(const PatchMesh& mesh, double edge_length_mm);

}  // namespace interglow::mesh
