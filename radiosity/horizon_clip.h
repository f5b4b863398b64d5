// SPDX-License-Identifier: GPL-3.0-or-later
/// Cutting convex polygons at the plane of another: only what lies in front of both planes exchanges light.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <limits>

namespace interglow::radiosity::detail {

/// A planar convex polygon in working precision; a quad clipped by a plane has at most five corners.
template <class Real>
struct ClippedPolygon {
  using Vector = Eigen::Matrix<Real, 3, 1>;
  std::array<Vector, 8> corner;
  int corners = 0;
};

/// {x : normal·(x - anchor) = 0}, with what the plane's own polygon leaves open about it.
template <class Real>
struct Plane {
  using Vector = Eigen::Matrix<Real, 3, 1>;
  Vector anchor;  ///< centroid of the corners
  Vector normal;  ///< unit, towards the front
  Real area = 0;
  Real deviation = 0;  ///< farthest corner off the plane (rounded coordinates of a quad)
  Real thickness = 0;  ///< least width of the polygon, by which `deviation` is levered outwards

  Real longest() const { return 2 * area / thickness; }  ///< between two corners
};

template <class Real>
Plane<Real> plane_of(const ClippedPolygon<Real>& polygon) {
  using Vector = Eigen::Matrix<Real, 3, 1>;
  Plane<Real> plane;
  Vector twice_area = Vector::Zero(), sum = Vector::Zero();
  const Vector& origin = polygon.corner[0];
  Real longest_square = 0;
  for (int i = 1; i < polygon.corners; ++i) {
    const Vector side = polygon.corner[i] - origin;
    sum += side;
    longest_square = std::max(longest_square, side.squaredNorm());
    if (i + 1 < polygon.corners) twice_area += side.cross(polygon.corner[i + 1] - origin);
    for (int j = 1; j < i; ++j)
      longest_square = std::max(longest_square, (polygon.corner[i] - polygon.corner[j]).squaredNorm());
  }
  plane.anchor = origin + sum * (1 / Real(polygon.corners));
  const Real norm = twice_area.norm();
  // Collinear corners leave an area of rounding errors only.
  if (!(norm > Real(16) * std::numeric_limits<double>::epsilon() * longest_square)) return plane;
  plane.normal = twice_area * (1 / norm);
  plane.area = norm / 2;
  plane.thickness = norm / std::sqrt(longest_square);
  if (polygon.corners > 3)
    for (int i = 0; i < polygon.corners; ++i)
      plane.deviation = std::max(plane.deviation, std::abs(plane.normal.dot(polygon.corner[i] - plane.anchor)));
  return plane;
}

/// -1 behind, 0 on the plane within rounding, +1 in front. Shared corners and edges count as on the plane.
template <class Real>
int side_of(const Plane<Real>& plane, const Eigen::Matrix<Real, 3, 1>& point, Real distance) {
  const Real reach = (point - plane.anchor).norm();
  const Real open = Real(8) * std::numeric_limits<Real>::epsilon() * (1 + reach) +
                    2 * plane.deviation * (1 + 2 * reach / plane.thickness);
  return distance > open ? 1 : distance < -open ? -1 : 0;
}

/// The part of `polygon` in front of `plane`; no corners if nothing lies in front.
/// @param distance  of each corner
/// @param side  of each corner: -1, 0 or 1
template <class Real>
ClippedPolygon<Real> clip_to_front(const ClippedPolygon<Real>& polygon, const std::array<Real, 8>& distance,
                                   const std::array<int, 8>& side) {
  bool any_front = false, any_behind = false;
  for (int i = 0; i < polygon.corners; ++i) {
    any_front = any_front || side[i] > 0;
    any_behind = any_behind || side[i] < 0;
  }
  ClippedPolygon<Real> kept;
  if (!any_front) return kept;
  if (!any_behind) return polygon;
  for (int i = 0; i < polygon.corners; ++i) {
    const int next = i + 1 == polygon.corners ? 0 : i + 1;
    if (side[i] >= 0) kept.corner[kept.corners++] = polygon.corner[i];
    if (side[i] * side[next] < 0) {
      const Real share = distance[i] / (distance[i] - distance[next]);
      kept.corner[kept.corners++] = polygon.corner[i] + share * (polygon.corner[next] - polygon.corner[i]);
    }
  }
  return kept;
}

template <class Real>
ClippedPolygon<Real> clip_to_front(const ClippedPolygon<Real>& polygon, const Plane<Real>& plane) {
  std::array<Real, 8> distance;
  std::array<int, 8> side;
  for (int i = 0; i < polygon.corners; ++i) {
    distance[i] = plane.normal.dot(polygon.corner[i] - plane.anchor);
    side[i] = side_of(plane, polygon.corner[i], distance[i]);
  }
  return clip_to_front(polygon, distance, side);
}

}  // namespace interglow::radiosity::detail
