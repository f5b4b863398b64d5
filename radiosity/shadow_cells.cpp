// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/shadow_cells.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace interglow::radiosity {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::Vector4d;

constexpr std::size_t kMostCells = 96;  ///< cuts beyond this are left to refinement
constexpr int kMostSplits = 1000;
/// How far from a cell's corner, as a share of the way to its middle, the outline is looked at.
constexpr double kInwards = 0.01;
/// Of the area of a cell times what the integrand at a corner differs by from what it would be without a kink: a ramp
/// that begins before the nearest point of the rule.
constexpr double kNearCorner = 0.1;
/// A cell larger than this many times its distance from the source has layers in which the integrand falls off that its
/// points may miss: all that it varies by, over this share of the cell, is in doubt.
constexpr double kNearCell = 1.0, kNearShare = 0.25;
constexpr int kNewBody = 1000;

void add_to_outline(std::uint64_t& outline, int what) {
  outline = (outline + static_cast<std::uint64_t>(what) + 1) * 0x9e3779b97f4a7c15u;
  outline ^= outline >> 29;
}

double cross(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

template <class Shape>
bool push(Shape& shape, const typename decltype(Shape::corner)::value_type& p) {
  if (static_cast<std::size_t>(shape.corners) >= shape.corner.size()) return false;
  shape.corner[static_cast<std::size_t>(shape.corners++)] = p;
  return true;
}

/// The part of a convex outline where height(corner) >= 0.
template <class Shape, class Height>
void clip(const Shape& in, const Height& height, Shape& out) {
  out.corners = 0;
  const auto n = static_cast<std::size_t>(in.corners);
  if (n == 0) return;
  double before = height(in.corner[n - 1]);
  for (std::size_t k = 0; k < n; ++k) {
    const auto& a = in.corner[k > 0 ? k - 1 : n - 1];
    const auto& b = in.corner[k];
    const double here = height(b);
    if ((before > 0.0 && here < 0.0) || (before < 0.0 && here > 0.0))
      push(out, (a * here - b * before) / (here - before));
    if (here >= 0.0) push(out, b);
    before = here;
  }
  if (out.corners < 3) out.corners = 0;
}

/// angle / sine of the angle between two vectors, times the product of their lengths over their dot product: atan(t) /
/// t for t² = |a × b|² / (a · b)². The series is good to 1e-11 below t² = 0.06.
double arc_over_tangent(double tangent_squared, double dot) {
  if (dot > 0.0 && tangent_squared < 0.06) {
    const double q = tangent_squared;
    return 1.0 - q * (1.0 / 3 -
                      q * (1.0 / 5 -
                           q * (1.0 / 7 - q * (1.0 / 9 - q * (1.0 / 11 - q * (1.0 / 13 - q * (1.0 / 15 - q / 17)))))));
  }
  const double tangent = std::sqrt(tangent_squared);
  // For an angle past a right angle the tangent and the dot product change sign together.
  return dot > 0.0 ? std::atan(tangent) / tangent : (std::atan(tangent) - std::numbers::pi) / tangent;
}

/// Lambert's contour formula for an outline relative to a point whose normal is +z.
template <class Shape>
double contour(const Shape& outline) {
  double sum = 0.0;
  const auto n = static_cast<std::size_t>(outline.corners);
  for (std::size_t k = 0; k < n; ++k) {
    const Vector3d& a = outline.corner[k];
    const Vector3d& b = outline.corner[k + 1 < n ? k + 1 : 0];
    const Vector3d across = a.cross(b);
    const double squared = across.squaredNorm();
    const double dot = a.dot(b);
    if (!(squared > 0.0)) continue;
    if (dot == 0.0) {
      sum += across.z() / std::sqrt(squared) * (0.5 * std::numbers::pi);
    } else {
      sum += across.z() / dot * arc_over_tangent(squared / (dot * dot), dot);
    }
  }
  return std::max(0.0, -sum / (2.0 * std::numbers::pi));
}

/// Clips `in` by all planes of a cone with its apex at the origin, using two spare outlines. Returns what is left;
/// empty: nothing. Adds the planes that cut to `outline`.
template <class Shape>
const Shape* clip_to_cone(const Shape* in, std::span<const Vector3d> cone, Shape& one, Shape& two,
                          std::uint64_t& outline) {
  std::array<double, 64> height;
  for (std::size_t p = 0; p < cone.size(); ++p) {
    const Vector3d& plane = cone[p];
    const auto n = static_cast<std::size_t>(in->corners);
    double lowest = 0.0;
    double highest = 0.0;
    for (std::size_t k = 0; k < n; ++k) {
      height[k] = plane.dot(in->corner[k]);
      lowest = std::min(lowest, height[k]);
      highest = std::max(highest, height[k]);
    }
    if (lowest >= 0.0) continue;
    if (highest <= 0.0) return nullptr;
    add_to_outline(outline, static_cast<int>(p));
    Shape& out = in == &one ? two : one;
    out.corners = 0;
    for (std::size_t k = 0; k < n; ++k) {
      const std::size_t next = k + 1 < n ? k + 1 : 0;
      if (height[k] >= 0.0) push(out, in->corner[k]);
      if ((height[k] > 0.0 && height[next] < 0.0) || (height[k] < 0.0 && height[next] > 0.0)) {
        const double t = height[k] / (height[k] - height[next]);
        push(out, in->corner[k] + t * (in->corner[next] - in->corner[k]));
      }
    }
    if (out.corners < 3) return nullptr;
    in = &out;
  }
  return in;
}

/// Whether a straight piece from a to b reaches into a convex cell whose corners run counter-clockwise. Sides of less
/// than `thin`, which cuts through a corner leave, have no direction and are passed over.
template <class Shape>
bool touches(const Shape& cell, const Vector2d& a, const Vector2d& b, double thin) {
  double from = 0.0;
  double to = 1.0;
  const auto n = static_cast<std::size_t>(cell.corners);
  for (std::size_t k = 0; k < n; ++k) {
    const Vector2d& p = cell.corner[k];
    const Vector2d side = cell.corner[k + 1 < n ? k + 1 : 0] - p;
    if (side.squaredNorm() < thin * thin) continue;
    const double at_a = cross(side, a - p);
    const double at_b = cross(side, b - p);
    if (at_a <= 0.0 && at_b <= 0.0) return false;
    if (at_a < 0.0) from = std::max(from, at_a / (at_a - at_b));
    if (at_b < 0.0) to = std::min(to, at_a / (at_a - at_b));
    if (from >= to) return false;
  }
  return true;
}

double area_of(std::span<const Vector2d> corners) {
  double twice = 0.0;
  for (std::size_t k = 2; k < corners.size(); ++k) twice += cross(corners[k - 1] - corners[0], corners[k] - corners[0]);
  return 0.5 * twice;
}

}  // namespace

