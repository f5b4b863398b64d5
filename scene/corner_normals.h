// SPDX-License-Identifier: GPL-3.0-or-later
/// Normals of the smooth surface behind given faces.
#pragma once

#include <array>
#include <vector>

#include "mesh/patch_mesh.h"

namespace interglow::scene {

/// One unit normal per corner: the mean of the normals of the faces around its point that differ from the corner's own
/// face by at most `feature_angle_deg`, weighted with their angles there (so that cutting a face in two changes
/// nothing). Cost O(faces × faces around a point).
std::vector<std::array<Eigen::Vector3d, 4>> corner_normals(const mesh::PatchMesh& mesh, double feature_angle_deg);

}  // namespace interglow::scene
