// SPDX-License-Identifier: GPL-3.0-or-later
/// Replaces the triangles of a fitted surface by well-shaped ones of a wanted size.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "mesh/fitted_surface.h"
#include "mesh/surface_index.h"

namespace interglow::mesh {

/// Wanted edge length [mm] at a point of the fitted surface.
using EdgeLength = std::function<double(const SurfacePoint& at)>;

struct AdaptiveRemeshParams {
  EdgeLength edge_length;
  /// Wanted number of triangles: lengths are scaled after each round to approach it; unset: lengths hold as given.
  std::optional<int> triangles{};
  int rounds = 5;
  /// Creases whose sides, each averaged over one wanted length, meet at less than this are not followed: folds and
  /// roughness finer than the patches [degrees].
  double feature_angle_deg = 40;
  /// Curves turn by more than this at corners that stay where they are [degrees].
  double corner_angle_deg = 50;
  /// Wanted lengths grow by at most this per millimetre along the surface.
  double gradation = 0.4;
  /// Points of the surface that stay exactly where they are, and edges of the border between them that are neither
  /// split nor collapsed (curves shared with another object).
  std::vector<int> locked_points{};
};

struct RemeshedSurface {
  std::vector<Eigen::Vector3d> points;
  std::vector<std::array<int, 3>> triangles;
  std::vector<SurfacePoint> on_surface;  ///< per point, where on the fitted surface
  std::vector<char> is_locked;           ///< per point: one of `locked_points`
};

/// Rounds of splitting long edges, collapsing short ones, flipping to Delaunay, and moving points within the surface
/// [Botsch and Kobbelt 2004, "A remeshing approach to multiresolution modeling"], each with a local wanted length.
/// Creases and borders are resampled along themselves; their corners stay.
/// Deterministic; single-threaded. Cost: O(rounds · triangles · log triangles).
RemeshedSurface adaptive_remesh(const FittedSurface& surface, const SurfaceIndex& index,
                                const AdaptiveRemeshParams& params);

}  // namespace interglow::mesh