void ShadowCells::cut_body(LocalBody& body, const Vector3d& normal, double offset, double flat) {
  std::array<double, 512> height;
  const std::size_t vertices = body.vertex.size();
  bool any_outside = false;
  for (std::size_t v = 0; v < vertices; ++v) {
    height[v] = normal.dot(body.vertex[v]) - offset;
    // A corner that the patch and the body share is on the plane: an edge of no length has no direction.
    if (std::abs(height[v]) <= flat) height[v] = 0.0;
    any_outside = any_outside || height[v] <= 0.0;
  }
  if (!any_outside) return;
  std::vector<std::array<int, 3>> on_face(body.face.size() + 1, {0, -1, -1});
  std::vector<LocalBody::Edge> kept;
  for (const LocalBody::Edge& edge : body.edge) {
    const double ha = height[static_cast<std::size_t>(edge.a)];
    const double hb = height[static_cast<std::size_t>(edge.b)];
    if (ha <= 0.0 && hb <= 0.0) continue;
    LocalBody::Edge part = edge;
    if (ha <= 0.0 || hb <= 0.0) {
      const Vector3d& a = body.vertex[static_cast<std::size_t>(edge.a)];
      const Vector3d& b = body.vertex[static_cast<std::size_t>(edge.b)];
      const int crossing = static_cast<int>(body.vertex.size());
      body.vertex.push_back((a * hb - b * ha) / (hb - ha));
      (ha <= 0.0 ? part.a : part.b) = crossing;
      for (const int face : {edge.face, edge.other}) {
        if (face < 0) continue;
        auto& points = on_face[static_cast<std::size_t>(face)];
        if (points[0] < 2) points[static_cast<std::size_t>(++points[0])] = crossing;
      }
    }
    kept.push_back(part);
  }
  for (std::size_t f = 0; f < body.face.size(); ++f) {
    if (on_face[f][0] == 2) kept.push_back({on_face[f][1], on_face[f][2], static_cast<int>(f), -1});
  }
  body.edge.swap(kept);
}

