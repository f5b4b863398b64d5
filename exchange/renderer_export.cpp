// SPDX-License-Identifier: GPL-3.0-or-later
#include "exchange/renderer_export.h"

#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include "exchange/scene_text.h"
#include "files/atomic_file.h"
#include "mesh/mesh_writer.h"

namespace interglow::exchange {
namespace {

mesh::TriangleMesh triangles_of(const mesh::PatchMesh& patches) {
  mesh::TriangleMesh mesh{patches.points, {}};
  mesh.triangles.reserve(patches.faces.size());
  for (const mesh::Face& face : patches.faces) {
    mesh.triangles.push_back({face[0], face[1], face[2]});
    if (mesh::corner_count(face) == 4) mesh.triangles.push_back({face[0], face[2], face[3]});
  }
  return mesh;
}

bool bands_are_equally_wide(const scene::Scene& scene) {
  const Eigen::VectorXd widths = scene.grid.widths_nm();
  return (widths.array() - widths[0]).abs().maxCoeff() <= 1e-9 * widths[0];
}

Warnings losses(const scene::Scene& scene, Renderer renderer) {
  Warnings warnings;
  for (const spectral::Material& material : scene.materials) {
    const Eigen::MatrixXd& luminescence = material.donaldson.luminescence;
    if (luminescence.size() == 0 || luminescence.isZero(0.0)) continue;
    warnings.push_back(
        fmt::format("material \"{}\" fluoresces, and the exported one does not: it only reflects. In the band that "
                    "excites it most, {:.0f} % of the light comes back at other wavelengths here and is lost there.",
                    material.name, 100.0 * luminescence.colwise().sum().maxCoeff()));
  }
  for (const scene::DirectionalLight& light : scene.directional_lights) {
    if (light.half_angle_rad > 0.0) {
      warnings.push_back(
          fmt::format("light \"{}\" is exported as a parallel beam, without the half-shadows of its disk "
                      "(half-angle {:.3g} degrees).",
                      light.name, light.half_angle_rad * 180.0 / std::numbers::pi));
    }
  }
  if (scene.sky) {
    warnings.push_back(
        fmt::format("light \"{}\": the background shows this sky there, and is black here.", scene.sky->name));
  }
  if (renderer == Renderer::kPbrt4) {
    for (const scene::Object& object : scene.objects) {
      if (object.sides == scene::Sides::kTwo || object.patches.closed) continue;
      warnings.push_back(fmt::format(
          "object \"{}\" is a sheet with one side: its back is black here and reflects in pbrt.", object.name));
    }
    if (!bands_are_equally_wide(scene))
      warnings.emplace_back("the bands are not equally wide, and those of pbrt's picture are.");
  }
  return warnings;
}

}  // namespace

void validate(const RendererExportParams& params) {
  if (params.bounces && *params.bounces < 0)
    throw InvalidParams(fmt::format("export: bounces is {}, expected at least 0.", *params.bounces));
  if (params.samples_per_pixel < 1)
    throw InvalidParams(fmt::format("export: samples_per_pixel is {}, expected at least 1.", params.samples_per_pixel));
}

RendererExport export_for_renderer(const scene::Scene& scene, Renderer renderer, const std::filesystem::path& folder,
                                   const RendererExportParams& params) {
  validate(params);
  scene::validate(scene);
  RendererExport written;
  const bool is_pbrt = renderer == Renderer::kPbrt4;
  const std::string text = is_pbrt ? detail::pbrt_scene(scene, params) : detail::mitsuba_scene(scene, renderer, params);
  written.files.push_back(folder / (is_pbrt ? "scene.pbrt" : "scene.xml"));
  for (std::size_t object = 0; object < scene.objects.size(); ++object) {
    written.files.push_back(folder / detail::mesh_file(scene, object));
    mesh::write_mesh(written.files.back(), triangles_of(scene.objects[object].patches));
  }
  // The scene comes last: where it is, everything it names is there.
  files::write_text_atomically(written.files.front(), text);
  written.warnings = losses(scene, renderer);
  return written;
}

}  // namespace interglow::exchange
