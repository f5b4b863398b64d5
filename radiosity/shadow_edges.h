// SPDX-License-Identifier: GPL-3.0-or-later
/// The edges of obstacles that may bound a shadow.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <span>
#include <vector>

#include "radiosity/element_tree.h"

namespace interglow::radiosity {

/// As a line between two patches moves, it becomes blocked or clear only where it passes an edge behind which the
/// surface ends or turns away from it, or where one of its ends passes through a surface.
struct ShadowEdge {
  /// A plane through the edge, in which the surface goes on.
  struct Side {
    Eigen::Vector3d normal;
    double offset = 0.0;
    double height(const Eigen::Vector3d& p) const { return normal.dot(p) - offset; }
  };
  Eigen::Vector3d a, b;
  std::optional<std::array<Side, 2>> sides;  ///< none: the surface ends here, or more than two meet

  /// Whether some line that starts at one of the points or between them may see the surface end or turn away here: not
  /// if they are all in front of both sides, or all behind both. Points within `flat` of a plane are on both sides of
  /// it.
  bool turns_away(std::span<const Eigen::Vector3d> points, double flat) const;
};

/// Bounding boxes over shadow edges.
class ShadowEdges {
 public:
  ShadowEdges() = default;
  /// Cost O(edges log edges).
  explicit ShadowEdges(std::vector<ShadowEdge> edges);

  const ShadowEdge& edge(int number) const { return edges_[static_cast<std::size_t>(number)]; }
  bool empty() const { return edges_.empty(); }

  /// Calls visit(number) for the edges in boxes for which enter(box) holds, in a fixed order.
  template <class Enter, class Visit>
  void search(const Enter& enter, const Visit& visit, std::vector<int>& pending) const {
    if (nodes_.empty()) return;
    pending.assign(1, 0);
    while (!pending.empty()) {
      const Node& node = nodes_[static_cast<std::size_t>(pending.back())];
      pending.pop_back();
      if (!enter(node.box)) continue;
      if (node.edge >= 0) {
        visit(node.edge);
        continue;
      }
      pending.push_back(node.right);
      pending.push_back(node.left);
    }
  }

 private:
  struct Node {
    Box box = Box::empty();
    int left = -1;
    int right = -1;
    int edge = -1;  ///< of a leaf
  };
  int add_nodes(std::span<int> members);

  std::vector<ShadowEdge> edges_;
  std::vector<Node> nodes_;
};

}  // namespace interglow::radiosity
