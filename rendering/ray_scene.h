// SPDX-License-Identifier: GPL-3.0-or-later
/// First hits and occlusion among the faces of a scene.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>

#include "radiosity/elements.h"

namespace interglow::rendering {

/// A segment (or half-line) asked for blockers.
///
/// Embree works in single precision, so a face that the segment starts or ends on could be reported as a blocker. Such
/// a face is recognised by geometry and not by a minimum distance: a face whose plane contains the start hides nothing
/// from it, and one whose plane contains the end does not hide that end.
struct Segment {
  Eigen::Vector3d from;    ///< mm
  Eigen::Vector3d to;      ///< mm; the direction of a half-line
  bool half_line = false;  ///< `to` is a direction, not a point
  int start_face = -1;     ///< face that `from` belongs to; never a blocker. -1: none
};

/// Embree's search tree over all faces, both sides opaque. Coordinates are centred and scaled by a power of two, so
/// that results do not depend on units.
class RayScene {
 public:
  explicit RayScene(const radiosity::Faces& faces);
  ~RayScene();
  RayScene(RayScene&&) noexcept;
  RayScene& operator=(RayScene&&) noexcept;

  /// First face along each half-line from `origin`; -1: none.
  void first_faces(const Eigen::Vector3d& origin, std::span<const Eigen::Vector3d> directions,
                   std::span<int> face) const;

  /// 1 where something lies between.
  void blocked(std::span<const Segment> segments, std::span<char> result) const;

  /// Half the diagonal of the scene's bounding box [mm].
  double radius_mm() const;
  /// Distance that single precision cannot tell from 0 in this scene [mm].
  double resolution_mm() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace interglow::rendering
