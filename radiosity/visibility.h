// SPDX-License-Identifier: GPL-3.0-or-later
/// Rays against the faces of a scene. The only part of radiosity that knows Embree.
///
/// The search runs in single precision on centred and scaled coordinates; what it finds is decided again in double
/// precision. A face that a ray starts or ends on is left out by its identity, never by an offset along the ray,
/// so that results do not depend on the unit of length.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <span>

#include "radiosity/elements.h"

namespace interglow::radiosity {

/// Where a ray meets a face first.
struct RayHit {
  int face = -1;
  double distance = 0.0;  ///< in units of the direction's length, from the face's plane in double precision
  bool front = true;      ///< the side of the face that was met
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  ///< on the face's plane
};

/// An open line between two surface points.
struct Segment {
  Eigen::Vector3d from;
  Eigen::Vector3d to;
  int from_face = -1;  ///< the faces it ends on do not block it; -1: none
  int to_face = -1;
};

/// The faces as opaque, two-sided obstacles. Immutable, usable from many threads at once.
class Visibility {
 public:
  struct Impl;

  /// Cost O(faces log faces). An empty scene blocks nothing.
  explicit Visibility(const Faces& faces);
  ~Visibility();
  Visibility(Visibility&&) noexcept;
  Visibility& operator=(Visibility&&) noexcept;

  /// First face along origin + t direction, t > 0, other than `skip_face`; empty if there is none.
  std::optional<RayHit> first_hit(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                                  int skip_face = -1) const;

  /// First faces of many rays, in ray packets: hits[k] for origins[k], directions[k]; face -1 where nothing is met.
  void first_hits(std::span<const Eigen::Vector3d> origins, std::span<const Eigen::Vector3d> directions,
                  std::span<RayHit> hits) const;

  /// Whether some face crosses the segment. A face that only touches it (both ends on one side of its plane) does not.
  bool blocked(const Segment& segment) const;

  /// The same for many segments, in ray packets: result[k] is 1 if segments[k] is blocked.
  void blocked(std::span<const Segment> segments, std::span<char> result) const;

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace interglow::radiosity
