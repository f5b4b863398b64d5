// SPDX-License-Identifier: GPL-3.0-or-later
#include "verification/check_scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "diagnostics/error.h"

namespace interglow::verification {

scene::Scene check_scene(const scene::Scene& scene, int largest_side_px) {
  if (largest_side_px < 1) {
    throw InvalidParams(fmt::format("cross-check: size {} px, expected at least 1.", largest_side_px));
  }
  scene::Scene flat = scene;
  for (scene::Object& object : flat.objects) object.patches.corner_normals.clear();
  scene::Camera& camera = flat.camera;
  const int largest = std::max(camera.width, camera.height);
  if (largest > largest_side_px) {
    const auto scaled = [&](int side) {
      return std::max(1, static_cast<int>(std::lround(static_cast<double>(side) * largest_side_px / largest)));
    };
    camera.width = scaled(camera.width);
    camera.height = scaled(camera.height);
  }
  return flat;
}

mesh::PatchMesh halved(const mesh::PatchMesh& mesh) {
  mesh::PatchMesh fine;
  fine.points = mesh.points;
  fine.closed = mesh.closed;
  std::map<std::pair<int, int>, int> midpoints;
  const auto add = [&](const Eigen::Vector3d& point) {
    fine.points.push_back(point);
    return static_cast<int>(fine.points.size()) - 1;
  };
  const auto at = [&](int point) -> const Eigen::Vector3d& { return mesh.points[static_cast<std::size_t>(point)]; };
  const auto middle = [&](int a, int b) {
    const auto [place, is_new] = midpoints.try_emplace(std::minmax(a, b), 0);
    if (is_new) place->second = add(0.5 * (at(a) + at(b)));
    return place->second;
  };
  for (const mesh::Face& face : mesh.faces) {
    const auto [a, b, c, d] = face;
    const int ab = middle(a, b);
    const int bc = middle(b, c);
    if (mesh::corner_count(face) == 3) {
      const int ca = middle(c, a);
      fine.faces.insert(fine.faces.end(), {{a, ab, ca, -1}, {ab, b, bc, -1}, {ca, bc, c, -1}, {ab, bc, ca, -1}});
      continue;
    }
    const int cd = middle(c, d);
    const int da = middle(d, a);
    // The midpoints of a quad's edges form a parallelogram; its centre lies inside every convex quad.
    const int centre = add(0.25 * (at(a) + at(b) + at(c) + at(d)));
    fine.faces.insert(fine.faces.end(),
                      {{a, ab, centre, da}, {ab, b, bc, centre}, {centre, bc, c, cd}, {da, centre, cd, d}});
  }
  return fine;
}

scene::Scene halved(const scene::Scene& scene) {
  scene::Scene fine = scene;
  for (scene::Object& object : fine.objects) object.patches = halved(object.patches);
  return fine;
}

std::size_t patch_count(const scene::Scene& scene) {
  std::size_t count = 0;
  for (const scene::Object& object : scene.objects) count += object.patches.faces.size();
  return count;
}

Eigen::VectorXd camera_band_widths_nm(const scene::Scene& scene) {
  const scene::Camera& camera = scene.camera;
  const int last = camera.last_band < 0 ? static_cast<int>(scene.grid.size()) - 1 : camera.last_band;
  return scene.grid.widths_nm().segment(camera.first_band, last - camera.first_band + 1);
}

}  // namespace interglow::verification
