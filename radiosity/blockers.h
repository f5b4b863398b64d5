// SPDX-License-Identifier: GPL-3.0-or-later
/// The faces of a scene as obstacles: few large convex bodies instead of many small faces.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "radiosity/element_tree.h"
#include "radiosity/elements.h"

namespace interglow::radiosity {

/// An opaque convex obstacle: a closed polyhedron, or a planar polygon seen from both sides.
struct ConvexBody {
  struct Face {
    Eigen::Vector3d normal;  ///< unit, outward
    double offset = 0.0;     ///< normal · x of its plane
    double height(const Eigen::Vector3d& p) const { return normal.dot(p) - offset; }
  };
  struct Edge {
    int a, b;         ///< vertices
    int face, other;  ///< the faces that meet in it; other is -1 in a polygon
  };
  std::vector<Eigen::Vector3d> vertex;  ///< of a polygon: its corners in order, counter-clockwise about its normal
  std::vector<Face> face;               ///< of a polygon: one
  std::vector<Edge> edge;
  bool solid = false;
  int object = 0;
  Box box = Box::empty();
};

/// Bounding boxes over the bodies of one object.
struct BodyTree {
  struct Node {
    Box box = Box::empty();
    int left = -1;  ///< children; -1: a leaf of one body
    int right = -1;
    int body = -1;
  };
  int object = 0;
  std::vector<Node> node;  ///< the root first
};

struct Blockers {
  std::vector<BodyTree> tree;  ///< one an object that has bodies
  std::vector<ConvexBody> body;
};

/// Neighbouring faces of an object in one plane are merged where the union is convex, and an object that is closed and
/// convex becomes one body: a cube of n x n quads a side is a body of six faces. Nothing is lost by it. Faces with the
/// whole scene on one side of their plane block nothing and are left out. Cost O(faces log faces).
Blockers make_blockers(const Elements& elements, double flat);

}  // namespace interglow::radiosity
