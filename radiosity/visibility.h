// SPDX-License-Identifier: GPL-3.0-or-later
/// Rays against the faces of a scene: who is met first, who stands between. All of Interglow but the path tracer asks
/// here.
///
/// The search runs in single precision on centred and scaled coordinates; whether a face that it finds stands between
/// is decided again in double precision. A face that a ray starts or ends on is left out by its identity or because it
/// only touches the ray, never by an offset along the ray, so that results do not depend on the unit of length.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>

#include "radiosity/elements.h"

namespace interglow::radiosity {

/// An open line between two surface points, or from one of them to infinity.
struct Segment {
  Eigen::Vector3d from;  ///< mm
  Eigen::Vector3d to;    ///< mm; of a half-line its direction
  int from_face = -1;    ///< the faces it ends on do not block it; -1: none
  int to_face = -1;
  bool half_line = false;  ///< `to` is a direction, not a point
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

  /// First face along each half-line from `origin`, in ray packets; -1: none.
  void first_faces(const Eigen::Vector3d& origin, std::span<const Eigen::Vector3d> directions,
                   std::span<int> faces) const;

  /// Whether some face crosses the segment. A face that only touches it (both ends on one side of its plane, or one of
  /// them in it) does not.
  bool blocked(const Segment& segment) const;

  /// The same for many segments, in ray packets: result[k] is 1 if segments[k] is blocked.
  void blocked(std::span<const Segment> segments, std::span<char> result) const;

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace interglow::radiosity
