// SPDX-License-Identifier: GPL-3.0-or-later
/// The scene that is checked: what both methods solve, down to the same flat faces.
#pragma once

#include "mesh/patch_mesh.h"
#include "scene/scene.h"

namespace interglow::verification {

/// The scene with its faces as the surface (no corner normals), and a camera of the same view with `largest_side_px`
/// pixels on its longer side (never more than it had).
scene::Scene check_scene(const scene::Scene& scene, int largest_side_px);

/// Every triangle in four, every quad in four by the midpoints of its edges; the same surface, flat. Points on shared
/// edges are shared. Cost O(faces log faces).
mesh::PatchMesh halved(const mesh::PatchMesh& mesh);
scene::Scene halved(const scene::Scene& scene);

/// Faces of all objects.
std::size_t patch_count(const scene::Scene& scene);

/// Widths of the camera's bands [nm].
Eigen::VectorXd camera_band_widths_nm(const scene::Scene& scene);

}  // namespace interglow::verification
