// SPDX-License-Identifier: GPL-3.0-or-later
/// Patches that several form-factor tests use.
#pragma once

#include <Eigen/Geometry>
#include <random>
#include <vector>

#include "radiosity/polygon.h"

namespace interglow::radiosity::test {

inline Polygon triangle(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  return {{a, b, c, Eigen::Vector3d::Zero()}, 3};
}

inline Polygon quad(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                    const Eigen::Vector3d& d) {
  return {{a, b, c, d}, 4};
}

/// The unit cube seen from inside, n x n quads a face, or twice as many triangles.
inline std::vector<Polygon> cube(int n, bool triangles) {
  using Eigen::Vector3d;
  std::vector<Polygon> patches;
  const auto add_face = [&](const Vector3d& origin, const Vector3d& u, const Vector3d& v) {
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) {
        const auto at = [&](int a, int b) -> Vector3d { return origin + u * (double(a) / n) + v * (double(b) / n); };
        if (triangles) {
          patches.push_back(triangle(at(i, j), at(i + 1, j), at(i + 1, j + 1)));
          patches.push_back(triangle(at(i, j), at(i + 1, j + 1), at(i, j + 1)));
        } else {
          patches.push_back(quad(at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)));
        }
      }
  };
  const Vector3d x = Vector3d::UnitX(), y = Vector3d::UnitY(), z = Vector3d::UnitZ(), zero = Vector3d::Zero();
  add_face(zero, x, y);
  add_face(z, y, x);
  add_face(zero, y, z);
  add_face(x, z, y);
  add_face(zero, z, x);
  add_face(y, x, z);
  return patches;
}

/// Triangles, parallelograms and other convex quads of sizes 0.01 ... 1 in a box of size 2, facing anywhere.
inline std::vector<Polygon> random_patches(int count, std::uint64_t seed) {
  using Eigen::Vector3d;
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> signed_unit(-1, 1);
  const auto vector = [&]() -> Vector3d {
    const double x = signed_unit(random), y = signed_unit(random), z = signed_unit(random);
    return {x, y, z};
  };
  std::vector<Polygon> patches;
  for (int i = 0; i < count; ++i) {
    const Vector3d centre = vector();
    const double size = std::pow(10.0, -1 + signed_unit(random));
    const Vector3d u = vector().normalized();
    const Vector3d v = u.cross(vector()).normalized();
    const double stretch = 0.6 + 0.4 * signed_unit(random), skew = 0.4 * signed_unit(random);
    const auto at = [&](double s, double t) -> Vector3d {
      return centre + size * (s * u + t * (stretch * v + skew * u));
    };
    if (i % 3 == 0) patches.push_back(triangle(at(-1, -1), at(1, -1), at(0.3 * signed_unit(random), 1)));
    if (i % 3 == 1) patches.push_back(quad(at(-1, -1), at(1, -1), at(1, 1), at(-1, 1)));
    if (i % 3 == 2)
      patches.push_back(quad(at(-1, -1), at(1, -1), at(0.8 + 0.1 * signed_unit(random), 0.9), at(-0.5, 1)));
  }
  return patches;
}

/// The patches with every corner moved by `move`.
template <class Move>
std::vector<Polygon> transformed(std::vector<Polygon> patches, Move move) {
  for (Polygon& patch : patches)
    for (int i = 0; i < patch.corners; ++i) patch.corner[i] = move(patch.corner[i]);
  return patches;
}

}  // namespace interglow::radiosity::test
