// SPDX-License-Identifier: GPL-3.0-or-later
/// Meshes and materials that the tests share.
#pragma once

#include <Eigen/Core>
#include <string>

#include "mesh/patch_mesh.h"
#include "scene/scene.h"

namespace interglow::test {

/// A planar quad a, b, c, d, counter-clockwise seen from its front.
mesh::PatchMesh quad(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                     const Eigen::Vector3d& d);

/// A square of side 2 half at height z around the z axis, facing up or down.
mesh::PatchMesh level_square(double half, double z, bool facing_up);

/// The cube [0, side]³ seen from inside.
mesh::PatchMesh cavity(double side);

/// A sphere of triangles with true normals, from an octahedron divided `levels` times.
mesh::PatchMesh smooth_sphere(double radius, int levels);

/// The same reflectance in every band.
spectral::Material grey(const std::string& name, double reflectance, Eigen::Index bands);

}  // namespace interglow::test
