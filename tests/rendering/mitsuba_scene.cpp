// SPDX-License-Identifier: GPL-3.0-or-later
#include "mitsuba_scene.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>
#include <sstream>
#include <stdexcept>

namespace interglow::test {
namespace {

using Eigen::Vector3d;

Vector3d vector_of(const nlohmann::json& values) {
  return {values.at(0).get<double>(), values.at(1).get<double>(), values.at(2).get<double>()};
}

mesh::PatchMesh read_obj(const std::filesystem::path& path) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error("cannot read " + path.string());
  mesh::PatchMesh mesh;
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    std::string key;
    words >> key;
    if (key == "v") {
      Vector3d p;
      words >> p.x() >> p.y() >> p.z();
      mesh.points.push_back(p);
    } else if (key == "f") {
      mesh::Face face{-1, -1, -1, -1};
      words >> face[0] >> face[1] >> face[2];
      for (std::size_t k = 0; k < 3; ++k) --face[k];
      mesh.faces.push_back(face);
    }
  }
  return mesh;
}

}  // namespace

void join_triangle_pairs(mesh::PatchMesh& mesh) {
  std::vector<mesh::Face> joined;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const mesh::Face& a = mesh.faces[f];
    if (f + 1 < mesh.faces.size()) {
      const mesh::Face& b = mesh.faces[f + 1];
      const Vector3d na = mesh::vector_area(mesh, a).normalized();
      const Vector3d nb = mesh::vector_area(mesh, b).normalized();
      if (a[0] == b[0] && a[2] == b[1] && (na - nb).norm() < 1e-6) {
        joined.push_back({a[0], a[1], a[2], b[2]});
        ++f;
        continue;
      }
    }
    joined.push_back(a);
  }
  mesh.faces = joined;
}

scene::Scene mitsuba_scene(const std::filesystem::path& folder, int bands) {
  std::ifstream file(folder / "camera.json");
  if (!file) throw std::runtime_error("cannot read " + (folder / "camera.json").string());
  const nlohmann::json description = nlohmann::json::parse(file);
  scene::Scene scene;
  scene.grid = spectral::WavelengthGrid::uniform(500.0, 500.0 + bands - 1, 1.0);
  scene.camera.position = vector_of(description.at("origin"));
  scene.camera.target = vector_of(description.at("target"));
  scene.camera.up = vector_of(description.at("up"));
  scene.camera.horizontal_fov_deg = description.at("hfov_deg").get<double>();
  scene.camera.width = scene.camera.height = description.at("scene") == "half_cylinders" ? 512 : 256;
  const nlohmann::json& light = description.at("light");
  if (light.at("type") == "directional") {
    scene::DirectionalLight beam;
    beam.name = "beam";
    beam.direction = vector_of(light.at("direction")).normalized();
    beam.normal_irradiance = Eigen::VectorXd::Constant(bands, light.at("irradiance").get<double>());
    scene.directional_lights.push_back(beam);
  }
  for (const auto& [name, part] : description.at("parts").items()) {
    scene::Object object;
    object.name = name;
    object.patches = read_obj(folder / part.at("file").get<std::string>());
    object.material = static_cast<int>(scene.materials.size());
    // Two-sided there; neither light nor camera reaches a back of the groove or the box, so these need no elements.
    object.sides = part.at("two_sided").get<bool>() ? scene::Sides::kTwo : scene::Sides::kOne;
    object.patches.closed = description.at("scene") != "half_cylinders";
    spectral::Material material;
    material.name = name;
    material.donaldson.reflectance = Eigen::VectorXd::Constant(bands, part.at("reflectance").get<double>());
    scene.materials.push_back(material);
    if (light.at("type") == "area" && light.at("part") == name) {
      object.exitance = Eigen::VectorXd::Constant(bands, std::numbers::pi * light.at("radiance").get<double>());
    }
    scene.objects.push_back(object);
  }
  return scene;
}

