// SPDX-License-Identifier: GPL-3.0-or-later
/// How good patches are: their shapes, and how far they are from the scan they replace.
#pragma once

#include <array>
#include <vector>

#include "mesh/patch_mesh.h"
#include "mesh/surface_index.h"
#include "mesh/triangle_mesh.h"

namespace interglow::mesh {

/// Angles of all corners [degrees].
struct AngleStatistics {
  double minimum_deg = 0;
  double mean_minimum_deg = 0;    ///< mean over faces of the smallest angle; 60 for equilateral triangles
  double share_below_20_deg = 0;  ///< of faces whose smallest angle is below 20°
  double maximum_deg = 0;
};
AngleStatistics angle_statistics(const PatchMesh& patches);

/// Distances between two surfaces, measured at the points of one and the nearest points of the other, both ways.
struct SurfaceDistance {
  double rms_mm = 0;  ///< over both directions, each sample with the same weight
  double maximum_mm = 0;
};

/// Between a scan and the patches made from it. The scan is sampled at its points, the patches at corners and centres.
/// Cost: O((points + patches) log). Deterministic.
SurfaceDistance two_sided_distance(const TriangleMesh& scan, const PatchMesh& patches);

/// The triangles of a patch mesh; quads are cut along a diagonal.
std::vector<std::array<int, 3>> triangles_of(const PatchMesh& patches);

}  // namespace interglow::mesh
