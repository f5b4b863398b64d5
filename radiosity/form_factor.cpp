// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/form_factor.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <optional>
#include <type_traits>

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
  double sum = 0;
  for (int i = 0; i < polygon.corners; ++i) sum += 0 * polygon.corner[i].sum();
  if (sum == 0) return;  // else infinities or NaN, or a sum that overflowed
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

/// Without branches, which would be guessed wrong.
bool same(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return static_cast<bool>(int(a[0] == b[0]) & int(a[1] == b[1]) & int(a[2] == b[2]));
}

/// Moved by `origin` and multiplied by a power of two, each coordinate rounded once; repeated corners dropped.
template <class Real>
ClippedPolygon<Real> normalised(const Polygon& polygon, const Eigen::Vector3d& origin, Real scale) {
  ClippedPolygon<Real> moved;
  for (int i = 0; i < polygon.corners; ++i) {
    const Eigen::Vector3d& next = polygon.corner[i + 1 == polygon.corners ? 0 : i + 1];
    if (same(polygon.corner[i], next)) continue;
    moved.corner[moved.corners++] = scale * (polygon.corner[i].cast<Real>() - origin.cast<Real>());
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

/// Half the largest extent of both along an axis, so that coordinates near the largest double do not overflow.
double half_extent(const Polygon& a, const Polygon& b) {
  Eigen::Vector3d low = a.corner[0], high = low;
  for (const Polygon* polygon : {&a, &b})
    for (int i = 0; i < polygon->corners; ++i) {
      low = low.cwiseMin(polygon->corner[i]);
      high = high.cwiseMax(polygon->corner[i]);
    }
  return (high / 2 - low / 2).maxCoeff();
}

template <class Real>
Real power_of_two(int exponent) {
  if constexpr (std::is_same_v<Real, double>) {
    if (std::abs(exponent) < 1000) return std::bit_cast<double>(std::uint64_t(1023 + exponent) << 52);
  }
  return std::ldexp(Real(1), exponent);
}

template <class Real>
struct NormalisedPair {
  ClippedPolygon<Real> first, second;  ///< as given, from the first one's first corner, in units of 2^exponent
  Plane<Real> first_plane, second_plane;

  NormalisedPair(const Polygon& a, const Polygon& b, int exponent) {
    const Real scale = power_of_two<Real>(-exponent);
    first = normalised(a, a.corner[0], scale);
    second = normalised(b, a.corner[0], scale);
    if (first.corners >= 3) first_plane = detail::plane_of(first);
    if (second.corners >= 3) second_plane = detail::plane_of(second);
  }
};

/// No pair of patches of this turn exchanges more than this share of the smaller area: of the directions over a point's
/// horizon, those towards the front of the other plane lie between two planes, of which Lambert's cosine sees
/// (1 - cos) / 2 = |n - n'|² / 4. Corners off their plane count as a turn.
template <class Real>
Real most_by_turn(const Plane<Real>& first, const Plane<Real>& second) {
  const Real turn = (first.normal - second.normal).norm() +
                    4 * (first.deviation / first.thickness + second.deviation / second.thickness);
  return std::min(turn * turn / 4, Real(1));
}

double round_off(double least_area) { return 1e-15 * least_area; }

/// A1 F12 in units of 4^exponent, `tolerance` in the same; sides decided in extended precision.
FormFactor exchange_in_extended(const NormalisedPair<long double>& pair, double tolerance) {
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

  const double wanted = std::max(tolerance, round_off(static_cast<double>(least_area)));
  detail::ContourResult result = detail::contour_exchange_area(in_double(first), in_double(second), 0.45 * wanted);
  if (result.rounding > 0.5L * wanted)  // terms far larger than their sum: tiny, skinny or nearly coplanar polygons
    result = detail::contour_exchange_area(first, second, 0.45L * wanted);
  const long double most = least_area * most_by_turn(pair.first_plane, pair.second_plane);
  const double value = static_cast<double>(std::clamp(result.exchange_area, 0.0L, most));
  const double estimate = static_cast<double>(result.truncation + result.rounding) + kEpsilon * value;
  return {value, estimate, FormFactorMethod::kContourQuadrature};
}

/// The part in front of a plane as far as double precision can tell.
struct FrontPart {
  enum {
    kAll,
    kSome,
    kNone,
    kUndecided
  } part;                  ///< undecided: nothing lies clearly in front, and not all clearly behind
  double misplaced = 0.0;  ///< bound on the area that rounding puts on the wrong side
};

/// @param clipped  written where a part lies behind
FrontPart front_part(const ClippedPolygon<double>& polygon, double longest, const Plane<double>& plane,
                     ClippedPolygon<double>& clipped) {
  constexpr double kReach = 3.5;  // no two points of a normalised pair are farther apart
  const double open = 8 * kEpsilon * (1 + kReach * (1 + plane.longest() / plane.thickness)) +
                      2 * plane.deviation * (1 + 2 * kReach / plane.thickness);
  std::array<double, 8> distance;
  double highest = -kReach, lowest = kReach;
  for (int i = 0; i < polygon.corners; ++i) {
    distance[i] = plane.normal.dot(polygon.corner[i] - plane.anchor);
    highest = std::max(highest, distance[i]);
    lowest = std::min(lowest, distance[i]);
  }
  if (lowest > open) return {FrontPart::kAll};
  if (highest < -open) return {FrontPart::kNone};
  if (!(highest > open)) return {FrontPart::kUndecided};
  // Between the heights ±open lies a strip, at most this wide and as long as the polygon.
  const double width = 2 * open * longest / (highest - lowest);
  if (lowest >= -open) return {FrontPart::kAll, width * longest};
  std::array<int, 8> side;
  for (int i = 0; i < polygon.corners; ++i) side[i] = distance[i] > open ? 1 : distance[i] < -open ? -1 : 0;
  clipped = detail::clip_to_front(polygon, distance, side);
  return {clipped.corners < 3 ? FrontPart::kNone : FrontPart::kSome, width * longest};
}

/// The same in double throughout; nothing where that is not exact enough.
std::optional<FormFactor> exchange_in_double(const NormalisedPair<double>& pair, double tolerance) {
  const Plane<double>&first_plane = pair.first_plane, &second_plane = pair.second_plane;
  constexpr double kLeastThickness = 1e-5;  // over the length; the normals of thinner ones are uncertain
  for (const Plane<double>* plane : {&first_plane, &second_plane})
    if (!(plane->area > 0 && plane->thickness > kLeastThickness * plane->longest())) return {};
  ClippedPolygon<double> first_clipped, second_clipped;
  const FrontPart first = front_part(pair.first, first_plane.longest(), second_plane, first_clipped);
  const FrontPart second = front_part(pair.second, second_plane.longest(), first_plane, second_clipped);
  if (first.part == FrontPart::kUndecided || second.part == FrontPart::kUndecided) return {};
  if (first.part == FrontPart::kNone || second.part == FrontPart::kNone) return FormFactor{};

  const double least_area = std::min(first_plane.area, second_plane.area);
  const double wanted = std::max(tolerance, round_off(least_area));
  // Points see no more than 1 of what is on the wrong side.
  const double misplaced = first.misplaced + second.misplaced;
  if (misplaced > 0.04 * wanted) return {};
  const detail::ContourResult result =
      detail::contour_exchange_area(first.part == FrontPart::kAll ? pair.first : first_clipped,
                                    second.part == FrontPart::kAll ? pair.second : second_clipped, 0.45 * wanted);
  if (result.rounding > 0.5L * wanted) return {};
  const double uncertain =
      8 * kEpsilon * (first_plane.longest() / first_plane.thickness + second_plane.longest() / second_plane.thickness);
  const double most = least_area * std::min(1.0, most_by_turn(first_plane, second_plane) + uncertain * uncertain);
  const double value = std::clamp(static_cast<double>(result.exchange_area), 0.0, most);
  const double estimate = static_cast<double>(result.truncation + result.rounding) + misplaced + kEpsilon * value;
  return FormFactor{value, estimate, FormFactorMethod::kContourQuadrature};
}

/// Of the power of two past the extent of both; nothing where that is 0.
std::optional<int> common_exponent(const Polygon& a, const Polygon& b) {
  const double half = half_extent(a, b);
  if (!(half > 0)) return {};
  const int exponent = static_cast<int>(std::bit_cast<std::uint64_t>(half) >> 52);
  return (exponent > 0 ? exponent - 1023 : std::ilogb(half)) + 1;
}

/// A1 F12 in units of 4^exponent, `tolerance` in the same.
FormFactor normalised_exchange(const Polygon& a, const Polygon& b, int exponent, double tolerance) {
  const bool in_order = comes_first(a, b);
  const Polygon &first = in_order ? a : b, &second = in_order ? b : a;
  if (std::abs(exponent) < 500)  // nothing near the ends of the range of double
    if (const auto found = exchange_in_double(NormalisedPair<double>(first, second, exponent), tolerance))
      return *found;
  return exchange_in_extended(NormalisedPair<long double>(first, second, exponent), tolerance);
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
  check_finite(a, "first");
  check_finite(b, "second");
  if (a.corners < 3 || b.corners < 3) return {};
  const std::optional<int> exponent = common_exponent(a, b);
  if (!exponent) return {};
  const auto scaled = [](double x, int by) {
    return std::abs(by) < 900 ? x * power_of_two<double>(by) : std::ldexp(x, by);
  };
  FormFactor result = normalised_exchange(a, b, *exponent, scaled(tolerance, -2 * *exponent));
  result.value = scaled(result.value, 2 * *exponent);
  result.error_estimate = scaled(result.error_estimate, 2 * *exponent);
  return result;
}

FormFactor form_factor(const Polygon& from, const Polygon& to, double tolerance) {
  check_finite(from, "first");
  check_finite(to, "second");
  if (from.corners < 3 || to.corners < 3) return {};
  const std::optional<int> exponent = common_exponent(from, to);
  if (!exponent) return {};
  const auto moved = normalised(from, from.corner[0], std::ldexp(1.0L, -*exponent));
  const long double area = moved.corners < 3 ? 0.0L : detail::plane_of(moved).area;
  if (!(area > 0)) return {};
  FormFactor result = normalised_exchange(from, to, *exponent, tolerance * static_cast<double>(area));
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
  const ClippedPolygon<long double> moved = normalised(to, point, std::ldexp(1.0L, -std::ilogb(size) - 1));
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
