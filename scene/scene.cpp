// SPDX-License-Identifier: GPL-3.0-or-later
#include "scene/scene.h"

#include <Eigen/Geometry>
#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "diagnostics/error.h"

namespace interglow::scene {
namespace {

void check_spectrum(const Eigen::VectorXd& value, Eigen::Index bands, const std::string& what) {
  if (value.size() != bands) {
    throw InvalidParams(fmt::format("{}: {} bands, expected {} (the scene's wavelength grid).", what, value.size(), bands));
  }
  for (Eigen::Index i = 0; i < bands; ++i) {
    if (!std::isfinite(value[i]) || value[i] < 0.0) {
      throw InvalidParams(fmt::format("{}: band {} is {}; expected a finite value >= 0.", what, i + 1, value[i]));
    }
  }
}

void check_object(const Object& object, const Scene& scene) {
  const std::string place = "object " + object.name;
  const auto points = static_cast<int>(object.patches.points.size());
  if (object.patches.faces.empty()) throw InvalidParams(place + ": no faces; expected at least one.");
  for (std::size_t f = 0; f < object.patches.faces.size(); ++f) {
    const mesh::Face& face = object.patches.faces[f];
    for (int k = 0; k < mesh::corner_count(face); ++k) {
      const int point = face[static_cast<std::size_t>(k)];
      if (point < 0 || point >= points) {
        throw InvalidParams(fmt::format("{}: face {} names point {}, expected 0 to {}.", place, f, point, points - 1));
      }
    }
  }
  for (std::size_t p = 0; p < object.patches.points.size(); ++p) {
    if (!object.patches.points[p].allFinite()) {
      throw InvalidParams(fmt::format("{}: point {} is not finite.", place, p));
    }
  }
  const auto& normals = object.patches.corner_normals;
  if (!normals.empty() && normals.size() != object.patches.faces.size()) {
    throw InvalidParams(fmt::format("{}: {} corner normals for {} faces; expected one entry a face, or none.", place,
                                    normals.size(), object.patches.faces.size()));
  }
  if (object.material < 0 || object.material >= static_cast<int>(scene.materials.size())) {
    throw InvalidParams(fmt::format("{}: material {}, expected 0 to {}.", place, object.material, scene.materials.size() - 1));
  }
  if (object.patches.closed && object.sides == Sides::kTwo) {
    throw InvalidParams(place + ": sides = two, but the mesh is closed; a closed solid is one-sided. Remove \"sides\".");
  }
  if (object.emits()) check_spectrum(object.exitance, scene.grid.size(), place + ": exitance");
}

void check_camera(const Camera& camera, Eigen::Index bands) {
  const Eigen::Vector3d forward = camera.target - camera.position;
  if (!(forward.norm() > 0.0)) throw InvalidParams("camera: position and target are the same point.");
  if (!(forward.cross(camera.up).norm() > 1e-9 * forward.norm() * camera.up.norm())) {
    throw InvalidParams("camera: up is parallel to the viewing direction (or zero). Choose another up.");
  }
  if (!(camera.horizontal_fov_deg > 0.0) || !(camera.horizontal_fov_deg < 180.0)) {
    throw InvalidParams(fmt::format("camera: horizontal field of view {} degrees; expected between 0 and 180.",
                                    camera.horizontal_fov_deg));
  }
  if (camera.width < 1 || camera.height < 1 || camera.width > 65536 || camera.height > 65536) {
    throw InvalidParams(fmt::format("camera: {} x {} pixels; expected 1 to 65536 each.", camera.width, camera.height));
  }
  const int last = camera.last_band < 0 ? static_cast<int>(bands) - 1 : camera.last_band;
  if (camera.first_band < 0 || last < camera.first_band || last >= bands) {
    throw InvalidParams(fmt::format("camera: bands {} to {}, expected within 0 to {}.", camera.first_band, last, bands - 1));
  }
}

}  // namespace

void validate(const Scene& scene) {
  const Eigen::Index bands = scene.grid.size();
  if (bands == 0) throw InvalidParams("scene: no wavelength grid.");
  if (scene.objects.empty()) throw InvalidParams("scene: no objects; expected at least one.");
  for (const spectral::Material& material : scene.materials) {
    check_spectrum(material.donaldson.reflectance, bands, "material " + material.name + ": reflectance");
    const Eigen::MatrixXd& luminescence = material.donaldson.luminescence;
    if (luminescence.size() > 0 && (luminescence.rows() != bands || luminescence.cols() != bands || !luminescence.allFinite())) {
      throw InvalidParams(fmt::format("material {}: luminescence is {} x {}; expected finite values, {} x {}.", material.name,
                                      luminescence.rows(), luminescence.cols(), bands, bands));
    }
  }
  for (const Object& object : scene.objects) check_object(object, scene);
  for (const DirectionalLight& light : scene.directional_lights) {
    check_spectrum(light.normal_irradiance, bands, "light " + light.name + ": normal irradiance");
    if (std::abs(light.direction.norm() - 1.0) > 1e-9) {
      throw InvalidParams(fmt::format("light {}: direction has length {}, expected 1.", light.name, light.direction.norm()));
    }
    if (!(light.half_angle_rad >= 0.0) || light.half_angle_rad > std::numbers::pi / 6) {
      throw InvalidParams(fmt::format("light {}: half angle {} rad, expected 0 to 0.52 (30 degrees).", light.name,
                                      light.half_angle_rad));
    }
  }
  if (scene.sky) check_spectrum(scene.sky->radiance, bands, "light " + scene.sky->name + ": radiance");
  check_camera(scene.camera, bands);
}

}  // namespace interglow::scene
