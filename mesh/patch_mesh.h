// SPDX-License-Identifier: GPL-3.0-or-later
/// The patches of one object: what light transport is computed on.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

namespace interglow::mesh {

/// A face: three or four points, counter-clockwise seen from the front; a triangle has -1 as its fourth entry.
/// Quads are planar and convex.
using Face = std::array<int, 4>;

constexpr int corner_count(const Face& face) { return face[3] < 0 ? 3 : 4; }

struct PatchMesh {
  std::vector<Eigen::Vector3d> points;  ///< mm
  std::vector<Face> faces;
  /// Unit normals of the smooth surface the patches stand for, one per corner of each face (a crease has several at one
  /// point); empty: the faces themselves are the surface (flat shading).
  std::vector<std::array<Eigen::Vector3d, 4>> corner_normals;
  /// No border: every edge has two faces. A closed object is one-sided.
  bool closed = false;
};

/// Vector area (area times unit normal) of a face [mm²].
Eigen::Vector3d vector_area(const PatchMesh& mesh, const Face& face);

/// Sum of the face areas [mm²].
double total_area(const PatchMesh& mesh);

/// True if every edge is shared by exactly two faces with opposite directions.
bool is_closed(const PatchMesh& mesh);

}  // namespace interglow::mesh