bool ShadowCells::make_local(const ConvexBody& body, const Eigen::Matrix3d& axes, const Vector3d& origin, double flat,
                             LocalBody& local) {
  local.solid = body.solid;
  local.vertex.clear();
  local.face.clear();
  local.edge.clear();
  double lowest = 0.0;
  double deepest = 0.0;
  double highest = 0.0;
  double nearest = 0.0;
  for (const Vector3d& v : body.vertex) {
    local.vertex.push_back(axes * (v - origin));
    const double above = local.vertex.back().z();
    const double before = source_normal_.dot(local.vertex.back()) - source_offset_;
    lowest = std::min(lowest, above);
    highest = std::max(highest, above);
    deepest = std::min(deepest, before);
    nearest = std::max(nearest, before);
  }
  if (highest <= flat || nearest <= flat) return false;
  for (const ConvexBody::Face& face : body.face) {
    Vector4d plane;
    plane << axes * face.normal, face.normal.dot(origin) - face.offset;
    local.face.push_back(plane);
  }
  for (const ConvexBody::Edge& edge : body.edge) local.edge.push_back({edge.a, edge.b, edge.face, edge.other});
  if (lowest < -flat) cut_body(local, Vector3d::UnitZ(), 0.0, flat);
  if (deepest < -flat) cut_body(local, source_normal_, source_offset_, flat);
  if (local.edge.size() < 3) return false;
  local.centre.setZero();
  for (const LocalBody::Edge& edge : local.edge) {
    local.centre += local.vertex[static_cast<std::size_t>(edge.a)] + local.vertex[static_cast<std::size_t>(edge.b)];
  }
  local.centre /= 2.0 * static_cast<double>(local.edge.size());
  return true;
}

void ShadowCells::add_line(const Vector2d& a, const Vector2d& b) {
  if (cells_.size() >= kMostCells) return;
  if (std::max(a.x(), b.x()) < patch_low_.x() || std::min(a.x(), b.x()) > patch_high_.x()) return;
  if (std::max(a.y(), b.y()) < patch_low_.y() || std::min(a.y(), b.y()) > patch_high_.y()) return;
  const Vector2d along = b - a;
  const double length = along.norm();
  if (!(length > 0.0)) return;
  const Vector3d line(-along.y() / length, along.x() / length, (along.y() * a.x() - along.x() * a.y()) / length);
  const auto height = [&](const Vector2d& p) { return line.x() * p.x() + line.y() * p.y() + line.z(); };
  // Slivers thinner than this share of the patch are not worth a cell.
  const double thin = 1e-4 * (patch_high_ - patch_low_).norm();
  const std::size_t count = cells_.size();
  for (std::size_t c = 0; c < count; ++c) {
    double lowest = 0.0;
    double highest = 0.0;
    for (int k = 0; k < cells_[c].corners; ++k) {
      const double h = height(cells_[c].corner[static_cast<std::size_t>(k)]);
      lowest = std::min(lowest, h);
      highest = std::max(highest, h);
    }
    if (highest <= thin || lowest >= -thin || cells_[c].corners > 10 || !touches(cells_[c], a, b, thin)) continue;
    Cell below;
    clip(
        cells_[c], [&](const Vector2d& p) { return -height(p); }, below);
    const Cell whole = cells_[c];
    clip(whole, height, cells_[c]);
    if (below.corners >= 3) cells_.push_back(below);
    if (cells_[c].corners < 3) cells_[c] = whole;
  }
}

