// SPDX-License-Identifier: GPL-3.0-or-later
/// Meshes with lit walls, solved, and the irradiance gathered from their sources: what continuous references are
/// compared with.
#pragma once

#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "radiosity/element_tree.h"
#include "radiosity/form_factor.h"
#include "radiosity/solution.h"
#include "tests/radiosity/reference_cases.h"
#include "tests/radiosity/test_scenes.h"

namespace interglow::radiosity::test {

/// Length of strips that stand for infinite ones: the ends are felt by 1 / length, far below the errors looked at.
constexpr double kLength = 1e6;

inline double value(const nlohmann::json& number) { return number.at("value").get<double>(); }

struct Solved {
  scene::Scene scene;
  Elements elements;
  Transport transport;
  Solution solution;

  /// Indirect irradiance at a point, gathered from the sources.
  double gathered(const Eigen::Vector3d& point, const Eigen::Vector3d& normal) const {
    double sum = 0.0;
    for (Eigen::Index e = 0; e < elements.size(); ++e) {
      const double source = solution.reflected_source(e, 0);
      if (source != 0.0) sum += source * point_form_factor(point, normal, polygon_of(elements, static_cast<int>(e)));
    }
    return sum;
  }
  double radiosity(Eigen::Index e) const {
    return scene.materials[static_cast<std::size_t>(elements.material[static_cast<std::size_t>(e)])]
               .donaldson.reflectance[0] *
           (solution.direct(e, 0) + solution.reflected(e, 0));
  }
};

/// Objects k reflect reflectance[k] and are lit by irradiance(elements, element) on their fronts. Backs look away from
/// the cavity and are black, so that only the cavity is solved.
template <typename Irradiance>
Solved solved(const std::vector<mesh::PatchMesh>& meshes, const std::vector<double>& reflectance,
              const Irradiance& irradiance, std::optional<int> bounces = {}) {
  scene::Scene scene = one_band_scene(meshes, reflectance);
  Elements elements = make_elements(scene);
  RowMatrix direct = RowMatrix::Zero(elements.size(), 1);
  for (Eigen::Index e = 0; e < elements.size(); ++e) {
    if (elements.back[static_cast<std::size_t>(e)] == 0) direct(e, 0) = irradiance(elements, e);
  }
  Transport transport = Transport::build(elements, {.tolerance = 1e-7, .occlusion = false});
  Solution solution =
      solve(transport, scene.materials, elements.material, direct, {.bounces = bounces, .tolerance = 1e-12});
  return {std::move(scene), std::move(elements), std::move(transport), std::move(solution)};
}

/// Two walls of length 1 that open upwards from the y axis by twice `half` rad, refined towards the apex, where
/// radiosity behaves like a small power of the distance.
inline std::vector<mesh::PatchMesh> v_groove(double half, int strips_per_wall) {
  const auto graded = [](double x) { return std::pow(x, 6.0); };
  std::vector<Eigen::Vector2d> right, left;
  for (int k = 0; k <= strips_per_wall; ++k) {
    const double x = graded(double(k) / strips_per_wall);
    right.push_back(x * Eigen::Vector2d(std::sin(half), std::cos(half)));
    left.push_back(graded(1.0 - double(k) / strips_per_wall) * Eigen::Vector2d(-std::sin(half), std::cos(half)));
  }
  return {strips(right, kLength), strips(left, kLength)};
}

/// Two half cylinders of radius 1 that touch along the y axis, seen from the angles of the contact up to 90°.
/// @param angle_deg  from the contact, increasing
inline std::vector<mesh::PatchMesh> half_cylinders(const std::vector<double>& angle_deg) {
  std::vector<Eigen::Vector2d> left, right;
  for (const double deg : angle_deg) {
    const double t = deg * std::numbers::pi / 180.0;
    left.emplace_back(-1.0 + std::cos(t), std::sin(t));
    right.emplace_back(1.0 - std::cos(t), std::sin(t));
  }
  std::reverse(left.begin(), left.end());
  return {strips(left, kLength), strips(right, kLength)};
}

/// The edges of the bands of the half-cylinder references, each cut into `refinement` strips [deg].
inline std::vector<double> half_cylinder_angles(int refinement) {
  const std::vector<double> edges = {0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 45, 60, 70, 80, 90};
  std::vector<double> angle;
  for (std::size_t k = 0; k + 1 < edges.size(); ++k) {
    for (int s = 0; s < refinement; ++s) angle.push_back(edges[k] + (edges[k + 1] - edges[k]) * s / refinement);
  }
  angle.push_back(90.0);
  return angle;
}

/// The six faces of the unit cube seen from inside, n x n quads each: bottom, top, four sides.
inline std::vector<mesh::PatchMesh> cube(int n) {
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX(), y = Eigen::Vector3d::UnitY(), z = Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
  return {grid(zero, x, y, n, n), grid(z, y, x, n, n),    grid(zero, z, x, n, n),
          grid(y, x, z, n, n),    grid(zero, y, z, n, n), grid(x, z, y, n, n)};
}

}  // namespace interglow::radiosity::test
