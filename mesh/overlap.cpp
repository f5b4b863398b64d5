// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/overlap.h"

#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "mesh/surface_index.h"

namespace interglow::mesh {
namespace {

using Eigen::Vector3d;

struct Located {
  double height = 1;  ///< over the other surface; positive: outside
  Vector3d normal = Vector3d::Zero();
  bool counts = false;
};

/// A surface with what queries need.
struct Side {
  const SolidSurface& surface;
  SurfaceIndex index;
  std::vector<char> is_border;  ///< per triangle edge 3 t + k
  Eigen::AlignedBox3d box;

  explicit Side(const SolidSurface& given) : surface(given), index(given.points, given.triangles) {
    // Kept triangles may be joined in any way, so edges are counted rather than paired.
    std::vector<std::array<int, 3>> edges;
    for (std::size_t e = 0; e < 3 * given.triangles.size(); ++e) {
      const auto& t = given.triangles[e / 3];
      const auto [low, high] = std::minmax(t[e % 3], t[(e % 3 + 1) % 3]);
      edges.push_back({low, high, static_cast<int>(e)});
    }
    std::sort(edges.begin(), edges.end());
    is_border.assign(edges.size(), 0);
    point_on_border.assign(given.points.size(), 0);
    const auto same = [&](std::size_t i, std::size_t j) {
      return j < edges.size() && edges[i][0] == edges[j][0] && edges[i][1] == edges[j][1];
    };
    for (std::size_t i = 0; i < edges.size(); ++i)
      if (!same(i, i + 1) && (i == 0 || !same(i, i - 1))) {
        is_border[edges[i][2]] = 1;
        point_on_border[edges[i][0]] = point_on_border[edges[i][1]] = 1;
      }
    for (const Vector3d& p : given.points) box.extend(p);
  }
  std::vector<char> point_on_border;

