// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/occluded_form_factor.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "diagnostics/error.h"

namespace interglow::radiosity {
namespace {

using Eigen::Vector3d;
using Outline = std::vector<Vector3d>;

/// Heights below this share of the extent count as zero: a few roundings of the coordinates.
constexpr double kFlat = 1e-13;
/// Integration points after which the outer rule stops refining and says what it has reached.
constexpr int kMostPoints = 400000;

struct Plane {
  Vector3d normal;  ///< unit
  double offset = 0.0;
  double height(const Vector3d& p) const { return normal.dot(p) - offset; }
};

Plane plane_of(const Outline& outline) {
  Vector3d area = Vector3d::Zero();
  for (std::size_t k = 2; k < outline.size(); ++k) area += (outline[k - 1] - outline[0]).cross(outline[k] - outline[0]);
  Plane plane;
  plane.normal = area.stableNormalized();
  plane.offset = plane.normal.dot(outline[0]);
  return plane;
}

Outline outline_of(const Polygon& polygon) {
  return {polygon.corner.begin(), polygon.corner.begin() + polygon.corners};
}

double extent_of(const Outline& a, const Outline& b) {
  double extent = 0.0;
  for (const Vector3d& p : a) {
    for (const Vector3d& q : a) extent = std::max(extent, (p - q).norm());
    for (const Vector3d& q : b) extent = std::max(extent, (p - q).norm());
  }
  return extent;
}

/// The part of a convex outline above a plane; corners within `flat` of it count as on it.
Outline above(const Outline& outline, const Plane& plane, double flat) {
  Outline part;
  bool any = false;
  for (std::size_t k = 0; k < outline.size(); ++k) {
    const Vector3d& a = outline[k];
    const Vector3d& b = outline[(k + 1) % outline.size()];
    double height_a = plane.height(a);
    double height_b = plane.height(b);
    if (std::abs(height_a) <= flat) height_a = 0.0;
    if (std::abs(height_b) <= flat) height_b = 0.0;
    any = any || height_a > 0.0;
    if (height_a >= 0.0) part.push_back(a);
    if ((height_a > 0.0 && height_b < 0.0) || (height_a < 0.0 && height_b > 0.0)) {
      part.push_back((b * height_a - a * height_b) / (height_a - height_b));
    }
  }
  if (!any || part.size() < 3) part.clear();
  return part;
}

/// Whether every line from `from` to `to` meets the blocker: for convex shapes it is enough that all lines between
/// corners do.
bool covers(const Outline& blocker, const Outline& from, const Outline& to, double extent) {
  const Plane plane = plane_of(blocker);
  const double flat = kFlat * extent;
  for (const Vector3d& p : from) {
    const double start = plane.height(p);
    for (const Vector3d& q : to) {
      const double end = plane.height(q);
      if (!((start > -flat && end < flat && start - end > flat) || (start < flat && end > -flat && end - start > flat)))
        return false;
      const Vector3d x = (q * start - p * end) / (start - end);
      for (std::size_t k = 0; k < blocker.size(); ++k) {
        const Vector3d& a = blocker[k];
        const Vector3d edge = blocker[(k + 1) % blocker.size()] - a;
        if (plane.normal.cross(edge).dot(x - a) < -flat * edge.norm()) return false;
      }
    }
  }
  return true;
}

/// Nodes and weights of Gauss-Legendre on [0, 1].
struct GaussRule {
  int count;
  std::array<double, 8> node;
  std::array<double, 8> weight;
};

GaussRule gauss_rule(int n) {
  GaussRule rule{n, {}, {}};
  for (int k = 0; k < n; ++k) {
    double x = std::cos(std::acos(-1.0) * (k + 0.75) / (n + 0.5));
    double slope = 1.0;
    for (int iteration = 0; iteration < 50; ++iteration) {
      double before = 1.0;
      double value = x;
      for (int degree = 2; degree <= n; ++degree) {
        const double next = ((2 * degree - 1) * x * value - (degree - 1) * before) / degree;
        before = value;
        value = next;
      }
      if (n == 1) before = 1.0;
      slope = n * (x * value - before) / (x * x - 1.0);
      const double step = value / slope;
      x -= step;
      if (std::abs(step) < 1e-16) break;
    }
    rule.node[static_cast<std::size_t>(k)] = 0.5 * (1.0 - x);
    rule.weight[static_cast<std::size_t>(k)] = 1.0 / ((1.0 - x * x) * slope * slope);
  }
  return rule;
}

const GaussRule& gauss(int n) {
  static const std::array<GaussRule, 9> rules = {gauss_rule(1), gauss_rule(1), gauss_rule(2),
                                                 gauss_rule(3), gauss_rule(4), gauss_rule(5),
                                                 gauss_rule(6), gauss_rule(7), gauss_rule(8)};
  return rules[static_cast<std::size_t>(n)];
}

/// A quadrilateral piece of the outer patch (a triangle repeats its last corner) and what two rules found on it.
struct Cell {
  std::array<Vector3d, 4> corner;
  SeenShare coarse, fine;

