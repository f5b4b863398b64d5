// SPDX-License-Identifier: GPL-3.0-or-later
/// The faces of a scene as obstacles: few large convex outlines instead of many small faces.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "radiosity/element_tree.h"
#include "radiosity/elements.h"

namespace interglow::radiosity {

/// An opaque, two-sided, planar convex outline.
struct Blocker {
  std::vector<Eigen::Vector3d> corner;  ///< counter-clockwise about `normal`
  Eigen::Vector3d normal;               ///< unit
  double offset = 0.0;                  ///< normal · x of its plane
  Box box;

  double height(const Eigen::Vector3d& p) const { return normal.dot(p) - offset; }
};

struct Blockers {
  std::vector<Blocker> blocker;
  std::vector<int> of_face;  ///< the blocker that a face is part of; -1: a face that can block nothing
};

/// Neighbouring faces of an object in one plane are merged where the union is convex: a cube of n x n quads a side
/// becomes six blockers. Faces with the whole scene on one side of their plane block nothing and are left out. Cost
/// O(faces log faces).
Blockers make_blockers(const Faces& faces, double flat);

}  // namespace interglow::radiosity
