// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/hole_filling.h"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/triangulate_hole.h>
#include <CGAL/box_intersection_d.h>
#include <CGAL/intersections.h>

#include <algorithm>
#include <iterator>

#include "mesh/weld_points.h"

namespace interglow::mesh::detail {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Box = CGAL::Box_intersection_d::Box_with_info_d<double, 3, int>;

Kernel::Point_3 cgal_point(const Eigen::Vector3d& p) { return {p.x(), p.y(), p.z()}; }

}  // namespace

std::vector<std::array<int, 3>> span_loop(const std::vector<Eigen::Vector3d>& loop) {
  std::vector<Kernel::Point_3> points;
  points.reserve(loop.size());
  for (const Eigen::Vector3d& p : loop) points.push_back(cgal_point(p));
  std::vector<CGAL::Triple<int, int, int>> spanned;
  CGAL::Polygon_mesh_processing::triangulate_hole_polyline(points, std::back_inserter(spanned));
  std::vector<std::array<int, 3>> triangles;
  for (const auto& triangle : spanned) {
    std::array<int, 3> corners{triangle.first, triangle.second, triangle.third};
    std::sort(corners.begin(), corners.end());  // increasing positions follow the loop
    triangles.push_back(corners);
  }
  return triangles;
}

std::size_t count_self_intersections(const TriangleMesh& mesh) {
  const WeldedPoints welded = weld_equal_points(mesh.points);
  std::vector<Kernel::Triangle_3> triangles;
  std::vector<Box> boxes;
  triangles.reserve(mesh.triangles.size());
  boxes.reserve(mesh.triangles.size());
  for (const auto& [a, b, c] : mesh.triangles) {
    triangles.emplace_back(cgal_point(mesh.points[a]), cgal_point(mesh.points[b]), cgal_point(mesh.points[c]));
    boxes.emplace_back(triangles.back().bbox(), static_cast<int>(boxes.size()));
  }
  const auto corner = [&](int face, int k) { return welded.index_of[mesh.triangles[face][k]]; };
  std::size_t pairs = 0;
  CGAL::box_self_intersection_d(boxes.begin(), boxes.end(), [&](const Box& first, const Box& second) {
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        if (corner(first.info(), i) == corner(second.info(), j)) return;
      }
    }
    if (CGAL::do_intersect(triangles[first.info()], triangles[second.info()])) ++pairs;
  });
  return pairs;
}

}  // namespace interglow::mesh::detail
