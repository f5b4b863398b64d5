// SPDX-License-Identifier: GPL-3.0-or-later
/// What the readers of single formats hand to `read_scan`, which checks and triangulates it in one place.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "diagnostics/error.h"

namespace interglow::mesh::detail {

/// Faces with any number of corners, unchecked.
struct PolygonFile {
  std::string format;
  std::string place_name = "line";      ///< what `face_place` counts: "line" or "byte"
  std::vector<Eigen::Vector3d> points;  ///< file units; NaN where a line could not be read, so that numbering holds
  std::vector<int> corners;  ///< zero-based indices of all faces; may be out of range (INT_MAX: larger than int)
  std::vector<std::size_t> face_begin{0};  ///< face f has corners[face_begin[f] .. face_begin[f + 1])
  std::vector<std::size_t> face_place;     ///< where face f stands in the file
  bool bad_index_is_fatal = true;          ///< false where faces are independent lines that can be left out singly
  std::size_t points_in_file = 0;
  std::size_t points_welded = 0;
  std::size_t incomplete_faces = 0;  ///< malformed faces that were not stored
  Warnings warnings;

  void end_face(std::size_t place) {
    face_begin.push_back(corners.size());
    face_place.push_back(place);
  }
  void add_triangle(int a, int b, int c, std::size_t place) {
    corners.insert(corners.end(), {a, b, c});
    end_face(place);
  }
};

/// `name` is the file's name for messages; all throw InvalidInput.
PolygonFile read_obj(std::string_view bytes, const std::string& name);
PolygonFile read_ply(std::string_view bytes, const std::string& name, double range_grid_edge_ratio);
PolygonFile read_stl(std::string_view bytes, const std::string& name);
PolygonFile read_off(std::string_view bytes, const std::string& name);

/// An index read from a file as an int that fails the range check if it does not fit.
constexpr int clamped_index(long long index) {
  constexpr long long kMax = 2147483647;
  return static_cast<int>(index > kMax ? kMax : index < -1 ? -1 : index);
}

/// Triangles of a polygon (indices into `points`), appended to `triangles`: a fan if convex, else by ear clipping (the
/// best shaped ear first). Cost: n corners, if not convex n² (n³ at worst).
/// @pre at least three corners, indices in range, points finite
void triangulate_polygon(const std::vector<Eigen::Vector3d>& points, const int* corners, std::size_t count,
                         std::vector<std::array<int, 3>>& triangles);

}  // namespace interglow::mesh::detail
