// SPDX-License-Identifier: GPL-3.0-or-later
/// Faces made finer where light changes quickly: round bodies, contacts.
#pragma once

#include <span>

#include "mesh/patch_mesh.h"

namespace interglow::mesh {

/// Another object, which may touch or cross the one whose faces are cut.
struct OtherSurface {
  const PatchMesh* patches = nullptr;
  bool two_sided = false;
};

/// Halves edges of a mesh with corner normals over which the normal turns by more than `most_turn_deg`, at the middle
/// of the cubic that meets both normals at right angles; the error of that middle is O(turn⁴) of the radius. Flat
/// meshes stay as they are. Neighbours that a new point lies on are split there, so that no edge ends within another.
/// @pre 0.5 <= most_turn_deg <= 180. Cost O(faces log faces)
PatchMesh halve_turns(const PatchMesh& mesh, double most_turn_deg);

/// Cuts faces along the lines on which other objects touch or cross them: radiosity jumps there, from what lies beside
/// the other object to what it hides. Then halves faces near another object whose fronts see one another in the
/// direction in which their distance changes, until they are no longer than that distance, at most `halvings` times,
/// and as often along cusps beside their ends, where light falls in.
/// The surface stays the same. Neighbours are split as above.
/// Cost O(faces × faces of the others) box tests and O(faces log faces).
PatchMesh follow_contacts(const PatchMesh& mesh, std::span<const OtherSurface> others, int halvings);

}  // namespace interglow::mesh
