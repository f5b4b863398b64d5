// SPDX-License-Identifier: GPL-3.0-or-later
/// Which blockers may stand between two clusters of elements.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "radiosity/assembly_problem.h"

namespace interglow::radiosity {

/// Numbers of blockers.
using Candidates = std::vector<int>;

class BlockerSearch {
 public:
  /// Keeps a reference.
  explicit BlockerSearch(const AssemblyProblem& problem) : problem_(problem) {}

  /// Appends to `left` the candidates that may cut a line between a member of `a` and one of `b`; false if one of them
  /// cuts all lines. Cost O(candidates).
  bool thin_out(int a, int b, const Candidates& candidates, Candidates& left) const;

  /// Of all bodies, those that may cut lines between two tiles; stops once there are more than `most`. False if one
  /// cuts all lines. @pre the problem has many blockers
  bool search(int a, int b, std::size_t most, Candidates& found);

 private:
  /// All lines between two clusters run within the convex hull of these corners.
  struct Shaft {
    std::array<Eigen::Vector3d, 16> corner;
    int a_corners = 0;
    int corners = 0;
    Box hull = Box::empty();
  };

  struct Between {
    int a;
    int b;
    Shaft shaft;
    std::uint64_t hidden;  ///< objects that stay below all planes of one side
  };

  double flat() const { return problem_.tree.flat(); }
  static bool is_hidden(const Between& pair, int object) { return object < 64 && ((pair.hidden >> object) & 1U) != 0; }
  static bool covers(const ConvexBody& body, const Shaft& shaft, double flat);
  void add_to_shaft(int node, Shaft& shaft) const;
  /// Whether some vertex of the body rises above some member's plane.
  bool may_rise_above(int node, const ConvexBody& body) const;
  Between between(int a, int b) const;
  bool overlaps(const Box& box, const Shaft& shaft) const;
  /// Whether a body may cut a line between a member of one cluster and one of the other.
  bool may_cut(const ConvexBody& body, const Between& pair) const;
  bool hides_all(const ConvexBody& body, const Between& pair) const;

  const AssemblyProblem& problem_;
  std::vector<int> pending_;
};

}  // namespace interglow::radiosity
