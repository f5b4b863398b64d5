// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/manifold.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cstdint>
#include <deque>
#include <numeric>
#include <span>
#include <utility>

namespace interglow::mesh::detail {
namespace {

/// Beyond this many faces at one edge none is joined: choosing pairs costs the square.
constexpr std::size_t kMostFacesToPair = 64;

int next_corner(int k) { return k == 2 ? 0 : k + 1; }

/// One face's side of an edge.
struct Side {
  std::uint64_t edge;  ///< its two points, smaller one first
  int half;            ///< 3 * face + edge of the face
  bool operator<(const Side& other) const { return edge != other.edge ? edge < other.edge : half < other.half; }
};

std::uint64_t edge_key(int a, int b) {
  const auto [low, high] = std::minmax({a, b});
  return static_cast<std::uint64_t>(low) << 32U | static_cast<std::uint64_t>(high);
}

std::vector<Side> sorted_sides(const std::vector<std::array<int, 3>>& triangles) {
  std::vector<Side> sides;
  sides.reserve(3 * triangles.size());
  for (std::size_t face = 0; face < triangles.size(); ++face) {
    for (int k = 0; k < 3; ++k) {
      sides.push_back({edge_key(triangles[face][k], triangles[face][next_corner(k)]), static_cast<int>(3 * face) + k});
    }
  }
  std::sort(sides.begin(), sides.end());
  return sides;
}

/// Calls `visit(sides of one edge)` for each edge.
template <class Visit>
void for_each_edge(const std::vector<Side>& sides, Visit visit) {
  for (std::size_t begin = 0, end = 0; begin < sides.size(); begin = end) {
    while (end < sides.size() && sides[end].edge == sides[begin].edge) ++end;
    visit(std::span<const Side>(sides.data() + begin, end - begin));
  }
}

class ManifoldMaker {
 public:
  explicit ManifoldMaker(const TriangleMesh& mesh)
      : points_(mesh.points), triangles_(mesh.triangles), across_(mesh.triangles.size(), {-1, -1, -1}) {}

  Manifold run() {
    join_faces();
    orient();
    do {
      split_points();
    } while (detach_faces_at_bad_edges());
    return std::move(made_);
  }

 private:
  int start(int half) const { return triangles_[half / 3][half % 3]; }
  int opposite_point(int half) const { return triangles_[half / 3][(half % 3 + 2) % 3]; }
  int& across(int half) { return across_[half / 3][half % 3]; }

  void join(int half, int other) {
    across(half) = other;
    across(other) = half;
  }
  void separate(int half) {
    const int other = across(half);
    if (other < 0) return;
    across(half) = -1;
    across(other) = -1;
  }

  void join_faces() {
    for_each_edge(sorted_sides(triangles_), [&](std::span<const Side> sides) {
      if (sides.size() == 2) {
        join(sides[0].half, sides[1].half);
      } else if (sides.size() > 2) {
        ++made_.edges_split;
        if (sides.size() <= kMostFacesToPair) join_flattest(sides);
      }
    });
  }

  void join_flattest(std::span<const Side> sides) {
    const Eigen::Vector3d& origin = points_[start(sides[0].half)];
    const int other_end = triangles_[sides[0].half / 3][next_corner(sides[0].half % 3)];
    const Eigen::Vector3d along = (points_[other_end] - origin).normalized();
    std::vector<Eigen::Vector3d> outward;  // in each face's plane, away from the edge
    for (const Side& side : sides) {
      const Eigen::Vector3d offset = points_[opposite_point(side.half)] - origin;
      outward.emplace_back((offset - along * along.dot(offset)).normalized());
    }
    struct Pair {
      double rank;
      std::size_t first, second;
    };
    std::vector<Pair> pairs;
    for (std::size_t i = 0; i < sides.size(); ++i) {
      for (std::size_t j = i + 1; j < sides.size(); ++j) {
        const bool agree = start(sides[i].half) != start(sides[j].half);
        // A product of directions is within [-1, 1]: agreement outranks it.
        pairs.push_back({(agree ? 4.0 : 0.0) - outward[i].dot(outward[j]), i, j});
      }
    }
    std::stable_sort(pairs.begin(), pairs.end(), [](const Pair& a, const Pair& b) { return a.rank > b.rank; });
    for (const Pair& pair : pairs) {
      const int first = sides[pair.first].half;
      const int second = sides[pair.second].half;
      if (across(first) < 0 && across(second) < 0) join(first, second);
    }
  }

  double twice_area(int face) const {
    const auto& [a, b, c] = triangles_[face];
    return (points_[b] - points_[a]).cross(points_[c] - points_[a]).norm();
  }

