// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/beam_view.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

namespace interglow::radiosity {
namespace {

constexpr int kLeafFaces = 4;
/// Nodes that wait at once: halves of halves down to a leaf, and all faces have numbers of 32 bits.
constexpr std::size_t kDeepest = 40;
/// Heights over a face's plane below this share of the distance are rounding of the coordinates.
constexpr double kPlaneNoise = 1e-12;
/// Pieces below this share of the face are dropped; they come from edges that run along one another.
constexpr double kSliver = 1e-15;

using Outline = std::vector<Eigen::Vector2d>;

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

double signed_area(const Outline& outline) {
  double twice = 0.0;
  for (std::size_t k = 2; k < outline.size(); ++k) twice += cross(outline[k - 1] - outline[0], outline[k] - outline[0]);
  return 0.5 * twice;
}

/// The parts of a convex outline on the two sides of the line through a and b; left of it is inside.
void split(const Outline& outline, const Eigen::Vector2d& a, const Eigen::Vector2d& b, Outline& inside,
           Outline& outside) {
  inside.clear();
  outside.clear();
  const Eigen::Vector2d edge = b - a;
  const auto side = [&](const Eigen::Vector2d& p) { return cross(edge, p - a); };
  double here = side(outline.back());
  for (std::size_t k = 0; k < outline.size(); ++k) {
    const Eigen::Vector2d& before = outline[(k + outline.size() - 1) % outline.size()];
    const Eigen::Vector2d& point = outline[k];
    const double there = side(point);
    if ((here > 0.0 && there < 0.0) || (here < 0.0 && there > 0.0)) {
      const Eigen::Vector2d crossing = before + (here / (here - there)) * (point - before);
      inside.push_back(crossing);
      outside.push_back(crossing);
    }
    if (there >= 0.0) inside.push_back(point);
    if (there <= 0.0) outside.push_back(point);
    here = there;
  }
}

/// Whether a side of one outline has all of the other beyond it.
bool apart(const Outline& one, const Outline& other) {
  for (std::size_t k = 0; k < one.size(); ++k) {
    const Eigen::Vector2d& a = one[k];
    const Eigen::Vector2d edge = one[k + 1 == one.size() ? 0 : k + 1] - a;
    if (edge == Eigen::Vector2d::Zero()) continue;
    if (std::all_of(other.begin(), other.end(), [&](const Eigen::Vector2d& p) { return cross(edge, p - a) <= 0.0; }))
      return true;
  }
  return false;
}

struct Blocker {
  double overlap;
  int face;
  Outline shadow;
};

/// Cuts a convex shadow out of disjoint convex pieces.
class LitPieces {
 public:
  explicit LitPieces(Outline whole) : sliver_(kSliver * std::abs(signed_area(whole))) {
    pieces_.push_back(std::move(whole));
  }

  void subtract(const Outline& shadow) {
    kept_.clear();
    for (Outline& piece : pieces_) {
      cut_.clear();
      rest_ = piece;
      for (std::size_t k = 0; k < shadow.size() && !rest_.empty(); ++k) {
        split(rest_, shadow[k], shadow[(k + 1) % shadow.size()], inside_, outside_);
        if (signed_area(outside_) > sliver_) cut_.push_back(outside_);
        rest_.swap(inside_);
        if (rest_.size() < 3 || signed_area(rest_) <= sliver_) rest_.clear();
      }
      if (rest_.empty()) {
        kept_.push_back(std::move(piece));  // the shadow misses it: keep it in one piece
      } else {
        for (Outline& part : cut_) kept_.push_back(std::move(part));
      }
    }
    pieces_.swap(kept_);
  }

  bool empty() const { return pieces_.empty(); }
  std::vector<Outline> take() { return std::move(pieces_); }