void ShadowCells::add_events(const LocalBody& body) {
  // Sides of the outer patch's corners of each face's plane: 1 in front, 2 behind.
  std::array<int, 512> sides{};
  for (std::size_t f = 0; f < body.face.size(); ++f) {
    for (int k = 0; k < patch_.corners; ++k) {
      const Vector2d& p = patch_.corner[static_cast<std::size_t>(k)];
      sides[f] |= body.face[f].x() * p.x() + body.face[f].y() * p.y() + body.face[f].w() > 0.0 ? 1 : 2;
    }
    if (sides[f] == 3) {
      const double slope = body.face[f].head<2>().norm();
      const Vector3d line = Vector3d(body.face[f].x(), body.face[f].y(), body.face[f].w()) / slope;
      const Vector2d middle = 0.5 * (patch_low_ + patch_high_);
      const Vector2d foot = middle - (line.head<2>().dot(middle) + line.z()) * line.head<2>();
      const Vector2d along = (patch_high_ - patch_low_).norm() * Vector2d(-line.y(), line.x());
      add_line(foot - along, foot + along);
    }
  }
  const auto n = static_cast<std::size_t>(source_.corners);
  // Shadow on z = 0 of v from a source point c above it.
  const auto shadow = [](const Vector3d& v, const Vector3d& c) {
    return Vector2d(v.head<2>() + (v - c).head<2>() * (v.z() / (c.z() - v.z())));
  };
  constexpr double kBelow = 0.999;  // shadows of what is nearly as high as the source point lie far outside
  for (const LocalBody::Edge& edge : body.edge) {
    if (body.solid) {
      const int one = edge.face < 0 ? 2 : sides[static_cast<std::size_t>(edge.face)];
      const int two = edge.other < 0 ? 2 : sides[static_cast<std::size_t>(edge.other)];
      if ((one | two) != 3) continue;
    }
    const Vector3d& a = body.vertex[static_cast<std::size_t>(edge.a)];
    const Vector3d& b = body.vertex[static_cast<std::size_t>(edge.b)];
    for (std::size_t k = 0; k < n; ++k) {
      const Vector3d& c = source_.corner[k];
      const double top = kBelow * c.z();
      if (a.z() >= top && b.z() >= top) continue;
      Vector3d low = a;
      Vector3d high = b;
      if (a.z() >= top) low = b + (a - b) * ((top - b.z()) / (a.z() - b.z()));
      if (b.z() >= top) high = a + (b - a) * ((top - a.z()) / (b.z() - a.z()));
      add_line(shadow(low, c), shadow(high, c));
    }
    for (const Vector3d& v : {a, b}) {
      for (std::size_t k = 0; k < n; ++k) {
        Vector3d c = source_.corner[k];
        Vector3d d = source_.corner[k + 1 < n ? k + 1 : 0];
        const double bottom = v.z() / kBelow;
        if (c.z() <= bottom && d.z() <= bottom) continue;
        if (c.z() <= bottom)
          c = d + (c - d) * ((bottom - d.z()) / (c.z() - d.z()));
        else if (d.z() <= bottom)
          d = c + (d - c) * ((bottom - c.z()) / (d.z() - c.z()));
        if (!(c.z() > v.z() && d.z() > v.z())) continue;
        add_line(shadow(v, c), shadow(v, d));
      }
    }
  }
}

void ShadowCells::find_silhouettes(const Vector2d& position) {
  const Vector3d point(position.x(), position.y(), 0.0);
  for (int k = 0; k < body_count_; ++k) {
    LocalBody& body = bodies_[static_cast<std::size_t>(k)];
    body.silhouette.clear();
    if (!body.solid) {
      body.silhouette = body.edge;
      continue;
    }
    body.seen.resize(body.face.size() + 1);
    for (std::size_t f = 0; f < body.face.size(); ++f)
      body.seen[f] = body.face[f].head<3>().dot(point) + body.face[f].w() > 0.0 ? 1 : 0;
    body.seen.back() = 0;  // a cut is never seen
    const auto seen = [&](int f) { return body.seen[f < 0 ? body.seen.size() - 1 : static_cast<std::size_t>(f)]; };
    for (const LocalBody::Edge& edge : body.edge) {
      if (seen(edge.face) != seen(edge.other)) body.silhouette.push_back(edge);
    }
  }
}

bool ShadowCells::cone_at(LocalBody& body, const Vector3d& point) {
  body.cone.clear();
  const Vector3d inside = body.centre - point;
  for (const LocalBody::Edge& edge : body.silhouette) {
    const Vector3d normal = (body.vertex[static_cast<std::size_t>(edge.a)] - point)
                                .cross(body.vertex[static_cast<std::size_t>(edge.b)] - point);
    const double side = normal.dot(inside);
    if (side * side <= 1e-28 * normal.squaredNorm() * inside.squaredNorm()) {
      if (!body.solid) return false;  // a sheet seen edge on covers nothing
      continue;
    }
    body.cone.push_back(side > 0.0 ? normal : Vector3d(-normal));
  }
  return body.cone.size() >= 3;
}

