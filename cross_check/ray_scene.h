// SPDX-License-Identifier: GPL-3.0-or-later
/// The path tracer's own view of a scene's geometry: what a ray meets first, and whether two points see each other.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <vector>

#include "scene/scene.h"

namespace interglow::cross_check {

/// Where a ray met a face.
struct Hit {
  int object = -1;
  int face = -1;           ///< within the object
  Eigen::Vector3d point;   ///< mm, on the face to double precision
  Eigen::Vector3d normal;  ///< unit, towards the side the ray came from
  bool back = false;       ///< the ray met the back of the face
};

/// The face a ray starts on; it is never hit again, so that no offset from the surface is needed.
struct FaceId {
  int object = -1;
  int face = -1;
};

/// Embree scene of the flat faces as they stand (corner normals are not used). Safe to use from many threads.
class RayScene {
 public:
  explicit RayScene(const scene::Scene& scene);
  ~RayScene();
  RayScene(const RayScene&) = delete;
  RayScene& operator=(const RayScene&) = delete;

  /// First face met by the ray, other than `start`. @param direction unit vector
  std::optional<Hit> first_hit(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                               FaceId start = {}) const;

  /// True if no face other than `start` and `end` meets the ray within `distance` [mm] (infinity for a parallel beam).
  bool is_clear(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double distance, FaceId start,
                FaceId end = {}) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace interglow::cross_check
