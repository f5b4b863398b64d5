// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/surface_index.h"

#include <CGAL/AABB_segment_primitive.h>
#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/AABB_triangle_primitive.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Simple_cartesian.h>
#include <CGAL/box_intersection_d.h>

#include <Eigen/Geometry>
#include <algorithm>

namespace interglow::mesh {
namespace {

// Distances need speed, not exactness; crossings are decided by exact predicates.
using Kernel = CGAL::Simple_cartesian<double>;
using ExactKernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Triangles = std::vector<Kernel::Triangle_3>;
using Segments = std::vector<Kernel::Segment_3>;

template <typename K = Kernel>
typename K::Point_3 to_cgal(const Eigen::Vector3d& p) {
  return {p.x(), p.y(), p.z()};
}
Eigen::Vector3d to_eigen(const Kernel::Point_3& p) { return {p.x(), p.y(), p.z()}; }

Eigen::Vector3d barycentric(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                            const Eigen::Vector3d& c) {
  const Eigen::Vector3d normal = (b - a).cross(c - a);
  const double square = normal.squaredNorm();
  if (!(square > 0)) return {1, 0, 0};
  Eigen::Vector3d result((b - p).cross(c - p).dot(normal), (c - p).cross(a - p).dot(normal), 0);
  result /= square;
  result[2] = 1 - result[0] - result[1];
  result = result.cwiseMax(0.0);
  return result / result.sum();
}

}  // namespace

struct SurfaceIndex::Tree {
  using Primitive = CGAL::AABB_triangle_primitive<Kernel, Triangles::const_iterator>;
  using Aabb = CGAL::AABB_tree<CGAL::AABB_traits<Kernel, Primitive>>;
  Triangles triangles;
  Aabb aabb;

