// SPDX-License-Identifier: GPL-3.0-or-later
/// Meshes of known shape and scenes made of them.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "mesh/patch_mesh.h"
#include "scene/scene.h"

namespace interglow::radiosity::test {

/// A planar quad (corners counter-clockwise seen from the front) cut into columns x rows quads.
inline void add_grid(mesh::PatchMesh& mesh, const Eigen::Vector3d& corner, const Eigen::Vector3d& u,
                     const Eigen::Vector3d& v, int columns, int rows) {
  const int first = static_cast<int>(mesh.points.size());
  for (int r = 0; r <= rows; ++r) {
    for (int c = 0; c <= columns; ++c)
      mesh.points.push_back(corner + u * (double(c) / columns) + v * (double(r) / rows));
  }
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      const int at = first + r * (columns + 1) + c;
      mesh.faces.push_back({at, at + 1, at + columns + 2, at + columns + 1});
    }
  }
}

inline mesh::PatchMesh grid(const Eigen::Vector3d& corner, const Eigen::Vector3d& u, const Eigen::Vector3d& v,
                            int columns = 1, int rows = 1) {
  mesh::PatchMesh mesh;
  add_grid(mesh, corner, u, v, columns, rows);
  return mesh;
}

/// A profile in the x-z plane drawn out along y from -length/2 to length/2, one quad a segment; seen along +y, the
/// front is on the left of the profile's direction.
inline mesh::PatchMesh strips(const std::vector<Eigen::Vector2d>& profile, double length) {
  mesh::PatchMesh mesh;
  for (const Eigen::Vector2d& p : profile) {
    mesh.points.emplace_back(p.x(), -0.5 * length, p.y());
    mesh.points.emplace_back(p.x(), 0.5 * length, p.y());
  }
  for (int k = 0; k + 1 < static_cast<int>(profile.size()); ++k)
    mesh.faces.push_back({2 * k, 2 * k + 2, 2 * k + 3, 2 * k + 1});
  return mesh;
}

inline spectral::Material grey(double reflectance) {
  return {"grey", {Eigen::VectorXd::Constant(1, reflectance), Eigen::MatrixXd()}};
}

/// A scene of one band; object k gets material k.
inline scene::Scene one_band_scene(const std::vector<mesh::PatchMesh>& meshes, const std::vector<double>& reflectance) {
  scene::Scene scene;
  scene.grid = spectral::WavelengthGrid::from_centers(Eigen::VectorXd::Constant(1, 550.0));
  for (std::size_t k = 0; k < meshes.size(); ++k) {
    scene.materials.push_back(grey(reflectance[k]));
    scene::Object object;
    object.name = "object" + std::to_string(k);
    object.patches = meshes[k];
    object.material = static_cast<int>(k);
    scene.objects.push_back(object);
  }
  return scene;
}

inline scene::DirectionalLight beam(const Eigen::Vector3d& direction, double half_angle_rad = 0.0) {
  return {"beam", direction.normalized(), Eigen::VectorXd::Ones(1), half_angle_rad};
}

}  // namespace interglow::radiosity::test
