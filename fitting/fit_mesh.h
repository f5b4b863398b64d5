// SPDX-License-Identifier: GPL-3.0-or-later
/// Faces made fine where a fit's picture needs it: round bodies, contacts.
#pragma once

#include "scene/scene.h"

namespace interglow::fitting {

struct FitMeshParams {
  /// Edges over which the smooth normal turns by more are halved, in [0.5, 90].
  double most_turn_deg = 5.0;
  /// Times that faces beside a contact are halved towards it, in [0, 6].
  int contact_halvings = 2;
  /// Turns larger than the above stay, and contacts get fewer halvings, where an object would otherwise have more faces
  /// than this, unless it has them already. At least 1.
  int most_faces = 3000;
};

void validate(const FitMeshParams& params);  ///< Throws InvalidParams, naming field, value and range.

/// The scene with more faces, in three steps:
///  1. Edges of smooth objects are halved at the middle of the cubic that meets both normals at right angles; the error
///     of that middle is O(turn⁴) of the radius.
///  2. Faces are cut along the lines on which other objects touch or cross them: radiosity jumps there, from what lies
///     beside the other object to what it hides.
///  3. Faces near another object whose fronts see one another are halved in the direction in which their distance
///     changes, until they are no longer than that distance, and along cusps beside their ends, where light falls in.
/// Neighbours that a new point lies on are split there, so that no edge ends within another.
/// Cost O(faces of one object × faces of the others) box tests and O(faces log faces).
scene::Scene fit_mesh(const scene::Scene& scene, const FitMeshParams& params);

}  // namespace interglow::fitting
