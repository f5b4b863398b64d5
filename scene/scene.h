// SPDX-License-Identifier: GPL-3.0-or-later
/// What is simulated: objects, materials, lights and a camera, validated and on one wavelength grid.
/// Everything downstream (radiosity, rendering, cross_check, fitting) starts from this type.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "mesh/patch_mesh.h"
#include "spectral/donaldson_matrix.h"
#include "spectral/wavelength_grid.h"

namespace interglow::scene {

/// Which sides of an object's faces carry its material. The back of a one-sided sheet is black (it absorbs).
enum class Sides { kOne, kTwo };

struct Object {
  std::string name{};
  mesh::PatchMesh patches{};  ///< in world coordinates, mm
  int material = 0;           ///< index into Scene::materials
  Sides sides = Sides::kOne;
  /// Exitance of an emitting surface, front side [W m^-2 nm^-1], one value a band; empty: it does not emit.
  /// Its radiance is exitance / π.
  Eigen::VectorXd exitance{};

  bool emits() const { return exitance.size() > 0; }
};

/// A parallel beam.
struct DirectionalLight {
  std::string name{};
  Eigen::Vector3d direction{0.0, 0.0, -1.0};  ///< unit vector along which the light travels
  Eigen::VectorXd normal_irradiance{};        ///< on a plane facing the beam [W m^-2 nm^-1], one value a band
  /// Half-angle of the source disk [rad]; 0 is a perfectly parallel beam.
  double half_angle_rad = 0.0;
};

/// Uniform light from every direction that meets no object.
struct SkyLight {
  std::string name{};
  Eigen::VectorXd radiance{};  ///< [W m^-2 sr^-1 nm^-1], one value a band
};

/// A pinhole camera. Row 0 is the top row. The centre of pixel (row, column) lies at
/// forward + (2 (column + 1/2) / width - 1) h right + (1 - 2 (row + 1/2) / height) h (height / width) up,
/// h = tan(horizontal_fov / 2), right = forward × up_hint normalised, up = right × forward; images are not mirrored.
struct Camera {
  Eigen::Vector3d position{0.0, 0.0, 100.0};  ///< mm
  Eigen::Vector3d target{0.0, 0.0, 0.0};      ///< mm
  Eigen::Vector3d up{0.0, 1.0, 0.0};          ///< hint, not parallel to the viewing direction
  double horizontal_fov_deg = 20.0;           ///< in (0, 180)
  int width = 512;
  int height = 512;
  /// The bands that images have: first and last band of the scene's grid, by index (the camera's 400-700 nm within
  /// 350-700).
  int first_band = 0;
  int last_band = -1;  ///< -1: the last band of the grid
};

struct Scene {
  spectral::WavelengthGrid grid;
  std::vector<spectral::Material> materials;
  std::vector<Object> objects;
  std::vector<DirectionalLight> directional_lights;
  std::optional<SkyLight> sky;
  Camera camera;
};

/// Checks indices, sizes, ranges and finite values; the one gate before computing.
/// @throws InvalidParams naming object, field, value and range.
void validate(const Scene& scene);

}  // namespace interglow::scene
