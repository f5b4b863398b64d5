// SPDX-License-Identifier: GPL-3.0-or-later
/// Reads the triangle meshes that scanners and their software write: OBJ, PLY (ascii, binary), STL (ascii, binary),
/// OFF.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>

#include "diagnostics/error.h"
#include "mesh/triangle_mesh.h"

namespace interglow::mesh {

/// Settings of `read_scan`.
struct ReadParams {
  /// Millimetres per unit of the file: 1 for mm, 1000 for metres, 25.4 for inches. Finite, greater than 0.
  double mm_per_unit = 1.0;
  /// Refuse a file of which anything would be dropped, instead of dropping it with a warning.
  bool strict = false;
  /// A raw range image (PLY element range_grid) is triangulated between neighbouring samples; a triangle with an edge
  /// longer than this many median sample distances spans a depth step and is left out. Greater than 1.
  double range_grid_edge_ratio = 5.0;
};
void validate(const ReadParams& params);  ///< Throws InvalidParams, naming field, value and range.

/// What a file held and what of it was not used.
struct ReadReport {
  std::string format;                     ///< "OBJ", "PLY binary_little_endian", ...
  std::size_t points_in_file = 0;         ///< STL: corners before welding
  std::size_t faces_in_file = 0;          ///< faces of any number of corners; those made from strips or a range grid
  std::size_t polygons_triangulated = 0;  ///< faces with more than three corners
  std::size_t points_welded = 0;          ///< STL only: corners with bit-equal coordinates merged
  std::size_t unusable_points = 0;        ///< coordinates that are not finite or not numbers; dropped with their faces
  std::size_t faces_of_unusable_points = 0;
  std::size_t faces_with_bad_index = 0;  ///< corner index out of range; dropped
  std::size_t incomplete_faces = 0;      ///< fewer than three corners, or a corner that is not an index; dropped
  Warnings warnings;                     ///< one sentence for each kind of damage, with file, place and count
};

struct ScanFile {
  TriangleMesh mesh;  ///< all coordinates finite [mm], all indices in range; topology as in the file
  ReadReport report;
};

/// Reads a scan. Double precision throughout: coordinates far from the origin keep their digits.
///
/// The format is told by the content (PLY, OFF) or the extension (.obj, .stl); a binary STL by its size, since many
/// begin with "solid". Numbers are read whole or not at all: "1,5" is never 1. Polygons are fanned if convex,
/// ear-clipped otherwise. Points keep their order, triangles the order of their faces.
///
/// Refused: missing, empty or cut-off files; no points; no faces; counts that disagree with the bytes present (nothing
/// is allocated by them); indices out of range in PLY and OFF, where they mean that reading is out of step; index 0 in
/// OBJ (the writer counts from 0, so every index is shifted); decimal commas; more than half of the faces unusable; an
/// extent beyond 1e-6..1e9 mm; polygons of more than 2000 corners.
/// @throws InvalidInput  with file, line or byte, what was expected and what to do
/// @throws InvalidParams
/// Cost: linear in the file size (polygons of n corners that are not convex: n²).
[[nodiscard]] ScanFile read_scan(const std::filesystem::path& path, const ReadParams& params = {});

/// The same for the bytes of a file that is in memory already; `path` tells its format and name for messages.
[[nodiscard]] ScanFile read_scan_bytes(std::string_view bytes, const std::filesystem::path& path,
                                       const ReadParams& params = {});

}  // namespace interglow::mesh
