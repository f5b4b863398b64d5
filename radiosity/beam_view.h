// SPDX-License-Identifier: GPL-3.0-or-later
/// The faces of a scene as a parallel beam sees them.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "radiosity/elements.h"

namespace interglow::radiosity {

/// Finds how much of a face a parallel beam reaches, exactly: what lies nearer to the light is cut out of it in the
/// plane across the beam, in double precision. All faces are opaque from both sides. A face does not hide itself, and
/// what lies in its plane hides nothing of it, so that neighbours on a surface shadow one another only where they stand
/// out.
class BeamView {
 public:
  /// @param direction  unit vector along which the light travels. Cost O(faces log faces).
  BeamView(const Faces& faces, const Eigen::Vector3d& direction);

  /// Area of the lit part of a face, projected along the beam [mm²]: ∫ V |cosθ| dA.
  /// @param normal  unit normal of the side looked at; 0 is returned if it faces away from the light
  /// Cost O(log faces + pieces × blockers), blockers: faces that the beam meets together with this one.
  double lit_area(int face, const Eigen::Vector3d& normal) const;

  /// The same part as disjoint convex outlines, counter-clockwise, in coordinates along axis_u() and axis_v() relative
  /// to the face's first corner; empty where nothing is lit.
  std::vector<std::vector<Eigen::Vector2d>> lit_outlines(int face, const Eigen::Vector3d& normal) const;
  const Eigen::Vector3d& axis_u() const { return u_; }
  const Eigen::Vector3d& axis_v() const { return v_; }

 private:
  struct Box {
    Eigen::Array2d low;
    Eigen::Array2d high;
    double top = 0.0;  ///< largest height towards the light
  };
  struct Node {
    Box box;
    int first = 0;  ///< leaf: first entry of order_; inner: left child, the right one follows the left subtree
    int count = 0;  ///< 0: inner node
    int right = 0;
  };

  int build(int first, int count);
  /// What of a face stands in front of a plane, as a convex outline across the beam relative to `origin`, a point of
  /// the plane; counter-clockwise. Empty if nothing does.
  std::vector<Eigen::Vector2d> shadow_of(int face, const Eigen::Vector3d& origin, const Eigen::Vector3d& normal) const;
  Eigen::Vector2d across(const Eigen::Vector3d& point) const { return {u_.dot(point), v_.dot(point)}; }

  const Faces& faces_;
  Eigen::Vector3d direction_;
  Eigen::Vector3d u_;
  Eigen::Vector3d v_;
  std::vector<Box> box_;
  std::vector<int> order_;
  std::vector<Node> nodes_;
};

}  // namespace interglow::radiosity