  SurfacePoint locate(const Aabb::Point_and_primitive_id& found) const {
    SurfacePoint result;
    result.triangle = static_cast<int>(found.second - triangles.begin());
    result.point = to_eigen(found.first);
    const Kernel::Triangle_3& t = *found.second;
    result.barycentric = barycentric(result.point, to_eigen(t[0]), to_eigen(t[1]), to_eigen(t[2]));
    return result;
  }
};

SurfaceIndex::SurfaceIndex(const std::vector<Eigen::Vector3d>& points, const std::vector<std::array<int, 3>>& triangles)
    : tree_(std::make_unique<Tree>()) {
  tree_->triangles.reserve(triangles.size());
  for (const auto& t : triangles)
    tree_->triangles.emplace_back(to_cgal(points[t[0]]), to_cgal(points[t[1]]), to_cgal(points[t[2]]));
  tree_->aabb.insert(tree_->triangles.begin(), tree_->triangles.end());
  // Both are lazy by default, which would not be safe on several threads.
  tree_->aabb.build();
  tree_->aabb.accelerate_distance_queries();
}
SurfaceIndex::~SurfaceIndex() = default;
SurfaceIndex::SurfaceIndex(SurfaceIndex&&) noexcept = default;
SurfaceIndex& SurfaceIndex::operator=(SurfaceIndex&&) noexcept = default;

SurfacePoint SurfaceIndex::closest(const Eigen::Vector3d& query) const {
  return tree_->locate(tree_->aabb.closest_point_and_primitive(to_cgal(query)));
}

SurfacePoint SurfaceIndex::closest(const Eigen::Vector3d& query, const SurfacePoint& hint) const {
  if (hint.triangle < 0) return closest(query);
  return tree_->locate(tree_->aabb.closest_point_and_primitive(
      to_cgal(query),
      Tree::Aabb::Point_and_primitive_id(to_cgal(hint.point), tree_->triangles.begin() + hint.triangle)));
}

bool SurfaceIndex::is_hit(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const {
  return tree_->aabb.do_intersect(
      Kernel::Ray_3(to_cgal(origin), Kernel::Vector_3(direction.x(), direction.y(), direction.z())));
}

struct CurveIndex::Tree {
  using Primitive = CGAL::AABB_segment_primitive<Kernel, Segments::const_iterator>;
  using Aabb = CGAL::AABB_tree<CGAL::AABB_traits<Kernel, Primitive>>;
  Segments segments;
  Aabb aabb;
};

CurveIndex::CurveIndex(const std::vector<Eigen::Vector3d>& points, const std::vector<std::array<int, 2>>& segments)
    : tree_(std::make_unique<Tree>()) {
  for (const auto& s : segments) tree_->segments.emplace_back(to_cgal(points[s[0]]), to_cgal(points[s[1]]));
  if (segments.empty()) return;
  tree_->aabb.insert(tree_->segments.begin(), tree_->segments.end());
  tree_->aabb.build();
  tree_->aabb.accelerate_distance_queries();
}
CurveIndex::~CurveIndex() = default;
CurveIndex::CurveIndex(CurveIndex&&) noexcept = default;
CurveIndex& CurveIndex::operator=(CurveIndex&&) noexcept = default;

bool CurveIndex::empty() const { return tree_->segments.empty(); }

Eigen::Vector3d CurveIndex::closest(const Eigen::Vector3d& query) const {
  return to_eigen(tree_->aabb.closest_point(to_cgal(query)));
}

namespace {

using Corners = std::array<Eigen::Vector3d, 3>;

/// Whether a lies on one side of b's plane, up to rounding, with a corner that is clearly off it: an edge that was
/// computed twice, once for each of two surfaces that meet there, is not where they pass through each other.
bool stays_on_one_side(const Corners& a, const Corners& b) {
  const Eigen::Vector3d normal = (b[1] - b[0]).cross(b[2] - b[0]).normalized();
  double low = 0.0;
  double high = 0.0;
  for (const Eigen::Vector3d& corner : a) {
    const double height = normal.dot(corner - b[0]);
    low = std::min(low, height);
    high = std::max(high, height);
  }
  return (low >= -kContactRoundingMm) != (high <= kContactRoundingMm);
}

bool cross(const Corners& a, const Corners& b) {
  if (stays_on_one_side(a, b) || stays_on_one_side(b, a)) return false;
  std::array<int, 3> twin{-1, -1, -1};  // corner of b that coincides with corner i of a
  int shared = 0;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      if (twin[i] < 0 && a[i] == b[j]) twin[i] = j, ++shared;
  const auto triangle = [](const Corners& t) {
    return ExactKernel::Triangle_3(to_cgal<ExactKernel>(t[0]), to_cgal<ExactKernel>(t[1]), to_cgal<ExactKernel>(t[2]));
  };
  if (shared == 0) return CGAL::do_intersect(triangle(a), triangle(b));
  if (shared == 1) {
    // They cross beyond the common corner exactly if one triangle's opposite edge meets the other triangle.
    int i = 0;
    while (twin[i] < 0) ++i;
    const int j = twin[i];
    const ExactKernel::Segment_3 edge_a(to_cgal<ExactKernel>(a[(i + 1) % 3]), to_cgal<ExactKernel>(a[(i + 2) % 3]));
    const ExactKernel::Segment_3 edge_b(to_cgal<ExactKernel>(b[(j + 1) % 3]), to_cgal<ExactKernel>(b[(j + 2) % 3]));
    return CGAL::do_intersect(edge_a, triangle(b)) || CGAL::do_intersect(edge_b, triangle(a));
  }
  if (shared == 2) {
    // A hinge: they overlap only if coplanar and on the same side of the common edge.
    int i = 0;
    while (twin[i] >= 0) ++i;
    int j = 0;
    while (j == twin[(i + 1) % 3] || j == twin[(i + 2) % 3]) ++j;
    const auto p = to_cgal<ExactKernel>(a[(i + 1) % 3]);
    const auto q = to_cgal<ExactKernel>(a[(i + 2) % 3]);
    const auto r = to_cgal<ExactKernel>(a[i]);
    const auto s = to_cgal<ExactKernel>(b[j]);
    return CGAL::coplanar(p, q, r, s) && CGAL::coplanar_orientation(p, q, r, s) == CGAL::POSITIVE;
  }
  return true;
}

}  // namespace

std::vector<std::pair<int, int>> crossing_triangles(const std::vector<Eigen::Vector3d>& points_a,
                                                    const std::vector<std::array<int, 3>>& triangles_a,
                                                    const std::vector<Eigen::Vector3d>& points_b,
                                                    const std::vector<std::array<int, 3>>& triangles_b) {
  struct Box : CGAL::Box_intersection_d::Box_d<double, 3> {
    Box(const CGAL::Bbox_3& bounds, int index) : Box_d(bounds), triangle(index) {}
    int triangle;
  };
  const auto boxes_of = [](const auto& points, const auto& triangles, const CGAL::Bbox_3& region) {
    std::vector<Box> boxes;
    for (std::size_t i = 0; i < triangles.size(); ++i) {
      CGAL::Bbox_3 box;
      for (int vertex : triangles[i]) box += to_cgal(points[vertex]).bbox();
      if (CGAL::do_overlap(box, region)) boxes.emplace_back(box, static_cast<int>(i));
    }
    return boxes;
  };
  const auto bounds = [](const auto& points, const auto& triangles) {
    CGAL::Bbox_3 box;
    for (const auto& t : triangles)
      for (int vertex : t) box += to_cgal(points[vertex]).bbox();
    return box;
  };
  std::vector<Box> a = boxes_of(points_a, triangles_a, bounds(points_b, triangles_b));
  std::vector<Box> b = boxes_of(points_b, triangles_b, bounds(points_a, triangles_a));
  std::vector<std::pair<int, int>> pairs;
  CGAL::box_intersection_d(a.begin(), a.end(), b.begin(), b.end(), [&](const Box& x, const Box& y) {
    Corners s, t;
    for (int k = 0; k < 3; ++k) {
      s[k] = points_a[triangles_a[x.triangle][k]];
      t[k] = points_b[triangles_b[y.triangle][k]];
    }
    if (cross(s, t)) pairs.emplace_back(x.triangle, y.triangle);
  });
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

}  // namespace interglow::mesh