double ShadowCells::uncovered(const Outline& part, int bodies, std::uint64_t& outline) {
  double sum = contour(part);
  add_to_outline(outline, part.corners);
  Outline one;
  Outline two;
  for (int k = 0; k < bodies; ++k) {
    const LocalBody& body = bodies_[static_cast<std::size_t>(k)];
    if (body.cone.empty()) continue;
    const Outline* inside = clip_to_cone(&part, std::span<const Vector3d>(body.cone), one, two, outline);
    if (inside != nullptr) sum -= uncovered(*inside, k, outline);
    add_to_outline(outline, k);
  }
  return std::max(0.0, sum);
}

ShadowCells::Look ShadowCells::look(const Vector2d& position) {
  const Vector3d point(position.x(), position.y(), 0.0);
  Outline seen;
  Outline one;
  Outline two;
  seen.corners = source_.corners;
  for (std::size_t k = 0; k < static_cast<std::size_t>(source_.corners); ++k)
    seen.corner[k] = source_.corner[k] - point;
  Look result;
  for (int k = 0; k < body_count_; ++k) {
    LocalBody& body = bodies_[static_cast<std::size_t>(k)];
    std::uint64_t outline = result.outline;
    const Outline* inside =
        cone_at(body, point) ? clip_to_cone(&seen, std::span<const Vector3d>(body.cone), one, two, outline) : nullptr;
    if (inside == &seen) return {contour(seen), 0, 1, true};
    if (inside == nullptr) {
      body.cone.clear();
      continue;
    }
    ++result.bodies;
    result.outline = outline;
    add_to_outline(result.outline, kNewBody + k);
    result.hidden += uncovered(*inside, k, result.outline);
  }
  return result;
}

double ShadowCells::distance_square(const Vector2d& position) const {
  const Vector3d point(position.x(), position.y(), 0.0);
  const double height = source_normal_.dot(point) - source_offset_;
  double least = std::numeric_limits<double>::infinity();
  bool over = true;
  for (std::size_t k = 0; k < static_cast<std::size_t>(source_.corners); ++k) {
    const Vector3d& a = source_.corner[k];
    const Vector3d& b = source_.corner[k + 1 == static_cast<std::size_t>(source_.corners) ? 0 : k + 1];
    const Vector3d edge = b - a, way = point - a;
    over = over && source_normal_.dot(edge.cross(way)) >= 0.0;
    const double length = edge.squaredNorm();
    const double t = length > 0.0 ? std::clamp(way.dot(edge) / length, 0.0, 1.0) : 0.0;
    least = std::min(least, (way - t * edge).squaredNorm());
  }
  if (over) least = height * height;
  for (int k = 0; k < body_count_; ++k) {
    const std::vector<Vector3d>& vertex = bodies_[static_cast<std::size_t>(k)].vertex;
    Vector3d box_low = vertex[0], box_high = vertex[0];
    for (const Vector3d& v : vertex) box_low = box_low.cwiseMin(v), box_high = box_high.cwiseMax(v);
    least = std::min(least, (point.cwiseMax(box_low).cwiseMin(box_high) - point).squaredNorm());
  }
  return least;
}

