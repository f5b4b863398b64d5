// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/blocker_search.h"

#include <Eigen/Geometry>
#include <algorithm>

namespace interglow::radiosity {

using Eigen::Vector3d;

/// Whether every line between the two ends of a shaft meets the body: for a convex body it is enough that all lines
/// between corners do.
bool BlockerSearch::covers(const ConvexBody& body, const Shaft& shaft, double flat) {
  for (int i = 0; i < shaft.a_corners; ++i) {
    for (int j = shaft.a_corners; j < shaft.corners; ++j) {
      const Vector3d& p = shaft.corner[static_cast<std::size_t>(i)];
      const Vector3d& q = shaft.corner[static_cast<std::size_t>(j)];
      if (body.solid) {
        double enter = 0.0;
        double leave = 1.0;
        for (const ConvexBody::Face& face : body.face) {
          const double hp = face.height(p);
          const double hq = face.height(q);
          if (hp >= -flat && hq >= -flat) return false;
          if (hp > 0.0)
            enter = std::max(enter, hp / (hp - hq));
          else if (hq > 0.0)
            leave = std::min(leave, hp / (hp - hq));
        }
        if (!(enter < leave)) return false;
      } else {
        const ConvexBody::Face& plane = body.face[0];
        const double hp = plane.height(p);
        const double hq = plane.height(q);
        if (!((hp > flat && hq < -flat) || (hp < -flat && hq > flat))) return false;
        const Vector3d x = (q * hp - p * hq) / (hp - hq);
        for (std::size_t k = 0; k < body.vertex.size(); ++k) {
          const Vector3d edge = body.vertex[k + 1 < body.vertex.size() ? k + 1 : 0] - body.vertex[k];
          if (plane.normal.cross(edge).dot(x - body.vertex[k]) < 0.0) return false;
        }
      }
    }
  }
  return true;
}

void BlockerSearch::add_to_shaft(int node, Shaft& shaft) const {
  const Cluster& c = problem_.cluster(node);
  const auto add = [&](const Vector3d& p) {
    shaft.corner[static_cast<std::size_t>(shaft.corners++)] = p;
    shaft.hull.cover(p);
  };
  if (c.count == 1) {
    const Polygon& polygon = problem_.tree.polygon(problem_.element(c.first));
    for (int k = 0; k < polygon.corners; ++k) add(polygon.corner[static_cast<std::size_t>(k)]);
  } else {
    for (int k = 0; k < 8; ++k) add(c.box.corner(k));
  }
}

bool BlockerSearch::may_rise_above(int node, const ConvexBody& body) const {
  const Cluster& c = problem_.cluster(node);
  if (problem_.risen && c.count == 1) return problem_.risen->above_element(problem_.element(c.first), body);
  if (c.sin_spread == 0.0) {
    return std::any_of(body.vertex.begin(), body.vertex.end(),
                       [&](const Vector3d& v) { return c.axis.dot(v) - c.lowest > problem_.tree.flat(); });
  }
  return may_face(c, body.box);
}

BlockerSearch::Between BlockerSearch::between(int a, int b) const {
  Between result{
      a,
      b,
      {},
      problem_.hidden_objects[static_cast<std::size_t>(a)] | problem_.hidden_objects[static_cast<std::size_t>(b)]};
  add_to_shaft(a, result.shaft);
  result.shaft.a_corners = result.shaft.corners;
  add_to_shaft(b, result.shaft);
  return result;
}

bool BlockerSearch::overlaps(const Box& box, const Shaft& shaft) const {
  return (box.low.array() <= shaft.hull.high.array() + flat()).all() &&
         (box.high.array() >= shaft.hull.low.array() - flat()).all();
}

bool BlockerSearch::may_cut(const ConvexBody& body, const Between& pair) const {
  const Shaft& shaft = pair.shaft;
  for (const ConvexBody::Face& face : body.face) {
    bool front = false;
    bool back = false;
    for (int c = 0; c < shaft.corners; ++c) {
      const double height = face.height(shaft.corner[static_cast<std::size_t>(c)]);
      front = front || height > flat();
      back = back || height < -flat();
    }
    if (!back || (!front && !body.solid)) return false;
  }
  if (!may_rise_above(pair.a, body) || !may_rise_above(pair.b, body)) return false;
  return !separated(shaft.corner.data(), shaft.corners, body.vertex.data(), static_cast<int>(body.vertex.size()),
                    flat());
}

bool BlockerSearch::hides_all(const ConvexBody& body, const Between& pair) const {
  return pair.a != pair.b && covers(body, pair.shaft, flat());
}

bool BlockerSearch::thin_out(int a, int b, const Candidates& candidates, Candidates& left) const {
  if (candidates.empty()) return true;
  const Between pair = between(a, b);
  for (const int k : candidates) {
    const ConvexBody& body = problem_.blockers.body[static_cast<std::size_t>(k)];
    if (is_hidden(pair, body.object) || !overlaps(body.box, pair.shaft) || !may_cut(body, pair)) continue;
    if (hides_all(body, pair)) return false;
    left.push_back(k);
  }
  return true;
}

bool BlockerSearch::search(int a, int b, std::size_t most, Candidates& found) {
  const Between pair = between(a, b);
  const int tile_a = problem_.tile_of_node[static_cast<std::size_t>(a)];
  const int tile_b = problem_.tile_of_node[static_cast<std::size_t>(b)];
  for (const BodyTree& tree : problem_.blockers.tree) {
    if (is_hidden(pair, tree.object)) continue;
    pending_.assign(1, 0);
    while (!pending_.empty()) {
      const BodyTree::Node& node = tree.node[static_cast<std::size_t>(pending_.back())];
      pending_.pop_back();
      if (!overlaps(node.box, pair.shaft)) continue;
      if (node.body < 0) {
        if (!may_face(problem_.cluster(a), node.box) || !may_face(problem_.cluster(b), node.box)) continue;
        pending_.push_back(node.right);
        pending_.push_back(node.left);
        continue;
      }
      const ConvexBody& body = problem_.blockers.body[static_cast<std::size_t>(node.body)];
      if (!problem_.risen->above_tile(tile_a, node.body) || !problem_.risen->above_tile(tile_b, node.body)) continue;
      if (!may_cut(body, pair)) continue;
      if (hides_all(body, pair)) return false;
      found.push_back(node.body);
      if (found.size() > most) return true;
    }
  }
  return true;
}

}  // namespace interglow::radiosity
