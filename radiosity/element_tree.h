// SPDX-License-Identifier: GPL-3.0-or-later
/// A tree of clusters of elements that lie close together and face alike, and tests on whole clusters.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "radiosity/elements.h"
#include "radiosity/polygon.h"

namespace interglow::radiosity {

struct Box {
  Eigen::Vector3d low;
  Eigen::Vector3d high;

  void cover(const Eigen::Vector3d& p) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  static Box empty();
  Eigen::Vector3d corner(int k) const {
    return {(k & 1 ? high : low).x(), (k & 2 ? high : low).y(), (k & 4 ? high : low).z()};
  }
};

/// Elements order[first .. first + count) of the tree.
struct Cluster {
  int first = 0;
  int count = 0;
  int left = -1;  ///< children; -1: a leaf of one element
  int right = -1;
  Box box = Box::empty();               ///< holds all corners
  Eigen::Vector3d axis{0.0, 0.0, 1.0};  ///< all normals lie within a cone around it
  double sin_spread = 0.0;              ///< sine of the cone's half-angle; 1: half a sphere or more, no bound
  double lowest = 0.0;                  ///< least of axis · x over the corners
};

/// The face of an element, seen from its front.
Polygon polygon_of(const Elements& elements, int element);

/// Binary tree down to single elements, split at the median of the widest of position and normal.
/// Cost O(N log N). Depends on the elements alone, so that results do not depend on threads.
class ElementTree {
 public:
  explicit ElementTree(const Elements& elements);

  const Cluster& cluster(int node) const { return clusters_[static_cast<std::size_t>(node)]; }
  int size() const { return static_cast<int>(clusters_.size()); }
  int root() const { return clusters_.empty() ? -1 : 0; }
  const std::vector<int>& order() const { return order_; }
  const Polygon& polygon(int element) const {
    return polygons_[static_cast<std::size_t>(element)];
  }  ///< seen from its front
  /// Heights above a plane up to this count as 0: a few roundings of the largest coordinate [mm].
  double flat() const { return flat_; }

 private:
  int build(const Elements& elements, int first, int count);

  std::vector<Cluster> clusters_;
  std::vector<int> order_;
  std::vector<Polygon> polygons_;
  double flat_ = 0.0;
};

/// False only if no normal of the cluster has any point of `box` in front of any point of the cluster.
bool may_face(const Cluster& cluster, const Box& box);

/// Whether some corner of `other` lies in front of the plane through `origin`, beyond rounding.
bool in_front(const Eigen::Vector3d& normal, const Eigen::Vector3d& origin, const Polygon& other);

/// True only if a plane strictly separates the two sets of points.
bool separated(const Eigen::Vector3d* a, int a_count, const Eigen::Vector3d* b, int b_count, double flat);

}  // namespace interglow::radiosity
