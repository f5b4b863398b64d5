// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/form_factor.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "diagnostics/error.h"
#include "radiosity/contour_kernel.h"
#include "radiosity/horizon_clip.h"

namespace interglow::radiosity {
namespace {

using detail::ClippedPolygon;
using detail::Plane;
using Vector = Eigen::Matrix<long double, 3, 1>;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

void check_finite(const Polygon& polygon, const char* which) {
  for (int i = 0; i < polygon.corners; ++i)
    for (int axis = 0; axis < 3; ++axis)
      if (!std::isfinite(polygon.corner[i][axis]))
        throw InvalidParams(
            fmt::format("form factor: corner {} of the {} polygon has the coordinate {} on axis {}; "
                        "expected a finite number. Repair the mesh.",
                        i, which, polygon.corner[i][axis], axis));
}

/// The order that makes (a, b) and (b, a) the same computation.
bool comes_first(const Polygon& a, const Polygon& b) {
  if (a.corners != b.corners) return a.corners < b.corners;
  for (int i = 0; i < a.corners; ++i)
    for (int axis = 0; axis < 3; ++axis)
      if (a.corner[i][axis] != b.corner[i][axis]) return a.corner[i][axis] < b.corner[i][axis];
  return true;
}

/// Moved by `origin` and multiplied by a power of two; repeated corners dropped.
ClippedPolygon<long double> normalised(const Polygon& polygon, const Eigen::Vector3d& origin, int exponent) {
  ClippedPolygon<long double> moved;
  for (int i = 0; i < polygon.corners; ++i) {
    const Eigen::Vector3d& next = polygon.corner[i + 1 == polygon.corners ? 0 : i + 1];
    if (polygon.corner[i] == next) continue;
    Vector& corner = moved.corner[moved.corners++];
    for (int axis = 0; axis < 3; ++axis)
      corner[axis] = std::ldexp(static_cast<long double>(polygon.corner[i][axis]) - origin[axis], -exponent);
  }
  return moved;
}

ClippedPolygon<double> in_double(const ClippedPolygon<long double>& polygon) {
  ClippedPolygon<double> narrowed;
  narrowed.corners = polygon.corners;
  for (int i = 0; i < polygon.corners; ++i) narrowed.corner[i] = polygon.corner[i].cast<double>();
  return narrowed;
}

/// Coplanar convex polygons whose interiors meet (separating axes along the edges).
bool overlap(const ClippedPolygon<long double>& a, const ClippedPolygon<long double>& b, const Vector& normal) {
  const auto separated_by_edge_of = [&normal](const ClippedPolygon<long double>& from,
                                              const ClippedPolygon<long double>& other) {
    for (int i = 0; i < from.corners; ++i) {
      const Vector& start = from.corner[i];
      const Vector axis = (from.corner[(i + 1) % from.corners] - start).cross(normal);
      long double least_own = 0, most_own = 0;
      for (int k = 0; k < from.corners; ++k) {
        const long double s = axis.dot(from.corner[k] - start);
        least_own = std::min(least_own, s), most_own = std::max(most_own, s);
      }
      long double least = std::numeric_limits<long double>::infinity(), most = -least;
      for (int k = 0; k < other.corners; ++k) {
        const long double s = axis.dot(other.corner[k] - start);
        least = std::min(least, s), most = std::max(most, s);
      }
      const long double rounding = 16 * kEpsilon * axis.norm();
      if (least >= most_own - rounding || most <= least_own + rounding) return true;
    }
    return false;
  };
  return !separated_by_edge_of(a, b) && !separated_by_edge_of(b, a);
}

struct NormalisedPair {
  ClippedPolygon<long double> first, second;  ///< as given, in units of 2^exponent
  Plane<long double> first_plane, second_plane;
  int exponent = 0;
};

NormalisedPair normalise(const Polygon& a, const Polygon& b) {
  Eigen::Vector3d low = a.corner[0], high = low;
  for (const Polygon* polygon : {&a, &b})
    for (int i = 0; i < polygon->corners; ++i) {
      low = low.cwiseMin(polygon->corner[i]);
      high = high.cwiseMax(polygon->corner[i]);
    }
  // Half of each, so that coordinates near the largest double do not overflow.
  const double half_extent = (high / 2 - low / 2).maxCoeff();
  NormalisedPair pair;
  if (!(half_extent > 0)) return pair;
  pair.exponent = std::ilogb(half_extent) + 1;
  pair.first = normalised(a, a.corner[0], pair.exponent);
  pair.second = normalised(b, a.corner[0], pair.exponent);
  if (pair.first.corners >= 3) pair.first_plane = detail::plane_of(pair.first);
  if (pair.second.corners >= 3) pair.second_plane = detail::plane_of(pair.second);
  return pair;
}

/// No pair of patches of this turn exchanges more than this share of the smaller area: of the directions over a point's
/// horizon, those towards the front of the other plane lie between two planes, of which Lambert's cosine sees
/// (1 - cos) / 2 = |n - n'|² / 4. Corners off their plane count as a turn.
template <class Real>
Real most_by_turn(const Plane<Real>& first, const Plane<Real>& second) {
  const Real turn = (first.normal - second.normal).norm() +
                    4 * (first.deviation / first.thickness + second.deviation / second.thickness);
  return std::min(turn * turn / 4, Real(1));
}

/// A1 F12 in units of 4^exponent, `tolerance` in the same.
FormFactor normalised_exchange(const NormalisedPair& pair, double tolerance) {
  const long double least_area = std::min(pair.first_plane.area, pair.second_plane.area);
  if (!(least_area > 0)) return {};
  const ClippedPolygon<long double> first = detail::clip_to_front(pair.first, pair.second_plane);
  const ClippedPolygon<long double> second = detail::clip_to_front(pair.second, pair.first_plane);
  if (first.corners == 0 && second.corners == 0) {
    const bool face_to_face = pair.first_plane.normal.dot(pair.second_plane.normal) < -0.5L;
    const bool on_plane =
        detail::clip_to_front(
            pair.first, Plane<long double>{pair.second_plane.anchor, -pair.second_plane.normal, pair.second_plane.area,
                                           pair.second_plane.deviation, pair.second_plane.thickness})
            .corners == 0;
    if (face_to_face && on_plane && overlap(pair.first, pair.second, pair.first_plane.normal))
      return {0.0, static_cast<double>(least_area), FormFactorMethod::kUndefined};
    return {};
  }
  if (first.corners < 3 || second.corners < 3) return {};

  const double round_off = 1e-15 * static_cast<double>(least_area);
  const double wanted = std::max(tolerance, round_off);
  detail::ContourResult result = detail::contour_exchange_area(in_double(first), in_double(second), 0.45 * wanted);
  if (result.rounding > 0.5L * wanted)  // terms far larger than their sum: tiny, skinny or nearly coplanar polygons
    result = detail::contour_exchange_area(first, second, 0.45L * wanted);
  const long double most = least_area * most_by_turn(pair.first_plane, pair.second_plane);
  const double value = static_cast<double>(std::clamp(result.exchange_area, 0.0L, most));
  const double estimate = static_cast<double>(result.truncation + result.rounding) + kEpsilon * value;
  return {value, estimate, FormFactorMethod::kContourQuadrature};
}

FormFactor canonical_exchange(const Polygon& a, const Polygon& b, double tolerance, int& exponent,
                              long double& a_area) {
  check_finite(a, "first");
  check_finite(b, "second");
  if (a.corners < 3 || b.corners < 3) return {};
  const bool in_order = comes_first(a, b);
  const NormalisedPair pair = in_order ? normalise(a, b) : normalise(b, a);
  exponent = pair.exponent;
  a_area = in_order ? pair.first_plane.area : pair.second_plane.area;
  const double scaled = std::ldexp(tolerance, -2 * exponent);
  return normalised_exchange(pair, scaled);
}

}  // namespace

const char* name(FormFactorMethod method) {
  switch (method) {
    case FormFactorMethod::kZero:
      return "zero";
    case FormFactorMethod::kFarQuadrature:
      return "far-quadrature";
    case FormFactorMethod::kEdgeQuadrature:
      return "edge-quadrature";
    case FormFactorMethod::kContourQuadrature:
      return "contour";
    case FormFactorMethod::kClosedForm:
      return "closed-form";
    case FormFactorMethod::kPointArea:
      return "point-area";
    case FormFactorMethod::kOccluded:
      return "occluded";
    case FormFactorMethod::kBlocked:
      return "blocked";
    case FormFactorMethod::kUndefined:
      return "undefined";
  }
  return "unknown";
}

FormFactor exchange_area(const Polygon& a, const Polygon& b, double tolerance) {
  int exponent = 0;
  long double area = 0;
  FormFactor result = canonical_exchange(a, b, tolerance, exponent, area);
  result.value = std::ldexp(result.value, 2 * exponent);
  result.error_estimate = std::ldexp(result.error_estimate, 2 * exponent);
  return result;
}

FormFactor form_factor(const Polygon& from, const Polygon& to, double tolerance) {
  Eigen::Vector3d twice_area = Eigen::Vector3d::Zero();
  check_finite(from, "first");
  for (int i = 1; i + 1 < from.corners; ++i)
    twice_area += (from.corner[i] - from.corner[0]).cross(from.corner[i + 1] - from.corner[0]);
  const double from_area = twice_area.stableNorm() / 2;
  int exponent = 0;
  long double area = 0;
  FormFactor result = canonical_exchange(from, to, tolerance * from_area, exponent, area);
  if (!(area > 0)) return {};
  result.value = std::min(static_cast<double>(result.value / area), 1.0);
  result.error_estimate = std::min(static_cast<double>(result.error_estimate / area) + kEpsilon * result.value, 1.0);
  return result;
}

double point_form_factor(const Eigen::Vector3d& point, const Eigen::Vector3d& normal, const Polygon& to) {
  check_finite(to, "second");
  if (to.corners < 3) return 0.0;
  double size = 0;
  for (int i = 0; i < to.corners; ++i) size = std::max(size, (to.corner[i] / 2 - point / 2).lpNorm<Eigen::Infinity>());
  if (!(size > 0)) return 0.0;
  const ClippedPolygon<long double> moved = normalised(to, point, std::ilogb(size) + 1);
  if (moved.corners < 3) return 0.0;
  const Plane<long double> plane = detail::plane_of(moved);
  if (!(plane.area > 0)) return 0.0;
  const Vector origin = Vector::Zero();
  if (detail::side_of(plane, origin, plane.normal.dot(origin - plane.anchor)) <= 0) return 0.0;

  const Vector up = normal.cast<long double>();
  const Plane<long double> horizon{origin, up, 1, 0, 1};
  const ClippedPolygon<long double> seen = detail::clip_to_front(moved, horizon);
  long double sum = 0;
  for (int i = 0; i < seen.corners; ++i) {
    const Vector& corner = seen.corner[i];
    const Vector& next = seen.corner[i + 1 == seen.corners ? 0 : i + 1];
    const Vector edge = next - corner;
    const Vector across = corner.cross(edge);  // not corner × next: keeps the digits of a short edge far away
    const long double sine = across.norm();
    if (sine > 0) sum -= up.dot(across) / sine * std::atan2(sine, corner.dot(next));
  }
  return static_cast<double>(std::clamp(sum / (2 * std::numbers::pi_v<long double>), 0.0L, 1.0L));
}

}  // namespace interglow::radiosity
