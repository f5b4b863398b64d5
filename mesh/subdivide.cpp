// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/subdivide.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <tuple>
#include <vector>

#include "diagnostics/error.h"

namespace interglow::mesh {
namespace {

using Eigen::Vector3d;

constexpr double kMostFaces = 5e7;

double parts_of(double length, double edge_length) {
  // An edge that is a whole number of parts long up to rounding is not divided once more.
  return std::max(1.0, std::ceil(length / edge_length * (1.0 - 1e-9)));
}

/// Numbers the points; those on an edge by its ends, so that both neighbours find them.
class Points {
 public:
  explicit Points(PatchMesh& mesh) : mesh_(mesh) {}

  /// The point `step` of `steps` along the edge from a to b.
  int on_edge(int a, int b, int step, int steps) {
    if (step == 0) return a;
    if (step == steps) return b;
    if (a > b) {
      std::swap(a, b);
      step = steps - step;
    }
    const auto [found, is_new] = known_.try_emplace({a, b, step, steps}, static_cast<int>(mesh_.points.size()));
    if (is_new) {
      const double t = static_cast<double>(step) / steps;
      mesh_.points.push_back((1.0 - t) * mesh_.points[static_cast<std::size_t>(a)] +
                             t * mesh_.points[static_cast<std::size_t>(b)]);
    }
    return found->second;
  }
  int inside(const Vector3d& point) {
    mesh_.points.push_back(point);
    return static_cast<int>(mesh_.points.size()) - 1;
  }

 private:
  PatchMesh& mesh_;
  std::map<std::tuple<int, int, int, int>, int> known_;
};

}  // namespace

PatchMesh subdivide(const PatchMesh& mesh, double edge_length_mm) {
  if (!(edge_length_mm > 0.0) || !std::isfinite(edge_length_mm)) {
    throw InvalidParams(fmt::format("edge_length_mm is {}, expected a positive length.", edge_length_mm));
  }
  const auto point = [&](int p) -> const Vector3d& { return mesh.points[static_cast<std::size_t>(p)]; };
  const auto length = [&](int a, int b) { return (point(a) - point(b)).norm(); };
  double expected = 0.0;
  for (const Face& f : mesh.faces) {
    if (corner_count(f) == 3) {
      const double n = parts_of(std::max({length(f[0], f[1]), length(f[1], f[2]), length(f[2], f[0])}), edge_length_mm);
      expected += n * n;
    } else {
      expected += parts_of(std::max(length(f[0], f[1]), length(f[2], f[3])), edge_length_mm) *
                  parts_of(std::max(length(f[1], f[2]), length(f[3], f[0])), edge_length_mm);
    }
  }
  if (expected > kMostFaces) {
    throw InvalidParams(
        fmt::format("edge_length_mm = {} would make {:.3g} faces, expected at most {:.0g}. Choose a longer edge.",
                    edge_length_mm, expected, kMostFaces));
  }

  PatchMesh result;
  result.points = mesh.points;
  result.closed = mesh.closed;
  Points points(result);
  const bool smooth = !mesh.corner_normals.empty();
  for (std::size_t face = 0; face < mesh.faces.size(); ++face) {
    const Face& f = mesh.faces[face];
    const bool triangle = corner_count(f) == 3;
    const auto m =
        static_cast<int>(parts_of(triangle ? std::max({length(f[0], f[1]), length(f[1], f[2]), length(f[2], f[0])})
                                           : std::max(length(f[0], f[1]), length(f[2], f[3])),
                                  edge_length_mm));
    const int n =
        triangle ? m : static_cast<int>(parts_of(std::max(length(f[1], f[2]), length(f[3], f[0])), edge_length_mm));

    // A grid of points (i, j), with weights of the corners; a triangle has those with i + j <= m.
    const auto weights = [&](int i, int j) -> std::array<double, 4> {
      const double u = static_cast<double>(i) / m;
      const double v = static_cast<double>(j) / n;
      if (triangle) return {1.0 - u - v, u, v, 0.0};
      return {(1.0 - u) * (1.0 - v), u * (1.0 - v), u * v, (1.0 - u) * v};
    };
    const int columns = m + 1;
    std::vector<int> number(static_cast<std::size_t>(columns) * static_cast<std::size_t>(n + 1), -1);
    const auto at = [&](int i, int j) -> int& { return number[static_cast<std::size_t>(j * columns + i)]; };
    for (int j = 0; j <= n; ++j) {
      for (int i = 0; i <= (triangle ? m - j : m); ++i) {
        if (j == 0) {
          at(i, j) = points.on_edge(f[0], f[1], i, m);
        } else if (triangle && i == 0) {
          at(i, j) = points.on_edge(f[0], f[2], j, m);
        } else if (triangle && i + j == m) {
          at(i, j) = points.on_edge(f[1], f[2], j, m);
        } else if (!triangle && i == 0) {
          at(i, j) = points.on_edge(f[0], f[3], j, n);
        } else if (!triangle && i == m) {
          at(i, j) = points.on_edge(f[1], f[2], j, n);
        } else if (!triangle && j == n) {
          at(i, j) = points.on_edge(f[3], f[2], i, m);
        } else {
          const std::array<double, 4> w = weights(i, j);
          Vector3d p = w[0] * point(f[0]) + w[1] * point(f[1]) + w[2] * point(f[2]);
          if (!triangle) p += w[3] * point(f[3]);
          at(i, j) = points.inside(p);
        }
      }
    }
    const auto add = [&](std::initializer_list<std::array<int, 2>> cells) {
      Face made{-1, -1, -1, -1};
      std::array<Vector3d, 4> normals{Vector3d::Zero(), Vector3d::Zero(), Vector3d::Zero(), Vector3d::Zero()};
      std::size_t k = 0;
      for (const auto& [i, j] : cells) {
        made[k] = at(i, j);
        if (smooth) {
          const std::array<double, 4> w = weights(i, j);
          for (std::size_t c = 0; c < (triangle ? 3U : 4U); ++c) normals[k] += w[c] * mesh.corner_normals[face][c];
          normals[k].normalize();
        }
        ++k;
      }
      result.faces.push_back(made);
      if (smooth) result.corner_normals.push_back(normals);
    };
    for (int j = 0; j < n; ++j) {
      for (int i = 0; i < (triangle ? m - j : m); ++i) {
        if (!triangle) {
          add({{i, j}, {i + 1, j}, {i + 1, j + 1}, {i, j + 1}});
          continue;
        }
        add({{i, j}, {i + 1, j}, {i, j + 1}});
        if (i + j + 1 < m) add({{i + 1, j}, {i + 1, j + 1}, {i, j + 1}});
      }
    }
  }
  return result;
}

}  // namespace interglow::mesh
