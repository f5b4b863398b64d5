// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/flat_faces.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <map>
#include <numeric>
#include <set>
#include <utility>
#include <vector>

namespace interglow::mesh::detail {
namespace {

constexpr double kFlatness = 1e-8;
constexpr int kMostRounds = 20;  // a chain of flat faces shortens with each round; what is left then is dropped

using Triangle = std::array<int, 3>;

void remove_repeated_corners(FlatFaces& flat) {
  flat.repeated_corner += std::erase_if(flat.mesh.triangles,
                                        [](const Triangle& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; });
}

void remove_duplicates(FlatFaces& flat) {
  auto& triangles = flat.mesh.triangles;
  std::vector<Triangle> sorted = triangles;
  for (Triangle& t : sorted) std::sort(t.begin(), t.end());
  std::vector<int> order(triangles.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(),
            [&](int a, int b) { return sorted[a] != sorted[b] ? sorted[a] < sorted[b] : a < b; });
  std::vector<bool> doomed(triangles.size(), false);
  for (std::size_t i = 1; i < order.size(); ++i) doomed[order[i]] = sorted[order[i]] == sorted[order[i - 1]];
  std::size_t index = 0;
  flat.duplicates += std::erase_if(triangles, [&](const Triangle&) { return doomed[index++]; });
}

/// Edge k runs from corner k to the next one.
struct Shape {
  std::array<double, 3> squared_lengths;
  int longest, shortest;
  bool is_flat;
};

Shape shape_of(const TriangleMesh& mesh, const Triangle& t) {
  std::array<Eigen::Vector3d, 3> edges;
  Shape shape{};
  for (int k = 0; k < 3; ++k) {
    edges[k] = mesh.points[t[(k + 1) % 3]] - mesh.points[t[k]];
    shape.squared_lengths[k] = edges[k].squaredNorm();
  }
  const auto& lengths = shape.squared_lengths;
  shape.longest = static_cast<int>(std::max_element(lengths.begin(), lengths.end()) - lengths.begin());
  shape.shortest = static_cast<int>(std::min_element(lengths.begin(), lengths.end()) - lengths.begin());
  // Twice the area = longest edge times height on it; from the two shorter edges, whose product cancels least.
  const double twice_area = edges[(shape.longest + 1) % 3].cross(edges[(shape.longest + 2) % 3]).norm();
  shape.is_flat = !(twice_area > kFlatness * lengths[shape.longest]);
  return shape;
}

/// Merges the ends of edges that are as short as a flat face is low. True if there were any.
bool merge_needles(FlatFaces& flat, const std::vector<int>& flat_faces) {
  std::vector<int> target(flat.mesh.points.size());
  std::iota(target.begin(), target.end(), 0);
  const auto root = [&](int point) {
    while (target[point] != point) point = target[point] = target[target[point]];
    return point;
  };
  std::size_t merged = 0;
  for (const int face : flat_faces) {
    const Triangle& t = flat.mesh.triangles[face];
    const Shape shape = shape_of(flat.mesh, t);
    const double longest = shape.squared_lengths[shape.longest];
    if (shape.squared_lengths[shape.shortest] > kFlatness * kFlatness * longest) continue;
    const auto [low, high] = std::minmax({root(t[shape.shortest]), root(t[(shape.shortest + 1) % 3])});
    if (low == high) continue;
    target[high] = low;
    ++merged;
  }
  if (merged == 0) return false;
  flat.points_merged += merged;
  for (Triangle& t : flat.mesh.triangles) {
    for (int& corner : t) corner = root(corner);
  }
  // Faces that shrank to an edge are flat faces removed, not damage of their own.
  const std::size_t before = flat.mesh.triangles.size();
  std::erase_if(flat.mesh.triangles, [](const Triangle& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; });
  flat.removed += before - flat.mesh.triangles.size();
  return true;
}

std::pair<int, int> edge_of(int a, int b) { return std::minmax({a, b}); }

/// Flips the longest edge of each flat face, or drops the face where that cannot be.
void flip_caps(FlatFaces& flat, const std::vector<int>& flat_faces) {
  auto& triangles = flat.mesh.triangles;
  // Faces at the edges of the flat ones, and every edge that a flip might make again.
  std::map<std::pair<int, int>, std::vector<int>> faces_at;
  for (const int face : flat_faces) {
    for (int k = 0; k < 3; ++k) faces_at[edge_of(triangles[face][k], triangles[face][(k + 1) % 3])];
  }
  std::set<int> corners;
  for (const int face : flat_faces) corners.insert(triangles[face].begin(), triangles[face].end());
  std::set<std::pair<int, int>> edges;
  for (std::size_t face = 0; face < triangles.size(); ++face) {
    const Triangle& t = triangles[face];
    for (int k = 0; k < 3; ++k) {
      const auto edge = edge_of(t[k], t[(k + 1) % 3]);
      const auto found = faces_at.find(edge);
      if (found != faces_at.end()) found->second.push_back(static_cast<int>(face));
      if (corners.contains(edge.first) || corners.contains(edge.second)) edges.insert(edge);
    }
  }
  std::set<int> touched;
  std::set<int> doomed;
  for (const int face : flat_faces) {
    if (touched.contains(face)) continue;  // its turn comes in the next round
    const Triangle t = triangles[face];
    const int longest = shape_of(flat.mesh, t).longest;
    const int a = t[longest];
    const int b = t[(longest + 1) % 3];
    const int cap = t[(longest + 2) % 3];
    const std::vector<int>& sharing = faces_at[edge_of(a, b)];
    if (sharing.size() == 2) {
      const int other = sharing[0] == face ? sharing[1] : sharing[0];
      if (touched.contains(other)) continue;
      const Triangle o = triangles[other];
      const int k =
          static_cast<int>(std::find_if(o.begin(), o.end(), [&](int i) { return i != a && i != b; }) - o.begin());
      const int far = o[k];
      if (!edges.contains(edge_of(cap, far))) {
        // The neighbour's triangle is cut in two by the cap's corner; both keep the neighbour's orientation.
        triangles[face] = {far, o[(k + 1) % 3], cap};
        triangles[other] = {far, cap, o[(k + 2) % 3]};
        edges.insert(edge_of(cap, far));
        touched.insert({face, other});
        ++flat.flipped;
        continue;
      }
    }
    touched.insert(face);
    doomed.insert(face);
  }
  int index = 0;
  flat.removed += std::erase_if(triangles, [&](const Triangle&) { return doomed.contains(index++); });
}

}  // namespace

FlatFaces remove_flat_faces(TriangleMesh mesh) {
  FlatFaces flat;
  flat.mesh = std::move(mesh);
  remove_repeated_corners(flat);
  remove_duplicates(flat);
  for (int round = 0;; ++round) {
    std::vector<int> flat_faces;
    for (std::size_t face = 0; face < flat.mesh.triangles.size(); ++face) {
      if (shape_of(flat.mesh, flat.mesh.triangles[face]).is_flat) flat_faces.push_back(static_cast<int>(face));
    }
    if (flat_faces.empty()) return flat;
    if (round == kMostRounds) {
      const auto is_flat = [&](const Triangle& t) { return shape_of(flat.mesh, t).is_flat; };
      flat.removed += std::erase_if(flat.mesh.triangles, is_flat);
      return flat;
    }
    if (!merge_needles(flat, flat_faces)) flip_caps(flat, flat_faces);
    remove_duplicates(flat);
  }
}

}  // namespace interglow::mesh::detail
