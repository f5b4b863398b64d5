// SPDX-License-Identifier: GPL-3.0-or-later
/// An indexed set of triangles, as scanned: nothing is promised about its topology.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

namespace interglow::mesh {

struct TriangleMesh {
  std::vector<Eigen::Vector3d> points;          ///< mm
  std::vector<std::array<int, 3>> triangles;    ///< counter-clockwise seen from the front
};

}  // namespace interglow::mesh
