// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/blockers.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <span>
#include <unordered_map>
#include <utility>

#include "mesh/weld_points.h"

namespace interglow::radiosity {
namespace {

using Eigen::Vector3d;
using Loop = std::vector<int>;  ///< point numbers

/// Faces lie in one plane if their corners are this close to it, as a share of the first face's size: far above the
/// rounding of coordinates, far below what single-precision geometry resolves.
constexpr double kCoplanar = 1e-9;
/// Larger closed convex objects are kept as polygons: silhouettes are searched edge by edge.
constexpr std::size_t kMostBodyVertices = 500;

struct Plane {
  Vector3d normal;
  double offset = 0.0;
  double height(const Vector3d& p) const { return normal.dot(p) - offset; }
};

/// One object's faces on welded points.
struct Surface {
  std::vector<Vector3d> point;
  std::vector<Loop> face;
  std::vector<Plane> plane;
  std::vector<double> size;  ///< longest edge of each face
  /// Face on the left of each directed edge; -2 where several claim it.
  std::map<std::pair<int, int>, int> left_of;
};

/// Points within `flat` of one another become one: turned faces that were made one by one differ by rounding where they
/// meet.
Surface weld(const Faces& faces, std::size_t first, std::size_t last, double flat) {
  std::vector<Vector3d> points;  // of this object, as its faces name them
  std::unordered_map<int, int> number;
  for (std::size_t f = first; f < last; ++f) {
    for (int k = 0; k < mesh::corner_count(faces.corners[f]); ++k) {
      const int p = faces.corners[f][static_cast<std::size_t>(k)];
      if (number.try_emplace(p, static_cast<int>(points.size())).second)
        points.push_back(faces.points[static_cast<std::size_t>(p)]);
    }
  }
  mesh::WeldedPoints welded = mesh::weld_near_points(points, flat);
  Surface surface;
  surface.point = std::move(welded.points);
  for (std::size_t f = first; f < last; ++f) {
    Loop loop;
    for (int k = 0; k < mesh::corner_count(faces.corners[f]); ++k) {
      const int p = number.at(faces.corners[f][static_cast<std::size_t>(k)]);
      loop.push_back(welded.index_of[static_cast<std::size_t>(p)]);
    }
    Vector3d area = Vector3d::Zero();
    double size = 0.0;
    for (std::size_t k = 0; k < loop.size(); ++k) {
      const Vector3d& a = surface.point[static_cast<std::size_t>(loop[k])];
      const Vector3d& b = surface.point[static_cast<std::size_t>(loop[(k + 1) % loop.size()])];
      const Vector3d& origin = surface.point[static_cast<std::size_t>(loop[0])];
      area += (a - origin).cross(b - origin);
      size = std::max(size, (b - a).norm());
      const auto [it, added] =
          surface.left_of.try_emplace({loop[k], loop[(k + 1) % loop.size()]}, static_cast<int>(surface.face.size()));
      if (!added) it->second = -2;
    }
    Plane plane{area.stableNormalized(), 0.0};
    plane.offset = plane.normal.dot(surface.point[static_cast<std::size_t>(loop[0])]);
    surface.plane.push_back(plane);
    surface.size.push_back(size);
    surface.face.push_back(std::move(loop));
  }
  return surface;
}

int neighbour(const Surface& surface, int a, int b) {
  const auto it = surface.left_of.find({b, a});
  return it == surface.left_of.end() ? -1 : it->second;
}

/// The outline of a set of coplanar faces if it is one convex loop; corners along straight edges are dropped.
std::optional<Loop> convex_outline(const Surface& surface, const std::vector<int>& members,
                                   const std::vector<int>& group_of, int group) {
  std::unordered_map<int, int> next;
  for (const int f : members) {
    const Loop& loop = surface.face[static_cast<std::size_t>(f)];
    for (std::size_t k = 0; k < loop.size(); ++k) {
      const int a = loop[k];
      const int b = loop[(k + 1) % loop.size()];
      const int other = neighbour(surface, a, b);
      if (other >= 0 && group_of[static_cast<std::size_t>(other)] == group) continue;
      if (!next.emplace(a, b).second) return std::nullopt;
    }
  }
  Loop around;
  const int start = next.begin()->first;
  for (int at = start; around.size() <= next.size();) {
    around.push_back(at);
    const auto it = next.find(at);
    if (it == next.end()) return std::nullopt;
    at = it->second;
    if (at == start) break;
  }
  if (around.size() != next.size()) return std::nullopt;
  const Vector3d& normal = surface.plane[static_cast<std::size_t>(members[0])].normal;
  Loop corners;
  const std::size_t n = around.size();
  double turned = 0.0;
  for (std::size_t k = 0; k < n; ++k) {
    const Vector3d& before = surface.point[static_cast<std::size_t>(around[(k + n - 1) % n])];
    const Vector3d& here = surface.point[static_cast<std::size_t>(around[k])];
    const Vector3d& after = surface.point[static_cast<std::size_t>(around[(k + 1) % n])];
    const Vector3d in = here - before;
    const Vector3d out = after - here;
    const double sine = normal.dot(in.cross(out)) / (in.norm() * out.norm());
    const double cosine = in.dot(out) / (in.norm() * out.norm());
    if (sine < -kCoplanar || cosine < -0.999999) return std::nullopt;
    turned += std::atan2(sine, cosine);
    if (sine > kCoplanar) corners.push_back(around[k]);
  }
  // One turn: a convex loop; more would wind around itself.
  if (turned > 6.3 || corners.size() < 3) return std::nullopt;
  // Start at the smallest point number, so that the result does not depend on the order of the hash table.
  std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
  return corners;
}

struct Merged {
  std::vector<Loop> outline;
  std::vector<int> group_of;  ///< outline of each face
  std::vector<Plane> plane;
};

/// Groups coplanar neighbours; groups whose outline is not convex are put together from pairs for as long as that stays
/// convex.
Merged merge_coplanar(const Surface& surface) {
  const std::size_t n = surface.face.size();
  std::vector<int> group_of(n, -1);
  std::vector<std::vector<int>> groups;
  for (std::size_t seed = 0; seed < n; ++seed) {
    if (group_of[seed] >= 0) continue;
    const int group = static_cast<int>(groups.size());
    std::vector<int> members = {static_cast<int>(seed)};
    group_of[seed] = group;
    for (std::size_t m = 0; m < members.size(); ++m) {
      const Loop& loop = surface.face[static_cast<std::size_t>(members[m])];
      for (std::size_t k = 0; k < loop.size(); ++k) {
        const int other = neighbour(surface, loop[k], loop[(k + 1) % loop.size()]);
        if (other < 0 || group_of[static_cast<std::size_t>(other)] >= 0) continue;
        const auto o = static_cast<std::size_t>(other);
        bool coplanar = surface.plane[o].normal.dot(surface.plane[seed].normal) > 0.0;
        for (const int p : surface.face[o]) {
          coplanar = coplanar && std::abs(surface.plane[seed].height(surface.point[static_cast<std::size_t>(p)])) <=
                                     kCoplanar * surface.size[seed];
        }
        if (!coplanar) continue;
        group_of[o] = group;
        members.push_back(other);
      }
    }
    groups.push_back(std::move(members));
  }
  std::vector<std::optional<Loop>> outlines(groups.size());
  std::vector<std::size_t> not_convex;
  for (std::size_t g = 0; g < groups.size(); ++g) {
    outlines[g] = convex_outline(surface, groups[g], group_of, static_cast<int>(g));
    if (!outlines[g]) not_convex.push_back(g);
  }
  for (const std::size_t g : not_convex) {
    std::vector<int> pieces;
    const std::vector<int> members = groups[g];
    for (const int f : members) {
      pieces.push_back(static_cast<int>(groups.size()));
      group_of[static_cast<std::size_t>(f)] = static_cast<int>(groups.size());
      groups.push_back({f});
      outlines.push_back(surface.face[static_cast<std::size_t>(f)]);
    }
    groups[g].clear();
    for (bool merged = true; merged;) {
      merged = false;
      for (const int piece : pieces) {
        auto& mine = groups[static_cast<std::size_t>(piece)];
        for (std::size_t m = 0; m < mine.size(); ++m) {
          const Loop& loop = surface.face[static_cast<std::size_t>(mine[m])];
          for (std::size_t k = 0; k < loop.size(); ++k) {
            const int face = neighbour(surface, loop[k], loop[(k + 1) % loop.size()]);
            if (face < 0) continue;
            const int other = group_of[static_cast<std::size_t>(face)];
            if (other == piece || !std::binary_search(pieces.begin(), pieces.end(), other)) continue;
            std::vector<int> both = mine;
            auto& theirs = groups[static_cast<std::size_t>(other)];
            both.insert(both.end(), theirs.begin(), theirs.end());
            for (const int f : theirs) group_of[static_cast<std::size_t>(f)] = piece;
            if (auto outline = convex_outline(surface, both, group_of, piece)) {
              outlines[static_cast<std::size_t>(piece)] = std::move(outline);
              mine = std::move(both);
              theirs.clear();
              merged = true;
              m = mine.size();
              break;
            }
            for (const int f : theirs) group_of[static_cast<std::size_t>(f)] = other;
          }
        }
      }
    }
  }
  Merged result;
  std::vector<int> number(groups.size(), -1);
  for (std::size_t g = 0; g < groups.size(); ++g) {
    if (groups[g].empty()) continue;
    number[g] = static_cast<int>(result.outline.size());
    result.outline.push_back(*outlines[g]);
    result.plane.push_back(surface.plane[static_cast<std::size_t>(groups[g][0])]);
  }
  for (const int g : group_of) result.group_of.push_back(number[static_cast<std::size_t>(g)]);
  return result;
}

/// The object as one solid, if it is closed, connected and convex.
std::optional<ConvexBody> convex_solid(const Surface& surface, const Merged& merged, double flat) {
  if (merged.outline.size() < 4) return std::nullopt;
  std::map<int, int> number;
  for (const Loop& loop : merged.outline) {
    for (const int p : loop) number.try_emplace(p, static_cast<int>(number.size()));
  }
  if (number.size() > kMostBodyVertices) return std::nullopt;
  ConvexBody body;
  body.solid = true;
  body.vertex.resize(number.size());
  for (const auto& [p, v] : number) {
    body.vertex[static_cast<std::size_t>(v)] = surface.point[static_cast<std::size_t>(p)];
    body.box.cover(surface.point[static_cast<std::size_t>(p)]);
  }
  const double slack = std::max(flat, kCoplanar * (body.box.high - body.box.low).norm());
  std::map<std::pair<int, int>, int> left_of;
  for (std::size_t g = 0; g < merged.outline.size(); ++g) {
    for (const Vector3d& v : body.vertex) {
      if (merged.plane[g].height(v) > slack) return std::nullopt;
    }
    body.face.push_back({merged.plane[g].normal, merged.plane[g].offset});
    const Loop& loop = merged.outline[g];
    for (std::size_t k = 0; k < loop.size(); ++k) {
      if (!left_of.try_emplace({number[loop[k]], number[loop[(k + 1) % loop.size()]]}, static_cast<int>(g)).second)
        return std::nullopt;
    }
  }
  // Every edge has its reverse: closed. Convex with V - E + F = 2: one piece.
  for (const auto& [ends, face] : left_of) {
    const auto twin = left_of.find({ends.second, ends.first});
    if (twin == left_of.end()) return std::nullopt;
    if (ends.first < ends.second) body.edge.push_back({ends.first, ends.second, face, twin->second});
  }
  if (body.vertex.size() + body.face.size() != body.edge.size() + 2) return std::nullopt;
  return body;
}

/// Adds the subtree of `members`, split at the median of the longest side, and returns its root.
int add_nodes(const std::vector<ConvexBody>& body, std::span<int> members, BodyTree& tree) {
  const auto number = tree.node.size();
  tree.node.emplace_back();
  Box box = Box::empty();
  for (const int b : members) {
    box.cover(body[static_cast<std::size_t>(b)].box.low);
    box.cover(body[static_cast<std::size_t>(b)].box.high);
  }
  tree.node[number].box = box;
  if (members.size() == 1) {
    tree.node[number].body = members[0];
    return static_cast<int>(number);
  }
  Eigen::Index axis = 0;
  (box.high - box.low).maxCoeff(&axis);
  const auto key = [&](int b) {
    return body[static_cast<std::size_t>(b)].box.low[axis] + body[static_cast<std::size_t>(b)].box.high[axis];
  };
  const std::size_t half = members.size() / 2;
  std::nth_element(members.begin(), members.begin() + static_cast<std::ptrdiff_t>(half), members.end(),
                   [&](int a, int b) { return key(a) != key(b) ? key(a) < key(b) : a < b; });
  const int left = add_nodes(body, members.first(half), tree);
  const int right = add_nodes(body, members.subspan(half), tree);
  tree.node[number].left = left;
  tree.node[number].right = right;
  return static_cast<int>(number);
}

}  // namespace

Blockers make_blockers(const Elements& elements, double flat) {
  const Faces& faces = elements.faces;
  Blockers blockers;
  const auto in_the_way = [&](const Plane& plane) {
    bool front = false;
    bool back = false;
    for (const Vector3d& p : faces.points) {
      const double height = plane.height(p);
      front = front || height > flat;
      back = back || height < -flat;
      if (front && back) return true;
    }
    return false;
  };
  for (std::size_t first = 0; first < faces.object.size();) {
    std::size_t last = first;
    while (last < faces.object.size() && faces.object[last] == faces.object[first]) ++last;
    const Surface surface = weld(faces, first, last, flat);
    const Merged merged = merge_coplanar(surface);
    const auto outline_points = [&](const Loop& loop) {
      std::vector<Vector3d> points;
      for (const int p : loop) points.push_back(surface.point[static_cast<std::size_t>(p)]);
      return points;
    };
    if (elements.back_element[first] < 0) {
      if (auto solid = convex_solid(surface, merged, flat)) {
        solid->object = faces.object[first];
        blockers.body.push_back(std::move(*solid));
        first = last;
        continue;
      }
    }
    for (std::size_t g = 0; g < merged.outline.size(); ++g) {
      if (!in_the_way(merged.plane[g])) continue;
      ConvexBody body;
      body.vertex = outline_points(merged.outline[g]);
      for (const Vector3d& v : body.vertex) body.box.cover(v);
      body.face.push_back({merged.plane[g].normal, merged.plane[g].offset});
      const int n = static_cast<int>(body.vertex.size());
      for (int k = 0; k < n; ++k) body.edge.push_back({k, (k + 1) % n, 0, -1});
      body.object = faces.object[first];
      blockers.body.push_back(std::move(body));
    }
    first = last;
  }
  for (int first = 0; first < static_cast<int>(blockers.body.size());) {
    const int object = blockers.body[static_cast<std::size_t>(first)].object;
    std::vector<int> members;
    for (int b = first;
         b < static_cast<int>(blockers.body.size()) && blockers.body[static_cast<std::size_t>(b)].object == object; ++b)
      members.push_back(b);
    first += static_cast<int>(members.size());
    blockers.tree.push_back({object, {}});
    add_nodes(blockers.body, members, blockers.tree.back());
  }
  return blockers;
}

}  // namespace interglow::radiosity
