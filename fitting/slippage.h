// SPDX-License-Identifier: GPL-3.0-or-later
/// Motions that carry a scene's surfaces into themselves: no picture tells how far such a motion has gone.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "scene/scene.h"

namespace interglow::fitting {

/// Velocity turn × (p - pivot) + shift of a point p.
struct Slip {
  Eigen::Vector3d turn;   ///< [rad]
  Eigen::Vector3d shift;  ///< of the pivot [mm]
};

struct Slippage {
  std::vector<Slip> slips;  ///< a basis, turns and shifts over the objects' size orthonormal
  std::string body;         ///< "a sphere about (0.0, 0.0, 5.0) mm", "a body of revolution", …; empty without slips
};

/// Local slippage analysis (Gelfand and Guibas, "Shape segmentation using local slippage analysis", SGP 2004): the
/// motions whose velocity has no part along the normals. The normals are those of the smooth surface (corner normals,
/// or means over the faces at a point), so that facets of a round body, which are errors of its mesh, determine
/// nothing. Borders hold a motion across them. Cost O(faces).
Slippage slippage(const scene::Scene& scene, const Eigen::Vector3d& pivot);

}  // namespace interglow::fitting