  Located locate(const Vector3d& x, const Vector3d& own_normal, double tolerance) const {
    Located result;
    if (box.exteriorDistance(x) > tolerance) return result;
    const SurfacePoint on = index.closest(x);
    const Vector3d d = x - on.point;
    if (d.norm() > tolerance) return result;
    const auto& t = surface.triangles[on.triangle];
    // Nearest to the border: beside the surface, not behind it.
    for (int k = 0; k < 3; ++k) {
      if (on.barycentric[(k + 2) % 3] < 1e-9 && is_border[3 * on.triangle + k]) return result;
      if (on.barycentric[k] > 1 - 1e-9 && point_on_border[t[k]]) return result;
    }
    for (int k = 0; k < 3; ++k) result.normal += on.barycentric[k] * surface.normals[t[k]];
    result.normal.normalize();
    result.counts = result.normal.dot(own_normal) < -0.3;
    const Vector3d flat =
        (surface.points[t[1]] - surface.points[t[0]]).cross(surface.points[t[2]] - surface.points[t[0]]).normalized();
    // Within a triangle the flat normal decides; at its rim the blended one must not contradict it.
    const bool within = on.barycentric.minCoeff() > 1e-9;
    result.height = d.dot(within ? flat : result.normal);
    return result;
  }
};

std::vector<Side> make_sides(const std::vector<SolidSurface>& surfaces) {
  std::vector<Side> sides;
  sides.reserve(surfaces.size());
  for (const SolidSurface& surface : surfaces) sides.emplace_back(surface);
  return sides;
}

bool are_near(const Side& a, const Side& b) {
  return a.box.exteriorDistance(b.box) <= std::max(a.surface.tolerance_mm, b.surface.tolerance_mm);
}

}  // namespace

std::vector<Vector3d> point_normals(const std::vector<Vector3d>& points,
                                    const std::vector<std::array<int, 3>>& triangles) {
  std::vector<Vector3d> normals(points.size(), Vector3d::Zero());
  for (const auto& t : triangles) {
    const Vector3d area = (points[t[1]] - points[t[0]]).cross(points[t[2]] - points[t[0]]);
    for (int v : t) normals[v] += area;
  }
  for (Vector3d& n : normals) n = n.norm() > 0 ? Vector3d(n.normalized()) : Vector3d::UnitZ();
  return normals;
}

std::vector<Overlap> measure_overlap(const std::vector<SolidSurface>& surfaces) {
  std::vector<Overlap> result(surfaces.size());
  const std::vector<Side> sides = make_sides(surfaces);
  for (std::size_t a = 0; a < sides.size(); ++a)
    for (std::size_t b = 0; b < sides.size(); ++b) {
      if (a == b || !are_near(sides[a], sides[b])) continue;
      const SolidSurface& own = surfaces[a];
      const double tolerance = std::max(own.tolerance_mm, surfaces[b].tolerance_mm);
      std::vector<double> depth(own.points.size(), 0);
      tbb::parallel_for(std::size_t{0}, own.points.size(), [&](std::size_t i) {
        const Located at = sides[b].locate(own.points[i], own.normals[i], tolerance);
        if (at.counts && at.height < -kContactRoundingMm) depth[i] = -at.height;
      });
      for (const auto& t : own.triangles) {
        const double area = (own.points[t[1]] - own.points[t[0]]).cross(own.points[t[2]] - own.points[t[0]]).norm() / 2;
        for (int v : t) {
          result[a].depth_mm = std::max(result[a].depth_mm, depth[v]);
          if (depth[v] > 0) result[a].area_mm2 += area / 3;
        }
      }
      if (a < b) {
        const auto pairs = crossing_triangles(own.points, own.triangles, surfaces[b].points, surfaces[b].triangles);
        result[a].crossing_pairs += static_cast<int>(pairs.size());
        result[b].crossing_pairs += static_cast<int>(pairs.size());
      }
    }
  return result;
}

bool separate(std::vector<SolidSurface>& surfaces) {
  constexpr int kRounds = 40;
  for (int round = 0; round < kRounds; ++round) {
    bool clean = true;
    std::vector<std::vector<Vector3d>> moves(surfaces.size());
    for (std::size_t a = 0; a < surfaces.size(); ++a) moves[a].assign(surfaces[a].points.size(), Vector3d::Zero());
    const std::vector<Side> sides = make_sides(surfaces);
    for (std::size_t a = 0; a < sides.size(); ++a)
      for (std::size_t b = 0; b < sides.size(); ++b) {
        if (a == b || !are_near(sides[a], sides[b])) continue;
        const SolidSurface& own = surfaces[a];
        const double tolerance = std::max(own.tolerance_mm, surfaces[b].tolerance_mm);
        const double clearance = 1e-4 * tolerance;
        std::vector<Vector3d> pushes(own.points.size(), Vector3d::Zero());
        tbb::parallel_for(std::size_t{0}, own.points.size(), [&](std::size_t i) {
          if (own.is_fixed[i]) return;
          const Located at = sides[b].locate(own.points[i], own.normals[i], tolerance);
          // A border that pokes through a surface at an angle is drawn back as well.
          const bool counts = at.counts || sides[a].point_on_border[i];
          if (counts && at.height < -kContactRoundingMm && at.normal.squaredNorm() > 0)
            pushes[i] = (clearance - 0.6 * at.height) * at.normal;
        });
        for (std::size_t i = 0; i < pushes.size(); ++i) {
          if (pushes[i].isZero(0)) continue;
          clean = false;
          moves[a][i] += pushes[i];
        }
        if (a > b) continue;
        const auto pairs = crossing_triangles(own.points, own.triangles, surfaces[b].points, surfaces[b].triangles);
        for (const auto& [s, t] : pairs) {
          clean = false;
          const auto drift = [&](std::size_t from, int triangle, std::size_t to, int other) {
            Vector3d normal = Vector3d::Zero(), own_normal = Vector3d::Zero();
            for (int k = 0; k < 3; ++k) {
              normal += surfaces[to].normals[surfaces[to].triangles[other][k]];
              own_normal += surfaces[from].normals[surfaces[from].triangles[triangle][k]];
            }
            normal.normalize();
            const bool facing = own_normal.normalized().dot(normal) < -0.3;
            for (int v : surfaces[from].triangles[triangle]) {
              if (surfaces[from].is_fixed[v] || !moves[from][v].isZero(0)) continue;
              if (facing || sides[from].point_on_border[v]) moves[from][v] = clearance * (1 + round) * normal;
            }
          };
          drift(a, s, b, t);
          drift(b, t, a, s);
        }
      }
    if (clean) return true;
    for (std::size_t a = 0; a < surfaces.size(); ++a)
      for (std::size_t i = 0; i < moves[a].size(); ++i) surfaces[a].points[i] += moves[a][i];
  }
  return false;
}

}  // namespace interglow::mesh