  void orient() {
    const int faces = static_cast<int>(triangles_.size());
    enum : signed char { kUnknown = -1, kAsGiven = 0, kTurned = 1 };
    std::vector<signed char> turned(triangles_.size(), kUnknown);
    std::vector<int> component;
    for (int seed = 0; seed < faces; ++seed) {
      if (turned[seed] != kUnknown) continue;
      component.clear();
      double area_turned = 0.0;
      double area_as_given = 0.0;
      // Joints that agree as given are followed first, so that a conflict falls on one that does not.
      std::deque<std::pair<int, signed char>> to_visit{{seed, kAsGiven}};
      while (!to_visit.empty()) {
        const auto [face, turn] = to_visit.front();
        to_visit.pop_front();
        if (turned[face] != kUnknown) continue;
        turned[face] = turn;
        component.push_back(face);
        (turn == kTurned ? area_turned : area_as_given) += twice_area(face);
        for (int k = 0; k < 3; ++k) {
          const int other = across_[face][k];
          if (other < 0 || turned[other / 3] != kUnknown) continue;
          if (start(other) != triangles_[face][k]) {
            to_visit.emplace_front(other / 3, turn);
          } else {
            to_visit.emplace_back(other / 3, turn == kTurned ? kAsGiven : kTurned);
          }
        }
      }
      if (area_turned > area_as_given) {
        for (const int face : component) turned[face] = turned[face] == kTurned ? kAsGiven : kTurned;
      }
    }
    for (int half = 0; half < 3 * faces; ++half) {
      const int other = across(half);
      if (other < half) continue;
      const bool agree = start(half) != start(other);
      if (agree == (turned[half / 3] == turned[other / 3])) continue;
      ++made_.unorientable_edges;
      separate(half);
    }
    // Reversing a face's corners b and c exchanges its first and last edge.
    const auto new_half = [&](int half) {
      return half < 0 || turned[half / 3] == kAsGiven ? half : 3 * (half / 3) + 2 - half % 3;
    };
    for (int face = 0; face < faces; ++face) {
      for (int& other : across_[face]) other = new_half(other);
      if (turned[face] == kAsGiven) continue;
      ++made_.faces_turned;
      std::swap(triangles_[face][1], triangles_[face][2]);
      std::swap(across_[face][0], across_[face][2]);
    }
  }

  int root(int corner) {
    while (parent_[corner] != corner) corner = parent_[corner] = parent_[parent_[corner]];
    return corner;
  }
  void unite(int a, int b) {
    const auto [low, high] = std::minmax({root(a), root(b)});
    parent_[high] = low;
  }

  /// Each fan of joined faces gets its own copy of the point it surrounds.
  void split_points() {
    const int corners = static_cast<int>(3 * triangles_.size());
    parent_.resize(corners);
    std::iota(parent_.begin(), parent_.end(), 0);
    for (int half = 0; half < corners; ++half) {
      const int other = across(half);
      if (other < half) continue;
      unite(half, 3 * (other / 3) + next_corner(other % 3));
      unite(3 * (half / 3) + next_corner(half % 3), other);
    }
    // Fans in the order of their points, then of their first corners: a sound mesh keeps its numbering.
    std::vector<int> fans;
    for (int corner = 0; corner < corners; ++corner) {
      if (parent_[corner] == corner) fans.push_back(corner);
    }
    std::stable_sort(fans.begin(), fans.end(), [&](int a, int b) { return start(a) < start(b); });
    std::vector<int> point_of(corners, -1);
    made_.mesh.points.clear();
    std::size_t used_points = 0;
    for (std::size_t i = 0; i < fans.size(); ++i) {
      if (i == 0 || start(fans[i]) != start(fans[i - 1])) ++used_points;
      point_of[fans[i]] = static_cast<int>(i);
      made_.mesh.points.push_back(points_[start(fans[i])]);
    }
    made_.points_split = fans.size() - used_points;
    made_.unused_points = points_.size() - used_points;
    made_.mesh.triangles.resize(triangles_.size());
    for (int corner = 0; corner < corners; ++corner) {
      made_.mesh.triangles[corner / 3][corner % 3] = point_of[root(corner)];
    }
  }

  /// Two cut edges may have kept both end points in common, by ways around them. True if faces had to be detached.
  bool detach_faces_at_bad_edges() {
    std::vector<int> bad;
    for_each_edge(sorted_sides(made_.mesh.triangles), [&](std::span<const Side> sides) {
      const auto start_now = [&](const Side& side) { return made_.mesh.triangles[side.half / 3][side.half % 3]; };
      if (sides.size() == 1 || (sides.size() == 2 && start_now(sides[0]) != start_now(sides[1]))) return;
      // One pair that is joined may stay, or else one face.
      const auto joined =
          std::find_if(sides.begin(), sides.end(), [&](const Side& side) { return across(side.half) >= 0; });
      const Side& kept = joined != sides.end() ? *joined : sides.front();
      for (const Side& side : sides) {
        const int other = across(side.half);
        if (side.half != kept.half && other != kept.half && other < side.half) bad.push_back(side.half / 3);
      }
    });
    std::sort(bad.begin(), bad.end());
    bad.erase(std::unique(bad.begin(), bad.end()), bad.end());
    for (const int face : bad) {
      for (int k = 0; k < 3; ++k) separate(3 * face + k);
    }
    made_.faces_detached += bad.size();
    return !bad.empty();
  }

  const std::vector<Eigen::Vector3d>& points_;
  std::vector<std::array<int, 3>> triangles_;
  Neighbours across_;
  std::vector<int> parent_;
  Manifold made_;
};

}  // namespace

Manifold make_manifold(const TriangleMesh& mesh) { return ManifoldMaker(mesh).run(); }

Neighbours neighbours_across_edges(const TriangleMesh& manifold) {
  Neighbours across(manifold.triangles.size(), {-1, -1, -1});
  for_each_edge(sorted_sides(manifold.triangles), [&](std::span<const Side> sides) {
    if (sides.size() != 2) return;
    across[sides[0].half / 3][sides[0].half % 3] = sides[1].half;
    across[sides[1].half / 3][sides[1].half % 3] = sides[0].half;
  });
  return across;
}

}  // namespace interglow::mesh::detail
