// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/shadow_edges.h"

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <utility>

namespace interglow::radiosity {

bool ShadowEdge::turns_away(std::span<const Eigen::Vector3d> points, double flat) const {
  if (!sides) return true;
  bool in_front = true;
  bool behind = true;
  for (const Side& side : *sides) {
    for (const Eigen::Vector3d& p : points) {
      const double height = side.height(p);
      in_front = in_front && height >= -flat;
      behind = behind && height <= flat;
      if (!in_front && !behind) return true;
    }
  }
  return false;
}

ShadowEdges::ShadowEdges(std::vector<ShadowEdge> edges) : edges_(std::move(edges)) {
  if (edges_.empty()) return;
  std::vector<int> members(edges_.size());
  std::iota(members.begin(), members.end(), 0);
  nodes_.reserve(2 * edges_.size());
  add_nodes(members);
}

/// Adds the subtree of `members`, split at the median of the longest side, and returns its root.
int ShadowEdges::add_nodes(std::span<int> members) {
  const std::size_t number = nodes_.size();
  nodes_.emplace_back();
  Box box = Box::empty();
  for (const int e : members) {
    box.cover(edge(e).a);
    box.cover(edge(e).b);
  }
  nodes_[number].box = box;
  if (members.size() == 1) {
    nodes_[number].edge = members[0];
    return static_cast<int>(number);
  }
  Eigen::Index axis = 0;
  (box.high - box.low).maxCoeff(&axis);
  const auto key = [&](int e) { return edge(e).a[axis] + edge(e).b[axis]; };
  const std::size_t half = members.size() / 2;
  std::nth_element(members.begin(), members.begin() + static_cast<std::ptrdiff_t>(half), members.end(),
                   [&](int a, int b) { return key(a) != key(b) ? key(a) < key(b) : a < b; });
  const int left = add_nodes(members.first(half));
  const int right = add_nodes(members.subspan(half));
  nodes_[number].left = left;
  nodes_[number].right = right;
  return static_cast<int>(number);
}

}  // namespace interglow::radiosity