void ShadowCells::evaluate(Cell& cell) {
  const std::span<const Vector2d> corners(cell.corner.data(), static_cast<std::size_t>(cell.corners));
  const double area = area_of(corners);
  Vector2d middle = Vector2d::Zero();
  for (std::size_t k = 2; k < corners.size(); ++k) {
    middle += 0.5 * cross(corners[k - 1] - corners[0], corners[k] - corners[0]) *
              (corners[0] + corners[k - 1] + corners[k]) / 3.0;
  }
  middle /= area;
  find_silhouettes(middle);
  const Look centre = look(middle);
  const double at_middle = area * centre.hidden;
  cell.covered = centre.covered;
  cell.touched = at_middle > 0.0;
  cell.hidden = at_middle;
  cell.error = 0.0;
  const bool near = area > kNearCell * kNearCell * distance_square(middle);
  if (!cell.touched && !near) return;
  if (at_middle < small_ && !near) {
    cell.error = 0.5 * at_middle;
    return;
  }
  double sum = 0.0;
  bool same = true;     // outline at all points
  double missed = 0.0;  // near corners from where the outline is another
  double least = centre.hidden, most = centre.hidden;
  const auto add = [&](const Vector2d& p, double weight) {
    const Look seen = look(p);
    same = same && seen.outline == centre.outline;
    sum += weight * seen.hidden;
    least = std::min(least, seen.hidden);
    most = std::max(most, seen.hidden);
    return seen.hidden;
  };
  const bool corners_too = near || centre.bodies > 1;
  const auto compare = [&](const Vector2d& corner, double expected, double share) {
    const Look seen = look(corner + kInwards * (middle - corner));
    least = std::min(least, seen.hidden);
    most = std::max(most, seen.hidden);
    if (seen.outline == centre.outline) return;
    same = false;
    missed += kNearCorner * share * std::abs(seen.hidden - expected);
  };
  std::size_t k = 1;
  while (k + 1 < corners.size()) {
    const Vector2d& a = corners[0];
    const Vector2d& b = corners[k];
    const Vector2d& c = corners[k + 1];
    if (k + 2 < corners.size()) {
      const Vector2d& d = corners[k + 2];
      constexpr double kNode = 0.21132486540518713;  // (1 - 1/sqrt(3)) / 2
      std::array<double, 4> value;
      for (std::size_t n = 0; n < 4; ++n) {
        const double u = n < 2 ? kNode : 1.0 - kNode;
        const double v = n % 2 == 0 ? kNode : 1.0 - kNode;
        const Vector2d along_u = (1 - v) * (b - a) + v * (c - d);
        const Vector2d along_v = (1 - u) * (d - a) + u * (c - b);
        value[n] = add((1 - u) * ((1 - v) * a + v * d) + u * ((1 - v) * b + v * c), 0.25 * cross(along_u, along_v));
      }
      if (corners_too) {
        constexpr double kNear = 1.3660254037844386;  // (1 + sqrt(3)) / 2: a line through two nodes, at a corner
        constexpr double kFar = 1.0 - kNear;
        const double share = 0.5 * (cross(b - a, c - a) + cross(c - a, d - a));
        const std::array<const Vector2d*, 4> corner = {&a, &d, &b, &c};
        for (std::size_t n = 0; n < 4; ++n) {
          compare(*corner[n],
                  kNear * kNear * value[n] + kNear * kFar * (value[n ^ 1] + value[n ^ 2]) + kFar * kFar * value[n ^ 3],
                  share);
        }
      }
      k += 2;
    } else {
      const double weight = cross(b - a, c - a) / 6.0;
      const std::array<double, 3> value = {add((4.0 * a + b + c) / 6.0, weight), add((a + 4.0 * b + c) / 6.0, weight),
                                           add((a + b + 4.0 * c) / 6.0, weight)};
      if (corners_too) {
        const double all = value[0] + value[1] + value[2];
        compare(a, 2.0 * value[0] - all / 3.0, 3.0 * weight);
        compare(b, 2.0 * value[1] - all / 3.0, 3.0 * weight);
        compare(c, 2.0 * value[2] - all / 3.0, 3.0 * weight);
      }
      k += 1;
    }
  }
  cell.hidden = sum;
  // The integrand is analytic in a cell: where the midpoint is off by a small share e, the rule of degree 2 or 3 is off
  // by about e².
  const double difference = std::abs(sum - at_middle);
  cell.error =
      same ? difference * std::clamp(4.0 * difference / std::max(sum, 1e-300), 0.05, 1.0) : difference + missed;
  cell.touched = cell.touched || most > 0.0;
  if (near) cell.error = std::max(cell.error, kNearShare * area * (most - least));
}

