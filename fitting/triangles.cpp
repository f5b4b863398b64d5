// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/triangles.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <map>

namespace interglow::fitting {
namespace {

using Eigen::Vector3d;

/// Over a chord a parabola of height h has the area of a triangle of height 4/3 h.
constexpr double kSameArea = 4.0 / 3.0;

/// Half of a face with the smooth surface over it.
struct RoundHalf {
  std::array<int, 3> point;  ///< of the faces
  std::array<Vector3d, 3> corner;
  std::array<Vector3d, 3> normal;
  std::array<Vector3d, 3> bulge;  ///< d_01, d_12, d_20

  void set_bulges() {
    for (std::size_t k = 0; k < 3; ++k) {
      const Vector3d way = corner[(k + 1) % 3] - corner[k];
      const Vector3d& a = normal[k];
      const Vector3d& b = normal[(k + 1) % 3];
      bulge[k] = (way.dot(b) * b - way.dot(a) * a) / 8.0;
    }
  }
};

struct Part {
  std::array<Vector3d, 3> weights;
  std::array<int, 3> point;
  std::array<int, 3> edge;  ///< of the half: 01, 12, 20; -1: within it or halved
};

}  // namespace

Triangles make_triangles(const scene::Scene& scene, const radiosity::Elements& elements,
                         const rendering::Surface& surface, double tolerance_mm) {
  const radiosity::Faces& faces = elements.faces;
  Triangles result;
  result.faces.points = faces.points;
  std::map<std::pair<int, int>, std::pair<int, int>> edges;  // directed edge to triangle and its edge
  std::map<std::pair<int, int>, int> middles;                // of halved edges
  int first_face = 0;
  int object = -1;
  for (int face = 0; face < faces.size(); ++face) {
    const auto f = static_cast<std::size_t>(face);
    if (faces.object[f] != object) {
      object = faces.object[f];
      first_face = face;
    }
    const auto& normals = scene.objects[static_cast<std::size_t>(object)].patches.corner_normals;
    for (int half = 0; half < surface.triangles(face); ++half) {
      const std::array<int, 3> which = rendering::Surface::corners(half);
      RoundHalf round;
      for (std::size_t k = 0; k < 3; ++k) {
        const auto at = static_cast<std::size_t>(which[k]);
        round.point[k] = faces.corners[f][at];
        round.corner[k] = surface.corner(face, which[k]);
        round.normal[k] =
            normals.empty() ? surface.face_normal(face) : normals[static_cast<std::size_t>(face - first_face)][at];
      }
      round.set_bulges();
      std::vector<Part> parts{{{Vector3d::UnitX(), Vector3d::UnitY(), Vector3d::UnitZ()}, round.point, {0, 1, 2}}};
      while (!parts.empty()) {
        const Part part = parts.back();
        parts.pop_back();
        std::size_t worst = 0;
        double height = 0.0;
        for (std::size_t k = 0; k < 3 && !normals.empty(); ++k) {
          if (part.edge[k] < 0) continue;
          const double here = round.bulge[static_cast<std::size_t>(part.edge[k])].norm();
          if (here > height) {
            height = here;
            worst = k;
          }
        }
        if (height > tolerance_mm) {
          const std::size_t next = (worst + 1) % 3;
          const auto [found, is_new] = middles.try_emplace(std::minmax(part.point[worst], part.point[next]),
                                                           static_cast<int>(result.faces.points.size()));
          if (is_new) {
            const auto edge = static_cast<std::size_t>(part.edge[worst]);
            result.faces.points.push_back(0.5 * (round.corner[edge] + round.corner[(edge + 1) % 3]) +
                                          kSameArea * round.bulge[edge]);
          }
          Part one = part;
          Part two = part;
          one.weights[next] = two.weights[worst] = 0.5 * (part.weights[worst] + part.weights[next]);
          one.point[next] = two.point[worst] = found->second;
          one.edge[worst] = one.edge[next] = two.edge[worst] = two.edge[(worst + 2) % 3] = -1;
          parts.push_back(two);
          parts.push_back(one);
          continue;
        }
        const int index = static_cast<int>(result.face.size());
        std::array<Vector3d, 3> corner;
        std::array<Vector3d, 3> normal;
        for (std::size_t k = 0; k < 3; ++k) {
          corner[k] = result.faces.points[static_cast<std::size_t>(part.point[k])];
          const Vector3d& w = part.weights[k];
          normal[k] = (w[0] * round.normal[0] + w[1] * round.normal[1] + w[2] * round.normal[2]).normalized();
          const int a = part.point[k];
          const int b = part.point[(k + 1) % 3];
          edges[{a, b}] = {index, static_cast<int>(k)};
        }
        const Vector3d own = (corner[1] - corner[0]).cross(corner[2] - corner[0]).normalized();
        result.face.push_back(face);
        result.half.push_back(half);
        result.weights.push_back(part.weights);
        result.corner.push_back(corner);
        result.normal.push_back(normal);
        result.face_normal.push_back(normals.empty() ? surface.face_normal(face) : own);
        result.neighbour.push_back({-1, -1, -1});
        result.faces.corners.push_back({part.point[0], part.point[1], part.point[2], -1});
        result.faces.object.push_back(object);
      }
    }
  }
  for (const auto& [edge, place] : edges) {
    const auto other = edges.find({edge.second, edge.first});
    if (other == edges.end()) continue;
    result.neighbour[static_cast<std::size_t>(place.first)][static_cast<std::size_t>(place.second)] =
        other->second.first;
  }
  return result;
}

}  // namespace interglow::fitting
