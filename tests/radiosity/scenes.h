// SPDX-License-Identifier: GPL-3.0-or-later
/// Small scenes that several tests are about.
#pragma once

#include <Eigen/Geometry>
#include <cmath>

#include "radiosity/elements.h"
#include "scene/scene.h"

namespace interglow::radiosity::testing {

using Eigen::Vector3d;

/// n x n quads on a parallelogram; front: along_u × along_v.
inline void add_grid(mesh::PatchMesh& patches, const Vector3d& origin, const Vector3d& along_u, const Vector3d& along_v,
                     int nu, int nv) {
  const int first = static_cast<int>(patches.points.size());
  for (int v = 0; v <= nv; ++v) {
    for (int u = 0; u <= nu; ++u) patches.points.push_back(origin + along_u * u / nu + along_v * v / nv);
  }
  const auto at = [&](int u, int v) { return first + v * (nu + 1) + u; };
  for (int v = 0; v < nv; ++v) {
    for (int u = 0; u < nu; ++u) patches.faces.push_back({at(u, v), at(u + 1, v), at(u + 1, v + 1), at(u, v + 1)});
  }
}

/// A cube of side `side`, n x n quads a face, turned about z; its front outside or inside. Points of the six faces are
/// not shared.
inline mesh::PatchMesh cube(double side, int n, bool front_inside, const Vector3d& centre = Vector3d::Zero(),
                            double turn_rad = 0.0) {
  mesh::PatchMesh patches;
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(turn_rad, Vector3d::UnitZ()).toRotationMatrix();
  for (int axis = 0; axis < 3; ++axis) {
    for (int sign : {-1, 1}) {
      Vector3d u = Vector3d::Zero();
      Vector3d v = Vector3d::Zero();
      u[(axis + 1) % 3] = side;
      v[(axis + 2) % 3] = side;
      Vector3d normal = Vector3d::Zero();
      normal[axis] = sign;
      const bool flip = (sign < 0) != front_inside;
      const Vector3d origin = 0.5 * side * normal - 0.5 * u - 0.5 * v;
      if (flip) std::swap(u, v);
      add_grid(patches, centre + turn * origin, turn * u, turn * v, n, n);
    }
  }
  patches.closed = true;
  return patches;
}

inline scene::Object object(const char* name, mesh::PatchMesh patches) {
  scene::Object result;
  result.name = name;
  result.patches = std::move(patches);
  return result;
}

/// The closed box of side 100 with two turned cubes floating in it; n: quads an edge of the box.
inline scene::Scene box_with_two_cubes(int n, int cube_n) {
  constexpr double kDegree = 3.14159265358979323846 / 180.0;
  scene::Scene scene;
  scene.objects.push_back(object("box", cube(100.0, n, true, Vector3d(50, 50, 50))));
  scene.objects.push_back(object("small", cube(30.0, cube_n, false, Vector3d(30, 35, 25), 17 * kDegree)));
  scene.objects.push_back(object("large", cube(35.0, cube_n, false, Vector3d(68, 62, 55), -28 * kDegree)));
  return scene;
}

/// A cube of n x n quads a face blown up to a sphere of radius 25 with waves, each quad cut in two: closed, not convex.
inline mesh::PatchMesh lumpy_solid(int n) {
  const mesh::PatchMesh blocks = cube(2.0, n, false);
  mesh::PatchMesh solid;
  solid.closed = true;
  for (const Vector3d& p : blocks.points) {
    const Vector3d u = p.normalized();
    const double radius = 25.0 * (1.0 + 0.2 * std::sin(5 * u.x()) * std::sin(4 * u.y() + 1) * std::cos(6 * u.z()));
    // On a grid, so that the six faces' common points are the same to the bit.
    const Vector3d q = Vector3d(50, 50, 45) + radius * u;
    solid.points.push_back((q * 0x1p30).array().round() * 0x1p-30);
  }
  for (const mesh::Face& f : blocks.faces) {
    solid.faces.push_back({f[0], f[1], f[2], -1});
    solid.faces.push_back({f[0], f[2], f[3], -1});
  }
  return solid;
}

/// It in the closed box of side 100; n: quads an edge of the box.
inline scene::Scene lumpy_solid_in_box(int n, int solid_n) {
  scene::Scene scene;
  scene.objects.push_back(object("box", cube(100.0, n, true, Vector3d(50, 50, 50))));
  scene.objects.push_back(object("solid", lumpy_solid(solid_n)));
  return scene;
}

}  // namespace interglow::radiosity::testing