  /// Error of the visible integral that is not a common factor of whole and visible.
  double error(double common_share) const {
    const double share = fine.whole > 0.0 ? fine.visible / fine.whole : 0.0;
    return std::abs(coarse.visible - share * coarse.whole) +
           std::abs(share - common_share) * std::abs(fine.whole - coarse.whole);
  }
};

class OuterRule {
 public:
  OuterRule(const Outline& outer, const Polygon& source, std::span<const BlockerOutline> blockers, int order,
            VisiblePart& work)
      : normal_(plane_of(outer).normal), source_(source), blockers_(blockers), order_(order), work_(work) {}

  void add(const Outline& convex) {
    for (std::size_t k = 1; k + 1 < convex.size(); k += 2) {
      Cell cell;
      cell.corner = {convex[0], convex[k], convex[k + 1], convex[std::min(k + 2, convex.size() - 1)]};
      if (k + 2 >= convex.size()) cell.corner[3] = cell.corner[2];
      evaluate(cell);
      cells_.push_back(cell);
    }
  }

  VisibleShare refine(double tolerance) {
    VisibleShare result;
    for (;;) {
      double whole = 0.0;
      double visible = 0.0;
      for (const Cell& cell : cells_) {
        whole += cell.fine.whole;
        visible += cell.fine.visible;
      }
      if (!(whole > 0.0)) return {0.0, 0.0, true};
      result.share = visible / whole;
      result.partial = true;
      double error = 0.0;
      double worst = 0.0;
      for (const Cell& cell : cells_) {
        const double e = cell.error(result.share);
        error += e;
        worst = std::max(worst, e);
      }
      result.error_estimate = error / whole + 1e-15;
      if (error <= tolerance * whole || points_ > kMostPoints) return result;
      // All cells that are within a factor of the worst are split in one sweep, so that the sums stay cheap.
      const double limit = std::max(0.25 * worst, 0.25 * tolerance * whole / static_cast<double>(cells_.size()));
      const std::size_t count = cells_.size();
      for (std::size_t k = 0; k < count; ++k) {
        if (cells_[k].error(result.share) >= limit) split(k);
      }
    }
  }

  int points() const { return points_; }

 private:
  SeenShare integrate(const Cell& cell, int n) {
    const GaussRule& rule = gauss(n);
    const auto& [a, b, c, d] = cell.corner;
    SeenShare sum;
    for (int iu = 0; iu < n; ++iu) {
      for (int iv = 0; iv < n; ++iv) {
        const double u = rule.node[static_cast<std::size_t>(iu)];
        const double v = rule.node[static_cast<std::size_t>(iv)];
        const Vector3d along_u = (1 - v) * (b - a) + v * (c - d);
        const Vector3d along_v = (1 - u) * (d - a) + u * (c - b);
        const Vector3d point = (1 - u) * ((1 - v) * a + v * d) + u * ((1 - v) * b + v * c);
        const double weight = rule.weight[static_cast<std::size_t>(iu)] * rule.weight[static_cast<std::size_t>(iv)] *
                              along_u.cross(along_v).norm();
        const SeenShare seen = work_.seen(point, normal_, source_, blockers_);
        sum.whole += weight * seen.whole;
        sum.visible += weight * seen.visible;
      }
    }
    points_ += n * n;
    return sum;
  }