 private:
  double sliver_;
  std::vector<Outline> pieces_, kept_, cut_;
  Outline rest_, inside_, outside_;
};

}  // namespace

BeamView::BeamView(const Faces& faces, const Eigen::Vector3d& direction) : faces_(faces), direction_(direction) {
  u_ = direction.unitOrthogonal();
  v_ = direction.cross(u_);
  box_.resize(faces.corners.size());
  order_.resize(faces.corners.size());
  std::iota(order_.begin(), order_.end(), 0);
  for (std::size_t f = 0; f < faces.corners.size(); ++f) {
    Box& box = box_[f];
    box.low.setConstant(std::numeric_limits<double>::infinity());
    box.high = -box.low;
    box.top = -std::numeric_limits<double>::infinity();
    for (int k = 0; k < mesh::corner_count(faces.corners[f]); ++k) {
      const Eigen::Vector3d& point =
          faces.points[static_cast<std::size_t>(faces.corners[f][static_cast<std::size_t>(k)])];
      const Eigen::Array2d flat = across(point).array();
      box.low = box.low.min(flat);
      box.high = box.high.max(flat);
      box.top = std::max(box.top, -direction_.dot(point));
    }
  }
  if (!order_.empty()) build(0, static_cast<int>(order_.size()));
}

int BeamView::build(int first, int count) {
  const int index = static_cast<int>(nodes_.size());
  nodes_.emplace_back();
  Box box = box_[static_cast<std::size_t>(order_[static_cast<std::size_t>(first)])];
  for (int k = first + 1; k < first + count; ++k) {
    const Box& other = box_[static_cast<std::size_t>(order_[static_cast<std::size_t>(k)])];
    box.low = box.low.min(other.low);
    box.high = box.high.max(other.high);
    box.top = std::max(box.top, other.top);
  }
  Node node{.box = box, .first = first, .count = count, .right = 0};
  if (count > kLeafFaces) {
    const int axis = box.high[0] - box.low[0] >= box.high[1] - box.low[1] ? 0 : 1;
    const int half = count / 2;
    const auto middle = [&](int face) {
      const Box& b = box_[static_cast<std::size_t>(face)];
      return std::pair(b.low[axis] + b.high[axis], face);
    };
    std::nth_element(order_.begin() + first, order_.begin() + first + half, order_.begin() + first + count,
                     [&](int a, int b) { return middle(a) < middle(b); });
    node.count = 0;
    node.first = build(first, half);
    node.right = build(first + half, count - half);
  }
  nodes_[static_cast<std::size_t>(index)] = node;
  return index;
}

double BeamView::lit_area(int face, const Eigen::Vector3d& normal) const {
  double sum = 0.0;
  for (const Outline& piece : lit_outlines(face, normal)) sum += signed_area(piece);
  return sum;
}

std::vector<Eigen::Vector2d> BeamView::shadow_of(int face, const Eigen::Vector3d& origin,
                                                 const Eigen::Vector3d& normal) const {
  const mesh::Face& corners = faces_.corners[static_cast<std::size_t>(face)];
  const int count = mesh::corner_count(corners);
  std::array<Eigen::Vector3d, 4> position;
  std::array<double, 4> height{};
  double highest = 0.0;
  for (int k = 0; k < count; ++k) {
    const auto i = static_cast<std::size_t>(k);
    position[i] = faces_.points[static_cast<std::size_t>(corners[i])] - origin;
    height[i] = normal.dot(position[i]);
    highest = std::max(highest, height[i]);
  }
  Outline shadow;
  if (highest == 0.0) return shadow;
  double extent = 0.0;
  for (int k = 0; k < count; ++k) extent = std::max(extent, position[static_cast<std::size_t>(k)].norm());
  if (highest <= kPlaneNoise * extent) return shadow;
  for (int k = 0; k < count; ++k) {
    double& h = height[static_cast<std::size_t>(k)];
    if (std::abs(h) <= kPlaneNoise * extent) h = 0.0;
  }
  for (int k = 0; k < count; ++k) {
    const auto i = static_cast<std::size_t>(k);
    const auto j = static_cast<std::size_t>((k + 1) % count);
    if (height[i] >= 0.0) shadow.push_back(across(position[i]));
    if ((height[i] > 0.0 && height[j] < 0.0) || (height[i] < 0.0 && height[j] > 0.0)) {
      shadow.push_back(across(position[i] + (height[i] / (height[i] - height[j])) * (position[j] - position[i])));
    }
  }
  const double area = shadow.size() < 3 ? 0.0 : signed_area(shadow);
  if (area == 0.0) shadow.clear();  // the beam grazes it
  if (area < 0.0) std::reverse(shadow.begin(), shadow.end());
  return shadow;
}

std::vector<std::vector<Eigen::Vector2d>> BeamView::lit_outlines(int face, const Eigen::Vector3d& normal) const {
  if (!(normal.dot(direction_) < 0.0)) return {};
  const auto f = static_cast<std::size_t>(face);
  const mesh::Face& corners = faces_.corners[f];
  const auto point = [&](const mesh::Face& of, int k) -> const Eigen::Vector3d& {
    return faces_.points[static_cast<std::size_t>(of[static_cast<std::size_t>(k)])];
  };
  // Everything relative to a corner of the face: no digits are lost far from the origin.
  const Eigen::Vector3d& origin = point(corners, 0);
  Outline outline;
  double bottom = std::numeric_limits<double>::infinity();
  for (int k = 0; k < mesh::corner_count(corners); ++k) {
    outline.push_back(across(point(corners, k) - origin));
    bottom = std::min(bottom, -direction_.dot(point(corners, k)));
  }
  if (signed_area(outline) < 0.0) std::reverse(outline.begin(), outline.end());

  const Box& own = box_[f];
  struct Side {
    Eigen::Vector2d from, edge;
  };
  std::array<Side, 4> sides;
  const std::size_t side_count = outline.size();
  for (std::size_t k = 0; k < side_count; ++k)
    sides[k] = {across(origin) + outline[k], outline[k + 1 == side_count ? 0 : k + 1] - outline[k]};
  // Boxes that the beam meets together with this face; its own box alone holds much beside a long face that lies askew.
  const auto may_block = [&](const Box& box) {
    if (!(box.top > bottom && (box.low < own.high).all() && (own.low < box.high).all())) return false;
    for (std::size_t k = 0; k < side_count; ++k) {
      const auto& [from, edge] = sides[k];
      const Eigen::Vector2d innermost(edge.y() > 0.0 ? box.low.x() : box.high.x(),
                                      edge.x() > 0.0 ? box.high.y() : box.low.y());
      if (cross(edge, innermost - from) < 0.0) return false;
    }
    return true;
  };
  std::vector<Blocker> blockers;
  std::array<int, kDeepest> stack{};
  std::size_t waiting = 1;
  while (waiting > 0) {
    const Node& node = nodes_[static_cast<std::size_t>(stack[--waiting])];
    if (!may_block(node.box)) continue;
    if (node.count == 0) {
      stack[waiting++] = node.first;
      stack[waiting++] = node.right;
      continue;
    }
    for (int k = node.first; k < node.first + node.count; ++k) {
      const int other = order_[static_cast<std::size_t>(k)];
      const Box& box = box_[static_cast<std::size_t>(other)];
      if (other == face || !may_block(box)) continue;
      Outline shadow = shadow_of(other, origin, normal);
      if (shadow.empty() || apart(shadow, outline) || apart(outline, shadow)) continue;
      blockers.push_back({(box.high.min(own.high) - box.low.max(own.low)).prod(), other, std::move(shadow)});
    }
  }
  // Large shadows first: fewer pieces, and often nothing is left for the small ones.
  std::sort(blockers.begin(), blockers.end(), [](const Blocker& a, const Blocker& b) {
    return a.overlap != b.overlap ? a.overlap > b.overlap : a.face < b.face;
  });

  LitPieces lit(std::move(outline));
  for (const Blocker& blocker : blockers) {
    lit.subtract(blocker.shadow);
    if (lit.empty()) return {};
  }
  return lit.take();
}

}  // namespace interglow::radiosity
