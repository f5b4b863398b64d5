// SPDX-License-Identifier: GPL-3.0-or-later
#include "shapes.h"

#include <Eigen/Geometry>
#include <map>

namespace interglow::test {

using Eigen::Vector3d;

mesh::PatchMesh quad(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d) {
  mesh::PatchMesh mesh;
  mesh.points = {a, b, c, d};
  mesh.faces = {{0, 1, 2, 3}};
  return mesh;
}

mesh::PatchMesh level_square(double half, double z, bool facing_up) {
  const Vector3d a(-half, -half, z);
  const Vector3d b(half, -half, z);
  const Vector3d c(half, half, z);
  const Vector3d d(-half, half, z);
  return facing_up ? quad(a, b, c, d) : quad(a, d, c, b);
}

mesh::PatchMesh cavity(double side) {
  mesh::PatchMesh mesh;
  for (int k = 0; k < 8; ++k) mesh.points.emplace_back(side * (k & 1), side * ((k >> 1) & 1), side * ((k >> 2) & 1));
  // Counter-clockwise seen from the middle of the cube.
  mesh.faces = {{0, 1, 3, 2}, {4, 6, 7, 5}, {0, 4, 5, 1}, {2, 3, 7, 6}, {0, 2, 6, 4}, {1, 5, 7, 3}};
  mesh.closed = true;
  return mesh;
}

mesh::PatchMesh smooth_sphere(double radius, int levels) {
  mesh::PatchMesh mesh;
  mesh.points = {Vector3d::UnitX(),  -Vector3d::UnitX(), Vector3d::UnitY(),
                 -Vector3d::UnitY(), Vector3d::UnitZ(),  -Vector3d::UnitZ()};
  mesh.faces = {{0, 2, 4, -1}, {2, 1, 4, -1}, {1, 3, 4, -1}, {3, 0, 4, -1},
                {2, 0, 5, -1}, {1, 2, 5, -1}, {3, 1, 5, -1}, {0, 3, 5, -1}};
  for (int level = 0; level < levels; ++level) {
    std::map<std::pair<int, int>, int> middles;
    const auto middle = [&](int a, int b) {
      const auto [found, is_new] = middles.try_emplace(std::minmax(a, b), static_cast<int>(mesh.points.size()));
      if (is_new)
        mesh.points.push_back(
            (mesh.points[static_cast<std::size_t>(a)] + mesh.points[static_cast<std::size_t>(b)]).normalized());
      return found->second;
    };
    std::vector<mesh::Face> faces;
    for (const mesh::Face& f : mesh.faces) {
      const int ab = middle(f[0], f[1]);
      const int bc = middle(f[1], f[2]);
      const int ca = middle(f[2], f[0]);
      faces.insert(faces.end(), {{f[0], ab, ca, -1}, {ab, f[1], bc, -1}, {ca, bc, f[2], -1}, {ab, bc, ca, -1}});
    }
    mesh.faces = faces;
  }
  for (const mesh::Face& f : mesh.faces) {
    mesh.corner_normals.push_back({mesh.points[static_cast<std::size_t>(f[0])],
                                   mesh.points[static_cast<std::size_t>(f[1])],
                                   mesh.points[static_cast<std::size_t>(f[2])], Vector3d::Zero()});
  }
  for (Vector3d& p : mesh.points) p *= radius;
  mesh.closed = true;
  return mesh;
}

spectral::Material grey(const std::string& name, double reflectance, Eigen::Index bands) {
  spectral::Material material;
  material.name = name;
  material.donaldson.reflectance = Eigen::VectorXd::Constant(bands, reflectance);
  return material;
}

}  // namespace interglow::test