ShadowResult ShadowCells::integrate(const Polygon& outer, const Polygon& source,
                                    std::span<const ConvexBody* const> bodies, double tolerance, double flat) {
  Vector3d area = Vector3d::Zero();
  for (std::size_t k = 2; k < static_cast<std::size_t>(outer.corners); ++k) {
    area += (outer.corner[k - 1] - outer.corner[0]).cross(outer.corner[k] - outer.corner[0]);
  }
  const Vector3d& origin = outer.corner[0];
  Eigen::Matrix3d axes;
  axes.row(2) = area.normalized().transpose();
  axes.row(0) = (outer.corner[1] - origin).normalized().transpose();
  axes.row(1) = axes.row(2).cross(axes.row(0));
  Outline in_frame;
  in_frame.corners = source.corners;
  Vector3d source_area = Vector3d::Zero();
  for (std::size_t k = 0; k < static_cast<std::size_t>(source.corners); ++k) {
    in_frame.corner[k] = axes * (source.corner[k] - origin);
    if (std::abs(in_frame.corner[k].z()) <= flat) in_frame.corner[k].z() = 0.0;
    if (k >= 2)
      source_area += (in_frame.corner[k - 1] - in_frame.corner[0]).cross(in_frame.corner[k] - in_frame.corner[0]);
  }
  clip(
      in_frame, [](const Vector3d& p) { return p.z(); }, source_);
  source_normal_ = source_area.normalized();
  source_offset_ = source_normal_.dot(in_frame.corner[0]);
  Cell whole;
  for (std::size_t k = 0; k < static_cast<std::size_t>(outer.corners); ++k)
    push(whole, Vector2d((axes * (outer.corner[k] - origin)).head<2>()));
  clip(
      whole,
      [&](const Vector2d& p) {
        const double height = source_normal_.head<2>().dot(p) - source_offset_;
        return std::abs(height) <= flat ? 0.0 : height;
      },
      patch_);
  ShadowResult result;
  if (source_.corners == 0 || patch_.corners == 0) return result;
  patch_low_ = patch_high_ = patch_.corner[0];
  for (int k = 1; k < patch_.corners; ++k) {
    patch_low_ = patch_low_.cwiseMin(patch_.corner[static_cast<std::size_t>(k)]);
    patch_high_ = patch_high_.cwiseMax(patch_.corner[static_cast<std::size_t>(k)]);
  }
  cells_.assign(1, patch_);
  body_count_ = 0;
  if (bodies_.size() < bodies.size()) bodies_.resize(bodies.size());
  for (const ConvexBody* body : bodies) {
    LocalBody& local = bodies_[static_cast<std::size_t>(body_count_)];
    if (!make_local(*body, axes, origin, flat, local)) continue;
    add_events(local);
    ++body_count_;
  }
  if (body_count_ == 0) return result;
  small_ = 0.05 * tolerance;
  result.covered = true;
  for (Cell& cell : cells_) {
    evaluate(cell);
    result.covered = result.covered && cell.covered;
    result.touched = result.touched || cell.touched;
  }
  for (int split = 0; split < kMostSplits && result.touched && !result.covered; ++split) {
    double error = 0.0;
    std::size_t worst = 0;
    for (std::size_t c = 0; c < cells_.size(); ++c) {
      error += cells_[c].error;
      if (cells_[c].error > cells_[worst].error) worst = c;
    }
    if (error <= tolerance) break;
    const Cell cell = cells_[worst];
    // Across the longest edge, through its middle and the opposite side's.
    int longest = 0;
    double length = 0.0;
    for (int k = 0; k < cell.corners; ++k) {
      const double edge =
          (cell.corner[static_cast<std::size_t>((k + 1) % cell.corners)] - cell.corner[static_cast<std::size_t>(k)])
              .norm();
      if (edge > length) {
        length = edge;
        longest = k;
      }
    }
    const Vector2d& a = cell.corner[static_cast<std::size_t>(longest)];
    const Vector2d& b = cell.corner[static_cast<std::size_t>((longest + 1) % cell.corners)];
    const Vector2d along = (b - a) / length;
    const double at = along.dot(0.5 * (a + b));
    Cell low;
    Cell high;
    clip(
        cell, [&](const Vector2d& p) { return along.dot(p) - at; }, high);
    clip(
        cell, [&](const Vector2d& p) { return at - along.dot(p); }, low);
    if (low.corners < 3 || high.corners < 3 || cell.corners > 10) break;
    evaluate(low);
    evaluate(high);
    cells_[worst] = low;
    cells_.push_back(high);
  }
  for (const Cell& cell : cells_) {
    result.hidden += cell.hidden;
    result.error_estimate += cell.error;
  }
  return result;
}

}  // namespace interglow::radiosity