scene::Scene half_cylinder_strips(const std::filesystem::path& folder, int bands, int merge, bool closed) {
  scene::Scene scene = mitsuba_scene(folder, bands);
  constexpr int kAlong = 33;  // points of one line along the axis, which the files list one after the other
  for (scene::Object& object : scene.objects) {
    mesh::PatchMesh& mesh = object.patches;
    const int lines = static_cast<int>(mesh.points.size()) / kAlong;
    mesh.faces.clear();
    const auto at = [](int line, int step) { return line * kAlong + step; };
    // The files' triangles look inwards; these look outwards.
    const auto add = [&](int a, int b, int c, int d) {
      mesh.faces.push_back(d < 0 ? mesh::Face{a, c, b, -1} : mesh::Face{a, d, c, b});
    };
    const int steps = (kAlong - 1) / merge;
    for (int line = 0; line + 1 < lines; ++line) {
      for (int step = 0; step < steps; ++step) {
        add(at(line, step * merge), at(line + 1, step * merge), at(line + 1, (step + 1) * merge),
            at(line, (step + 1) * merge));
      }
    }
    if (!closed) continue;
    for (int step = 0; step < steps; ++step) {
      add(at(0, step * merge), at(0, (step + 1) * merge), at(lines - 1, (step + 1) * merge),
          at(lines - 1, step * merge));
    }
    for (int line = 1; line + 1 < lines; ++line) {
      add(at(0, 0), at(line + 1, 0), at(line, 0), -1);
      add(at(0, kAlong - 1), at(line, kAlong - 1), at(line + 1, kAlong - 1), -1);
    }
    mesh.closed = mesh::is_closed(mesh);
    if (!mesh.closed) throw std::logic_error("the half-cylinder did not close");
  }
  return scene;
}

std::vector<char> inside_silhouettes(const std::vector<int>& object, int width, int height) {
  std::vector<char> keep(object.size(), 1);
  const auto at = [&](int row, int column) { return static_cast<std::size_t>(row * width + column); };
  for (int row = 0; row < height; ++row) {
    for (int column = 0; column < width; ++column) {
      for (int r = std::max(0, row - 2); r <= std::min(height - 1, row + 2); ++r) {
        for (int c = std::max(0, column - 2); c <= std::min(width - 1, column + 2); ++c) {
          if (object[at(r, c)] != object[at(row, column)]) keep[at(row, column)] = 0;
        }
      }
    }
  }
  return keep;
}

Difference compare(const image::SpectralImage& picture, const image::SpectralImage& reference,
                   const std::vector<char>& keep, int block) {
  if (picture.width != reference.width || picture.height != reference.height)
    throw std::invalid_argument("images of different size");
  Difference difference;
  double squares = 0.0;
  double sum = 0.0;
  double reference_sum = 0.0;
  for (int top = 0; top < picture.height; top += block) {
    for (int left = 0; left < picture.width; left += block) {
      double ours = 0.0;
      double theirs = 0.0;
      int pixels = 0;
      for (int row = top; row < std::min(picture.height, top + block); ++row) {
        for (int column = left; column < std::min(picture.width, left + block); ++column) {
          if (!keep[static_cast<std::size_t>(row * picture.width + column)] || reference.pixel(row, column)[0] == 0.0F)
            continue;
          ours += picture.pixel(row, column)[0];
          theirs += reference.pixel(row, column)[0];
          ++pixels;
        }
      }
      // Blocks of which the band leaves less than half are noisier than the rest.
      if (2 * pixels < block * block) continue;
      squares += (ours - theirs) * (ours - theirs) / (pixels * pixels);
      sum += (ours - theirs) / pixels;
      reference_sum += theirs / pixels;
      ++difference.count;
    }
  }
  const auto count = static_cast<double>(difference.count);
  difference.mean = reference_sum / count;
  difference.rms = std::sqrt(squares / count) / difference.mean;
  difference.bias = sum / count / difference.mean;
  return difference;
}

OwnDifference own_difference(const image::SpectralImage& picture, const image::SpectralImage& reference,
                             const image::SpectralImage& standard_error, const std::vector<char>& keep) {
  double mean = 0.0;
  double sum = 0.0;
  double squares = 0.0;
  double count = 0.0;
  for (int row = 0; row < picture.height; ++row) {
    for (int column = 0; column < picture.width; ++column) {
      const double theirs = reference.pixel(row, column)[0];
      if (!keep[static_cast<std::size_t>(row * picture.width + column)] || theirs == 0.0) continue;
      const double difference = picture.pixel(row, column)[0] - theirs;
      const double noise = standard_error.pixel(row, column)[0];
      const double excess = difference * difference - noise * noise;
      mean += theirs;
      sum += excess;
      squares += excess * excess;
      count += 1.0;
    }
  }
  mean /= count;
  const double excess = sum / count;
  const double deviation = std::sqrt((squares / count - excess * excess) / count);
  return {.rms = std::sqrt(std::max(0.0, excess)) / mean,
          .bound = std::sqrt(std::max(0.0, excess + 2.33 * deviation)) / mean};
}

}  // namespace interglow::test