  void evaluate(Cell& cell) {
    cell.coarse = integrate(cell, order_);
    cell.fine = integrate(cell, order_ + 1);
  }

  void split(std::size_t k) {
    const auto [a, b, c, d] = cells_[k].corner;
    const double across_u = std::max((b - a).norm(), (c - d).norm());
    const double across_v = std::max((d - a).norm(), (c - b).norm());
    std::vector<std::array<Vector3d, 4>> halves;
    if (across_u >= across_v) {
      const Vector3d ab = 0.5 * (a + b);
      const Vector3d dc = 0.5 * (d + c);
      halves = {{a, ab, dc, d}, {ab, b, c, dc}};
    } else {
      const Vector3d ad = 0.5 * (a + d);
      const Vector3d bc = 0.5 * (b + c);
      halves = {{a, b, bc, ad}, {ad, bc, c, d}};
    }
    cells_[k].corner = halves[0];
    evaluate(cells_[k]);
    Cell second;
    second.corner = halves[1];
    evaluate(second);
    cells_.push_back(second);
  }

  Vector3d normal_;
  const Polygon& source_;
  std::span<const BlockerOutline> blockers_;
  int order_;
  VisiblePart& work_;
  std::vector<Cell> cells_;
  int points_ = 0;
};

/// Planes in which an edge of one outline lines up with a corner of another one, and the planes of the blockers.
std::vector<Plane> event_planes(const Outline& source, const std::vector<Outline>& blockers, double extent) {
  std::vector<Plane> planes;
  const auto add = [&](const Vector3d& a, const Vector3d& b, const Vector3d& c) {
    const Vector3d normal = (b - a).cross(c - a);
    if (normal.norm() <= kFlat * extent * extent) return;
    planes.push_back({normal.normalized(), 0.0});
    planes.back().offset = planes.back().normal.dot(a);
  };
  const auto add_all = [&](const Outline& edges, const Outline& corners) {
    for (std::size_t k = 0; k < edges.size(); ++k) {
      for (const Vector3d& corner : corners) add(edges[k], edges[(k + 1) % edges.size()], corner);
    }
  };
  for (std::size_t k = 0; k < blockers.size(); ++k) {
    planes.push_back(plane_of(blockers[k]));
    add_all(blockers[k], source);
    add_all(source, blockers[k]);
    for (std::size_t other = 0; other < blockers.size() && blockers.size() <= 4; ++other) {
      if (other != k) add_all(blockers[k], blockers[other]);
    }
  }
  return planes;
}

std::vector<Outline> cut_at(const Outline& whole, const std::vector<Plane>& planes, double flat) {
  constexpr std::size_t kMostCells = 2000;  // beyond, refinement is cheaper than more cuts
  std::vector<Outline> cells = {whole};
  std::vector<Outline> next;
  for (const Plane& plane : planes) {
    if (cells.size() > kMostCells) break;
    next.clear();
    const Plane reversed{-plane.normal, -plane.offset};
    for (Outline& cell : cells) {
      Outline front = above(cell, plane, flat);
      Outline behind = above(cell, reversed, flat);
      if (front.empty() || behind.empty()) {
        next.push_back(std::move(cell));  // on one side, or within the plane
      } else {
        next.push_back(std::move(front));
        next.push_back(std::move(behind));
      }
    }
    cells.swap(next);
  }
  return cells;
}

void check_finite(const Polygon& polygon, const char* which) {
  for (int k = 0; k < polygon.corners; ++k) {
    const Vector3d& p = polygon.corner[static_cast<std::size_t>(k)];
    if (!p.allFinite()) {
      throw InvalidParams(fmt::format("form_factor: corner {} of {} is ({}, {}, {}); it must be finite.", k, which,
                                      p.x(), p.y(), p.z()));
    }
  }
}

}  // namespace

VisibleShare visible_share(const Polygon& outer, const Polygon& source, std::span<const BlockerOutline> blockers,
                           double tolerance, bool cut_events, VisiblePart& work) {
  const Outline source_outline = outline_of(source);
  const Outline outer_outline = outline_of(outer);
  const double extent = extent_of(outer_outline, source_outline);
  const double flat = kFlat * extent;
  const Plane outer_plane = plane_of(outer_outline);
  const Plane source_plane = plane_of(source_outline);
  const Outline facing = above(outer_outline, source_plane, flat);
  const Outline seen = above(source_outline, outer_plane, flat);
  if (facing.empty() || seen.empty()) return {1.0, 0.0, false};
  std::vector<Outline> between;
  for (const BlockerOutline& blocker : blockers) {
    Outline part(blocker.begin(), blocker.end());
    part = above(part, source_plane, flat);
    if (!part.empty()) part = above(part, outer_plane, flat);
    if (part.empty()) continue;
    // Lines from one patch to the other cross the blocker's plane only if the patches reach both sides of it.
    const Plane plane = plane_of(part);
    const auto side = [&](const Vector3d& p) { return plane.height(p) > flat ? 1 : plane.height(p) < -flat ? 2 : 0; };
    int outer_sides = 0;
    int source_sides = 0;
    for (const Vector3d& p : facing) outer_sides |= side(p);
    for (const Vector3d& p : seen) source_sides |= side(p);
    if ((outer_sides | source_sides) != 3) continue;
    if (covers(part, facing, seen, extent)) return {0.0, 0.0, false};
    between.push_back(std::move(part));
  }
  if (between.empty()) return {1.0, 0.0, false};
  std::vector<BlockerOutline> outlines(between.begin(), between.end());
  OuterRule rule(outer_outline, source, outlines, tolerance < 1e-5 ? 5 : 2, work);
  if (cut_events) {
    for (const Outline& cell : cut_at(facing, event_planes(seen, between, extent), flat)) rule.add(cell);
  } else {
    rule.add(facing);
  }
  return rule.refine(tolerance);
}

FormFactor form_factor(const Polygon& from, const Polygon& to, std::span<const Polygon> occluders, double tolerance) {
  check_finite(from, "the first polygon");
  check_finite(to, "the second polygon");
  for (const Polygon& occluder : occluders) check_finite(occluder, "an occluder");
  if (!(tolerance > 0.0)) {
    throw InvalidParams(fmt::format("form_factor: tolerance is {}; past occluders it must be positive.", tolerance));
  }
  FormFactor whole = form_factor(from, to, 0.1 * tolerance);
  if (whole.value <= 0.0) return whole;
  std::vector<BlockerOutline> outlines;
  for (const Polygon& occluder : occluders) {
    outlines.emplace_back(occluder.corner.data(), static_cast<std::size_t>(occluder.corners));
  }
  constexpr double kCutBelow = 2e-3;  // tighter tolerances repay cutting at the visibility events first
  VisiblePart work;
  const VisibleShare share =
      visible_share(from, to, outlines, 0.9 * tolerance / whole.value, tolerance < kCutBelow, work);
  if (!share.partial) {
    if (share.share > 0.0) return whole;
    return {0.0, 0.0, FormFactorMethod::kBlocked};
  }
  return {whole.value * share.share, whole.error_estimate + whole.value * share.error_estimate,
          FormFactorMethod::kOccluded};
}

}  // namespace interglow::radiosity
