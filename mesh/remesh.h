// SPDX-License-Identifier: GPL-3.0-or-later
/// Scans to patches: fits the smooth surfaces behind the scans of a scene and covers them with well-shaped patches.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "diagnostics/progress.h"
#include "mesh/overlap.h"
#include "mesh/patch_mesh.h"
#include "mesh/quality.h"
#include "mesh/triangle_mesh.h"

namespace interglow::mesh {

/// How one object's scan becomes patches. Lengths in mm.
struct RemeshParams {
  /// The given triangles are the patches, exactly and flat; all other fields are then without effect.
  bool keep_triangles = false;
  /// Wanted number of patches, at least 4, met within about 10 %. Unset: `edge_length_mm`, or 4000 if that is unset
  /// too.
  std::optional<int> patches{};
  /// Wanted edge length away from other objects, > 0.
  std::optional<double> edge_length_mm{};
  /// Edges bent by more than this stay sharp [degrees], in (0, 180]; 180: none.
  double feature_angle_deg = 40;
  /// Standard deviation of the scan's noise across the surface, >= 0; 0: the points are exact. Unset: estimated.
  std::optional<double> noise_sigma_mm{};
  /// Smallest edge length near other objects over the largest, in (0, 1]; 1: the same everywhere.
  double proximity_ratio = 0.25;
  /// Edge length wanted at distance d from the nearest other object, over d; > 0.
  double proximity_slope = 1.0;
  /// Holes up to this diameter are closed; 0: none.
  double close_holes_mm = 0;
  /// Strips up to this wide that the scanner missed along a contact with another object are closed: both surfaces are
  /// continued smoothly to their common contact line; 0: left open.
  double close_contact_mm = 0;
};
/// @throws InvalidParams naming object, field, value and range
void validate(const RemeshParams& params, const std::string& name);

struct RemeshInput {
  std::string name;   ///< for messages
  TriangleMesh scan;  ///< repaired: at most two triangles an edge, consistently oriented
  RemeshParams params;
};

struct RemeshReport {
  int patches = 0;
  double edge_length_mm = 0;  ///< wanted, away from other objects
  double noise_sigma_mm = 0;  ///< given or estimated
  double scan_area_mm2 = 0;   ///< of the scan's triangles
  double patch_area_mm2 = 0;
  SurfaceDistance distance;      ///< between scan and patches
  double normal_change_deg = 0;  ///< RMS angle between the scan's triangles and the patches' normals over them
  AngleStatistics angles;
  std::size_t crossings = 0;  ///< pairs of the object's own patches that pass through each other
  int closed_holes = 0;
  double closed_contact_mm = 0;         ///< length of the contact lines to which the surface was continued
  Overlap scan_overlap, patch_overlap;  ///< between objects, before and after
  double fit_s = 0, remesh_s = 0;       ///< wall time
};

struct Remeshed {
  PatchMesh patches;
  RemeshReport report;
};

/// Patches for all objects of a scene. They are made together: sizes depend on neighbours, and where scans of touching
/// objects pass through each other both are moved apart.
///
/// Corners of the patches lie on the fitted surface, shifted outwards by the mean sagitta of the flat patches around
/// them, so that neither area nor volume shrinks with patch size (to first order).
/// @throws InvalidParams, InvalidInput (an object without triangles, non-manifold edges), Cancelled
/// Cost: O(points log points); about 8 s of processor time for two scans of 30,000 points to 8,000 patches.
/// Deterministic for any thread count.
std::vector<Remeshed> remesh(std::span<const RemeshInput> objects, const Progress& progress = {});

}  // namespace interglow::mesh
