// SPDX-License-Identifier: GPL-3.0-or-later
/// Makes of scanned triangles a surface that everything downstream may rely on, and says in numbers what it changed.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "diagnostics/error.h"
#include "mesh/triangle_mesh.h"

namespace interglow::mesh {

/// Settings of `repair`.
struct RepairParams {
  /// Points nearer than this share of the bounding box's diagonal become one; in (0, 0.01]. Unset: only equal points.
  std::optional<double> weld_distance{};
  /// Pieces with less than this share of the whole area are removed; in [0, 1). 0 keeps everything.
  double smallest_component_share = 1e-3;
  /// Turns closed pieces so that their front is outside (a piece inside another closed one, a cavity, stays as given).
  /// False for a room seen from inside.
  bool closed_outward = true;
  /// Fills every hole with at most this many edges; in [3, 5000]. Unset: none. An open sheet's outer border is a hole
  /// too.
  std::optional<int> fill_holes_up_to_edges{};
  /// Counts pairs of triangles that cross without having a corner in common; costs more than all the rest.
  bool count_self_intersections = false;
};
void validate(const RepairParams& params);  ///< Throws InvalidParams, naming field, value and range.

/// A loop of edges with one face: a hole, or the outer border of a sheet.
struct BorderLoop {
  int edges = 0;
  double length_mm = 0.0;
  double area_mm2 = 0.0;  ///< length of the loop's vector area: exact for a flat loop, less for a bent one
};

/// What was changed and what remains.
struct RepairReport {
  std::size_t points_merged = 0;
  std::size_t unused_points_removed = 0;
  std::size_t faces_with_repeated_corner_removed = 0;
  std::size_t duplicate_faces_removed = 0;  ///< the same three points, in either orientation
  std::size_t flat_faces_removed = 0;       ///< without area; removed where no crack opens
  std::size_t flat_faces_flipped = 0;       ///< without area; joined to the neighbour across their longest edge
  std::size_t edges_split = 0;              ///< three or more faces; the flattest pairs stay joined
  std::size_t points_split = 0;             ///< copies made where fans of faces met in a point only
  std::size_t faces_turned = 0;             ///< reversed to agree with their neighbours
  std::size_t unorientable_edges_cut = 0;   ///< as on a Moebius strip
  std::size_t faces_detached = 0;           ///< cut out singly where nothing else makes the surface manifold
  std::size_t components_turned_outward = 0;
  std::size_t components_removed = 0;
  std::size_t faces_of_removed_components = 0;
  std::size_t holes_filled = 0;
  std::size_t faces_added = 0;

  std::size_t components = 0;
  bool closed = false;              ///< no border; one-sided
  std::vector<BorderLoop> borders;  ///< longest first; also those that an open sheet must have
  double area_mm2 = 0.0;
  std::optional<std::size_t> self_intersections{};  ///< pairs of triangles, if they were to be counted

  Warnings warnings;  ///< one sentence for each kind of damage found; borders alone are no damage
};

struct Repaired {
  /// Every edge has one face, or two with opposite directions; the faces around each point form one fan; every triangle
  /// has three different points and a height above 1e-8 of its longest edge; every point is used. Points keep their
  /// order.
  TriangleMesh mesh;
  RepairReport report;
};

/// Repairs a surface; an already sound one comes back unchanged.
///
/// @pre     points finite, indices in range (as `read_scan` promises)
/// @throws  InvalidInput if nothing with an area is left; InvalidParams
/// Cost: O(n log n) (holes: see `fill_holes_up_to_edges`). Deterministic, independent of the number of threads.
[[nodiscard]] Repaired repair(TriangleMesh mesh, const RepairParams& params = {});

}  // namespace interglow::mesh
