// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/elements.h"

#include <Eigen/Geometry>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "diagnostics/error.h"

namespace interglow::radiosity {
namespace {

struct FaceShape {
  Eigen::Vector3d vector_area;
  Eigen::Vector3d centroid;
};

FaceShape shape_of(const scene::Object& object, std::size_t f) {
  const mesh::Face& face = object.patches.faces[f];
  const auto point = [&](int k) { return object.patches.points[static_cast<std::size_t>(face[static_cast<std::size_t>(k)])]; };
  FaceShape shape;
  shape.vector_area = mesh::vector_area(object.patches, face);
  const double area = shape.vector_area.norm();
  double size = 0.0;
  for (int k = 1; k < mesh::corner_count(face); ++k) size = std::max(size, (point(k) - point(0)).norm());
  if (!(area > 0.0) || !std::isfinite(area)) {
    throw InvalidInput(fmt::format("object {}: face {} has no area. Repair the mesh (remesh = \"none\" keeps faces as they are).",
                                   object.name, f));
  }
  if (mesh::corner_count(face) == 3) {
    shape.centroid = (point(0) + point(1) + point(2)) / 3.0;
    return shape;
  }
  const Eigen::Vector3d normal = shape.vector_area / area;
  if (std::abs(normal.dot(point(3) - point(0))) > 1e-6 * size || std::abs(normal.dot(point(2) - point(0))) > 1e-6 * size) {
    throw InvalidInput(fmt::format("object {}: face {} has four corners that are not in one plane. Split it into triangles.",
                                   object.name, f));
  }
  const double first = 0.5 * normal.dot((point(1) - point(0)).cross(point(2) - point(0)));
  const double second = 0.5 * normal.dot((point(2) - point(0)).cross(point(3) - point(0)));
  shape.centroid = (first * (point(0) + point(1) + point(2)) + second * (point(0) + point(2) + point(3))) / (3.0 * (first + second));
  return shape;
}

}  // namespace

Elements make_elements(const scene::Scene& scene) {
  Elements elements;
  Faces& faces = elements.faces;
  std::vector<FaceShape> shapes;
  for (std::size_t o = 0; o < scene.objects.size(); ++o) {
    const scene::Object& object = scene.objects[o];
    const int first_point = static_cast<int>(faces.points.size());
    faces.points.insert(faces.points.end(), object.patches.points.begin(), object.patches.points.end());
    for (std::size_t f = 0; f < object.patches.faces.size(); ++f) {
      mesh::Face corners = object.patches.faces[f];
      for (int& corner : corners) corner = corner < 0 ? corner : corner + first_point;
      faces.corners.push_back(corners);
      faces.object.push_back(static_cast<int>(o));
      shapes.push_back(shape_of(object, f));
    }
  }
  const auto face_count = static_cast<int>(faces.corners.size());
  elements.front_element.assign(static_cast<std::size_t>(face_count), -1);
  elements.back_element.assign(static_cast<std::size_t>(face_count), -1);
  const auto add = [&](int face, bool back) {
    const auto f = static_cast<std::size_t>(face);
    const scene::Object& object = scene.objects[static_cast<std::size_t>(faces.object[f])];
    (back ? elements.back_element : elements.front_element)[f] = static_cast<int>(elements.face.size());
    elements.face.push_back(face);
    elements.back.push_back(back ? 1 : 0);
    elements.material.push_back(back && object.sides == scene::Sides::kOne ? -1 : object.material);
    elements.object.push_back(faces.object[f]);
  };
  for (int f = 0; f < face_count; ++f) add(f, false);
  for (int f = 0; f < face_count; ++f) {
    if (!scene.objects[static_cast<std::size_t>(faces.object[static_cast<std::size_t>(f)])].patches.closed) add(f, true);
  }
  const auto count = static_cast<Eigen::Index>(elements.face.size());
  elements.area_mm2.resize(count);
  elements.normal.resize(count, 3);
  elements.centroid.resize(count, 3);
  for (Eigen::Index e = 0; e < count; ++e) {
    const auto i = static_cast<std::size_t>(e);
    const FaceShape& shape = shapes[static_cast<std::size_t>(elements.face[i])];
    elements.area_mm2[e] = shape.vector_area.norm();
    elements.normal.row(e) = (elements.back[i] != 0 ? -1.0 : 1.0) * shape.vector_area.transpose() / elements.area_mm2[e];
    elements.centroid.row(e) = shape.centroid.transpose();
  }
  return elements;
}

}  // namespace interglow::radiosity
