// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/element_tree.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace interglow::radiosity {

using Eigen::Vector3d;

namespace {

/// Share of the terms of a scalar product that rounding of the normal and the differences may leave.
constexpr double kRounding = 8e-16;

}  // namespace

Box Box::empty() {
  const Vector3d infinite = Vector3d::Constant(std::numeric_limits<double>::infinity());
  return {infinite, -infinite};
}

Polygon polygon_of(const Elements& elements, int element) {
  const auto i = static_cast<std::size_t>(element);
  const mesh::Face& face = elements.faces.corners[static_cast<std::size_t>(elements.face[i])];
  Polygon polygon;
  polygon.corners = mesh::corner_count(face);
  for (int k = 0; k < polygon.corners; ++k) {
    const int from = elements.back[i] != 0 ? polygon.corners - 1 - k : k;
    polygon.corner[static_cast<std::size_t>(k)] =
        elements.faces.points[static_cast<std::size_t>(face[static_cast<std::size_t>(from)])];
  }
  return polygon;
}

ElementTree::ElementTree(const Elements& elements) {
  const int n = static_cast<int>(elements.size());
  order_.resize(static_cast<std::size_t>(n));
  std::iota(order_.begin(), order_.end(), 0);
  polygons_.resize(static_cast<std::size_t>(n));
  double reach = 0.0;
  for (int e = 0; e < n; ++e) {
    const Polygon& polygon = polygons_[static_cast<std::size_t>(e)] = polygon_of(elements, e);
    for (int k = 0; k < polygon.corners; ++k)
      reach = std::max(reach, polygon.corner[static_cast<std::size_t>(k)].cwiseAbs().maxCoeff());
  }
  flat_ = 1e-14 * reach;
  clusters_.reserve(2 * static_cast<std::size_t>(n));
  if (n > 0) build(elements, 0, n);
}

int ElementTree::build(const Elements& elements, int first, int count) {
  const auto begin = order_.begin() + first;
  const auto end = begin + count;
  Cluster cluster;
  cluster.first = first;
  cluster.count = count;
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  Vector6 low = Vector6::Constant(std::numeric_limits<double>::infinity());
  Vector6 high = -low;
  Vector3d normal_sum = Vector3d::Zero();
  for (auto it = begin; it != end; ++it) {
    const Polygon& polygon = polygons_[static_cast<std::size_t>(*it)];
    for (int k = 0; k < polygon.corners; ++k) cluster.box.cover(polygon.corner[static_cast<std::size_t>(k)]);
    Vector6 key;
    key << elements.centroid.row(*it).transpose(), elements.normal.row(*it).transpose();
    low = low.cwiseMin(key);
    high = high.cwiseMax(key);
    normal_sum += elements.normal.row(*it).transpose();
  }
  if (count == 1) {
    cluster.axis = elements.normal.row(*begin).transpose();
  } else if (normal_sum.norm() > 1e-3 * count) {
    cluster.axis = normal_sum.normalized();
    double least = 1.0;
    double farthest = 0.0;
    for (auto it = begin; it != end; ++it) {
      const Vector3d normal = elements.normal.row(*it).transpose();
      least = std::min(least, cluster.axis.dot(normal));
      farthest = std::max(farthest, cluster.axis.cross(normal).norm());
    }
    // Normals of one plane differ by rounding alone.
    if (farthest < 1e-14) farthest = 0.0;
    cluster.sin_spread = least > 0.0 ? std::min(1.0, farthest) : 1.0;
  } else {
    cluster.sin_spread = 1.0;
  }
  cluster.lowest = std::numeric_limits<double>::infinity();
  for (auto it = begin; it != end; ++it) {
    const Polygon& polygon = polygons_[static_cast<std::size_t>(*it)];
    for (int k = 0; k < polygon.corners; ++k)
      cluster.lowest = std::min(cluster.lowest, cluster.axis.dot(polygon.corner[static_cast<std::size_t>(k)]));
  }
  const int node = static_cast<int>(clusters_.size());
  clusters_.push_back(cluster);
  if (count == 1) return node;
  Vector6 spread = high - low;
  // A normal turned by one radian weighs as much as half of the cluster's diagonal.
  const double weight = 0.5 * spread.head<3>().norm();
  spread.tail<3>() *= weight;
  Eigen::Index axis = 0;
  spread.maxCoeff(&axis);
  const auto key = [&](int e) { return axis < 3 ? elements.centroid(e, axis) : elements.normal(e, axis - 3); };
  // A break in direction (a wall's end) is a better place than the median: split normals in the middle of their range.
  int left_count = count / 2;
  const auto before = [&](int a, int b) { return key(a) != key(b) ? key(a) < key(b) : a < b; };
  if (axis >= 3) {
    const double middle = 0.5 * (low[axis] + high[axis]);
    std::sort(begin, end, before);
    left_count = static_cast<int>(std::partition_point(begin, end, [&](int e) { return key(e) < middle; }) - begin);
    left_count = std::clamp(left_count, 1, count - 1);
  } else {
    std::nth_element(begin, begin + left_count, end, before);
  }
  const int left = build(elements, first, left_count);
  const int right = build(elements, first + left_count, count - left_count);
  clusters_[static_cast<std::size_t>(node)].left = left;
  clusters_[static_cast<std::size_t>(node)].right = right;
  return node;
}

