// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/blockers.h"

#include <Eigen/Geometry>

namespace interglow::radiosity {

using Eigen::Vector3d;

Blockers make_blockers(const Faces& faces, double flat) {
  Blockers blockers;
  blockers.of_face.assign(faces.corners.size(), -1);
  for (std::size_t f = 0; f < faces.corners.size(); ++f) {
    Blocker blocker;
    blocker.box = Box::empty();
    for (int k = 0; k < mesh::corner_count(faces.corners[f]); ++k) {
      blocker.corner.push_back(faces.points[static_cast<std::size_t>(faces.corners[f][static_cast<std::size_t>(k)])]);
      blocker.box.cover(blocker.corner.back());
    }
    Vector3d area = Vector3d::Zero();
    for (std::size_t k = 2; k < blocker.corner.size(); ++k) {
      area += (blocker.corner[k - 1] - blocker.corner[0]).cross(blocker.corner[k] - blocker.corner[0]);
    }
    blocker.normal = area.stableNormalized();
    blocker.offset = blocker.normal.dot(blocker.corner[0]);
    bool front = false;
    bool back = false;
    for (const Vector3d& p : faces.points) {
      const double height = blocker.height(p);
      front = front || height > flat;
      back = back || height < -flat;
      if (front && back) break;
    }
    if (!front || !back) continue;
    blockers.of_face[f] = static_cast<int>(blockers.blocker.size());
    blockers.blocker.push_back(std::move(blocker));
  }
  return blockers;
}

}  // namespace interglow::radiosity
