// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit_scenes.h"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "spectral/wavelength_grid.h"

namespace interglow::test {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

/// Half cylinder about an axis along y through (x, 0, 0), its round side up; `cosine_graded`: smaller faces near both
/// rims, where it touches others.
mesh::PatchMesh half_cylinder(double x, const FitSceneParams& params) {
  constexpr double kRadius = 20.0;
  constexpr double kLength = 50.0;
  mesh::PatchMesh mesh;
  std::vector<double> angle;
  for (int i = 0; i <= params.around; ++i) {
    const double u = static_cast<double>(i) / params.around;
    // From rim to rim, with faces a third of the mean size at the rims.
    angle.push_back(std::numbers::pi *
                    (u - 2.0 / 3.0 * std::sin(2.0 * std::numbers::pi * u) / (2.0 * std::numbers::pi)));
  }
  const auto normal = [&](int i) {
    return Vector3d(-std::cos(angle[static_cast<std::size_t>(i)]), 0.0, std::sin(angle[static_cast<std::size_t>(i)]));
  };
  for (int i = 0; i <= params.around; ++i) {
    for (int j = 0; j <= params.along; ++j) {
      Vector3d point = kRadius * normal(i);
      if (i == 0 || i == params.around) point.z() = 0.0;
      mesh.points.emplace_back(x + point.x(), kLength * (static_cast<double>(j) / params.along - 0.5), point.z());
    }
  }
  const auto at = [&](int i, int j) { return i * (params.along + 1) + j; };
  for (int i = 0; i < params.around; ++i) {
    for (int j = 0; j < params.along; ++j) {
      mesh.faces.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
      mesh.corner_normals.push_back({normal(i), normal(i + 1), normal(i + 1), normal(i)});
    }
  }
  return mesh;
}

mesh::PatchMesh plane(double half, int faces) {
  mesh::PatchMesh mesh;
  for (int i = 0; i <= faces; ++i) {
    for (int j = 0; j <= faces; ++j)
      mesh.points.emplace_back(half * (2.0 * i / faces - 1.0), half * (2.0 * j / faces - 1.0), 0.0);
  }
  const auto at = [&](int i, int j) { return i * (faces + 1) + j; };
  for (int i = 0; i < faces; ++i) {
    for (int j = 0; j < faces; ++j) mesh.faces.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
  }
  return mesh;
}

/// Reflectance that rises around `edge_nm`; with a yield, light below the edge is re-emitted just above it.
spectral::Material paper(const std::string& name, const spectral::WavelengthGrid& grid, double edge_nm, double yield) {
  const VectorXd& nm = grid.centers_nm();
  spectral::Material material;
  material.name = name;
  material.donaldson.reflectance = (0.1 + 0.75 / (1.0 + (-(nm.array() - edge_nm) / 20.0).exp())).matrix();
  if (yield > 0.0) {
    material.donaldson.luminescence = Eigen::MatrixXd::Zero(nm.size(), nm.size());
    for (Eigen::Index j = 0; j < nm.size(); ++j) {
      VectorXd emission = VectorXd::Zero(nm.size());
      for (Eigen::Index i = j + 1; i < nm.size(); ++i)
        emission[i] = std::exp(-0.5 * std::pow((nm[i] - edge_nm - 25.0) / 30.0, 2));
      if (emission.sum() > 0.0) {
        const double excited = yield * std::exp(-0.5 * std::pow((nm[j] - edge_nm + 50.0) / 40.0, 2));
        material.donaldson.luminescence.col(j) = excited * emission / emission.sum();
      }
    }
  }
  return material;
}

scene::Scene base(const FitSceneParams& params) {
  scene::Scene scene;
  const double step = 300.0 / std::max(1, params.bands - 1);
  scene.grid = spectral::WavelengthGrid::uniform(400.0 - step, 700.0, step);
  scene.materials = {paper("red", scene.grid, 580.0, params.fluorescent ? 0.3 : 0.0),
                     paper("yellow", scene.grid, 500.0, params.fluorescent ? 0.3 : 0.0)};
  scene::DirectionalLight sun;
  sun.name = "sun";
  sun.direction = Vector3d(-0.25, -0.3, -1.0).normalized();
  sun.normal_irradiance = (1.0 + 0.2 * ((scene.grid.centers_nm().array() - 550.0) / 150.0)).matrix();
  scene.directional_lights = {sun};
  scene.camera.width = params.side_px;
  scene.camera.height = params.side_px;
  scene.camera.first_band = 1;
  scene.camera.last_band = params.bands;
  return scene;
}

void add(scene::Scene& scene, const std::string& name, const mesh::PatchMesh& mesh, int material) {
  scene::Object object;
  object.name = name;
  object.patches = mesh;
  object.material = material;
  scene.objects.push_back(object);
}

}  // namespace

scene::Scene half_cylinders(const FitSceneParams& params) {
  scene::Scene scene = base(params);
  add(scene, "left", half_cylinder(-20.0, params), 0);
  add(scene, "right", half_cylinder(20.0, params), 1);
  scene.camera.position = {20.0, -60.0, 290.0};
  scene.camera.target = {0.0, 0.0, 5.0};
  scene.camera.horizontal_fov_deg = 19.0;
  return scene;
}

scene::Scene arch_on_plane(const FitSceneParams& params) {
  scene::Scene scene = base(params);
  add(scene, "arch", half_cylinder(0.0, params), 0);
  add(scene, "plane", plane(55.0, params.around), 1);
  scene.directional_lights[0].direction = Vector3d(-0.6, 0.35, -1.0).normalized();
  scene.camera.position = {150.0, -180.0, 190.0};
  scene.camera.target = {0.0, 0.0, 5.0};
  scene.camera.up = {0.0, 0.0, 1.0};
  scene.camera.horizontal_fov_deg = 28.0;
  return scene;
}

scene::Scene single_plane(const FitSceneParams& params) {
  scene::Scene scene = base(params);
  scene.materials.resize(1);
  add(scene, "plane", plane(30.0, params.around), 0);
  scene.camera.position = {20.0, -60.0, 290.0};
  scene.camera.horizontal_fov_deg = 19.0;
  return scene;
}

}  // namespace interglow::test