bool may_face(const Cluster& cluster, const Box& box) {
  if (cluster.sin_spread >= 1.0) return true;
  // max over normals of n · d is a convex function of d: it is greatest in a corner of the box of differences.
  const Vector3d least = box.low - cluster.box.high;
  const Vector3d most = box.high - cluster.box.low;
  if (cluster.sin_spread == 0.0) {
    double highest = 0.0;
    for (int k = 0; k < 3; ++k) highest += std::max(cluster.axis[k] * least[k], cluster.axis[k] * most[k]);
    // In doubt it may: the mean normal of a cluster is rounded.
    return highest > -kRounding * least.cwiseAbs().cwiseMax(most.cwiseAbs()).sum();
  }
  const Box differences{least, most};
  for (int k = 0; k < 8; ++k) {
    const Vector3d d = differences.corner(k);
    if (cluster.axis.dot(d) > -(cluster.sin_spread + kRounding) * d.norm()) return true;
  }
  return false;
}

bool in_front(const Vector3d& normal, const Vector3d& origin, const Polygon& other) {
  for (int k = 0; k < other.corners; ++k) {
    const Vector3d d = other.corner[static_cast<std::size_t>(k)] - origin;
    if (normal.dot(d) > kRounding * normal.cwiseAbs().dot(d.cwiseAbs())) return true;
  }
  return false;
}

bool separated(const Vector3d* a, int a_count, const Vector3d* b, int b_count, double flat) {
  // Gilbert's iteration for the point of b - a nearest to the origin; any direction on the way may be a certificate.
  const auto support = [&](const Vector3d& d, double& gap) {
    int lowest_b = 0;
    int highest_a = 0;
    double low = std::numeric_limits<double>::infinity();
    double high = -low;
    for (int k = 0; k < b_count; ++k) {
      const double height = d.dot(b[k]);
      if (height < low) {
        low = height;
        lowest_b = k;
      }
    }
    for (int k = 0; k < a_count; ++k) {
      const double height = d.dot(a[k]);
      if (height > high) {
        high = height;
        highest_a = k;
      }
    }
    gap = low - high;
    return Vector3d(b[lowest_b] - a[highest_a]);
  };
  Vector3d nearest = b[0] - a[0];
  for (int iteration = 0; iteration < 12; ++iteration) {
    double gap = 0.0;
    const Vector3d corner = support(nearest, gap);
    const double length = nearest.norm();
    if (!(length > 0.0)) return false;
    if (gap > flat * length) return true;
    const Vector3d along = corner - nearest;
    const double t = -nearest.dot(along) / along.squaredNorm();
    if (!(t > 0.0)) return false;
    nearest += std::min(t, 1.0) * along;
  }
  return false;
}

}  // namespace interglow::radiosity
