// SPDX-License-Identifier: GPL-3.0-or-later
#include "rendering/contact.h"

#include "diagnostics/error.h"
#include "mesh/quality.h"
#include "mesh/surface_index.h"
#include "rendering/camera_rays.h"
#include "rendering/paper_images.h"
#include "rendering/surface.h"

namespace interglow::rendering {
namespace {

/// <component, function> / <function, function> of one pixel; 0 if there is no such component.
double projection(const image::SpectralImage& component, std::size_t pixel, const Eigen::VectorXd& function) {
  if (component.value.empty() || !(function.squaredNorm() > 0.0)) return 0.0;
  const Eigen::Map<const Eigen::VectorXf> values(
      component.value.data() + pixel * static_cast<std::size_t>(component.bands()), component.bands());
  return values.cast<double>().dot(function) / function.squaredNorm();
}

/// Adds the terms of the pixels of the region.
void add_projected_terms(const scene::Scene& scene, const RenderedImages& images, const std::vector<int>& region,
                         ContactRatio& ratio) {
  for (std::size_t pixel = 0; pixel < region.size(); ++pixel) {
    if (region[pixel] < 0) continue;
    const radiosity::PaperFunctions functions = camera_functions(scene, images.object[pixel], region[pixel]);
    ratio.mean_f_re += projection(images.re, pixel, functions.re);
    ratio.mean_f_rr += projection(images.rr, pixel, functions.rr);
  }
}

}  // namespace

std::vector<int> contact_region(const scene::Scene& scene, const radiosity::Elements& elements, double distance_mm) {
  const CameraRays camera = camera_rays(scene.camera);
  const radiosity::Visibility visibility(elements.faces);
  const Surface surface(scene, elements);
  std::vector<mesh::SurfaceIndex> indices;
  for (const scene::Object& object : scene.objects) {
    indices.emplace_back(object.patches.points, mesh::triangles_of(object.patches));
  }
  const auto width = static_cast<std::size_t>(camera.width);
  std::vector<int> neighbour(width * static_cast<std::size_t>(camera.height), -1);
  std::vector<Eigen::Vector3d> directions(width);
  std::vector<int> faces(width);
  for (int row = 0; row < camera.height; ++row) {
    for (std::size_t column = 0; column < width; ++column) {
      directions[column] = camera.direction(static_cast<double>(column) + 0.5, row + 0.5);
    }
    visibility.first_faces(camera.origin, directions, faces);
    for (std::size_t column = 0; column < width; ++column) {
      if (faces[column] < 0) continue;
      const Eigen::Vector3d point = surface.meet(faces[column], camera.origin, directions[column]);
      double nearest = distance_mm;
      for (std::size_t other = 0; other < scene.objects.size(); ++other) {
        if (static_cast<int>(other) == surface.object(faces[column])) continue;
        const double distance = (indices[other].closest(point).point - point).norm();
        if (distance >= nearest) continue;
        nearest = distance;
        neighbour[static_cast<std::size_t>(row) * width + column] = static_cast<int>(other);
      }
    }
  }
  return neighbour;
}

std::optional<ContactRatio> contact_ratio(const scene::Scene& scene, const radiosity::Elements& elements,
                                          const RenderedImages& images, double distance_mm) {
  if (scene.objects.size() < 2) return std::nullopt;
  std::vector<int> region = contact_region(scene, elements, distance_mm);
  ContactRatio ratio;
  ratio.distance_mm = distance_mm;
  for (std::size_t pixel = 0; pixel < region.size(); ++pixel) {
    // At silhouettes the centre may show another object than most of the pixel.
    if (images.object[pixel] < 0 || images.object[pixel] == region[pixel]) region[pixel] = -1;
    ratio.pixels += region[pixel] >= 0 ? 1 : 0;
  }
  if (ratio.pixels == 0) return std::nullopt;
  try {
    const radiosity::ShadingTerms terms = paper_shading_terms(scene, images);
    for (std::size_t pixel = 0; pixel < region.size(); ++pixel) {
      if (region[pixel] < 0) continue;
      ratio.mean_f_re += terms.re[static_cast<Eigen::Index>(pixel)];
      ratio.mean_f_rr += terms.rr[static_cast<Eigen::Index>(pixel)];
    }
    ratio.least_squares = true;
  } catch (const InvalidInput&) {  // not two objects, or grey ones: the components tell the terms apart
    add_projected_terms(scene, images, region, ratio);
  }
  if (!(ratio.mean_f_re > 0.0)) return std::nullopt;
  ratio.w = ratio.mean_f_rr / ratio.mean_f_re;
  ratio.mean_f_re /= ratio.pixels;
  ratio.mean_f_rr /= ratio.pixels;
  return ratio;
}

}  // namespace interglow::rendering
