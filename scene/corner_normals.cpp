// SPDX-License-Identifier: GPL-3.0-or-later
#include "scene/corner_normals.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace interglow::scene {
namespace {

struct Corner {
  std::size_t face;
  double angle_rad;
};

double angle_at(const mesh::PatchMesh& mesh, const mesh::Face& face, int k) {
  const int corners = mesh::corner_count(face);
  const auto point = [&](int i) {
    return mesh.points[static_cast<std::size_t>(face[static_cast<std::size_t>((i + corners) % corners)])];
  };
  const Eigen::Vector3d to_next = point(k + 1) - point(k);
  const Eigen::Vector3d to_last = point(k - 1) - point(k);
  return std::atan2(to_next.cross(to_last).norm(), to_next.dot(to_last));
}

}  // namespace

std::vector<std::array<Eigen::Vector3d, 4>> corner_normals(const mesh::PatchMesh& mesh, double feature_angle_deg) {
  const double least_cosine = std::cos(feature_angle_deg * std::numbers::pi / 180.0);
  std::vector<Eigen::Vector3d> face_normal;
  std::vector<std::vector<Corner>> around(mesh.points.size());
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    face_normal.push_back(mesh::vector_area(mesh, mesh.faces[f]).normalized());
    for (int k = 0; k < mesh::corner_count(mesh.faces[f]); ++k) {
      const int point = mesh.faces[f][static_cast<std::size_t>(k)];
      around[static_cast<std::size_t>(point)].push_back({f, angle_at(mesh, mesh.faces[f], k)});
    }
  }
  std::vector<std::array<Eigen::Vector3d, 4>> normals(mesh.faces.size());
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    normals[f].fill(face_normal[f]);
    for (int k = 0; k < mesh::corner_count(mesh.faces[f]); ++k) {
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      for (const Corner& corner : around[static_cast<std::size_t>(mesh.faces[f][static_cast<std::size_t>(k)])]) {
        if (face_normal[corner.face].dot(face_normal[f]) >= least_cosine) {
          sum += corner.angle_rad * face_normal[corner.face];
        }
      }
      if (sum.norm() > 0.0) normals[f][static_cast<std::size_t>(k)] = sum.normalized();
    }
  }
  return normals;
}

}  // namespace interglow::scene
