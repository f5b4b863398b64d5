// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/polygon_parts.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>

#include "diagnostics/error.h"

namespace interglow::radiosity {
namespace {

using Eigen::Vector3d;

/// Twice the area of the triangle, positive if it turns left around `normal`.
double turn(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& normal) {
  return normal.dot((b - a).cross(c - a));
}

bool inside(const Vector3d& point, const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& normal) {
  return turn(a, b, point, normal) >= 0 && turn(b, c, point, normal) >= 0 && turn(c, a, point, normal) >= 0;
}

/// The outline's vector area, its corners seen from the first one.
Vector3d vector_area(std::span<const Vector3d> outline) {
  Vector3d sum = Vector3d::Zero();
  for (std::size_t i = 1; i + 1 < outline.size(); ++i)
    sum += (outline[i] - outline[0]).cross(outline[i + 1] - outline[0]) / 2;
  return sum;
}

}  // namespace

std::vector<Polygon> convex_parts(std::span<const Vector3d> outline) {
  if (outline.size() < 3)
    throw InvalidParams(fmt::format("the polygon has {} corners, expected at least 3.", outline.size()));
  double size = 0;
  for (std::size_t i = 0; i < outline.size(); ++i) {
    if (!outline[i].allFinite()) throw InvalidParams(fmt::format("corner {} of the polygon is not finite.", i));
    size = std::max(size, (outline[i] - outline[0]).norm());
  }
  const Vector3d area = vector_area(outline);
  const bool flat = area.norm() > 1e-15 * size * size;
  const Vector3d normal = flat ? Vector3d(area.normalized()) : Vector3d(Vector3d::Zero());
  for (std::size_t i = 0; flat && i < outline.size(); ++i) {
    const double off = std::abs(normal.dot(outline[i] - outline[0]));
    if (outline.size() > 3 && off > 1e-6 * size)
      throw InvalidParams(
          fmt::format("corner {} of the polygon lies {} off the plane of the others, expected at most 1e-6 of its "
                      "size {}. Split it into triangles.",
                      i, off, size));
  }

  const double rounding = 1e-15 * size * size;
  std::vector<Vector3d> rest(outline.begin(), outline.end());
  const auto corner = [&rest](std::size_t i) -> const Vector3d& { return rest[i % rest.size()]; };
  bool convex = true;
  for (std::size_t i = 0; i < rest.size(); ++i)
    convex = convex && turn(corner(i), corner(i + 1), corner(i + 2), normal) >= -rounding;

  std::vector<Polygon> parts;
  if (rest.size() <= 4 && (convex || !flat)) {
    Polygon whole;
    for (const Vector3d& point : rest) whole.corner[whole.corners++] = point;
    return {whole};
  }
  while (rest.size() > 3) {
    // Of all ears the fattest: thin ones leave thin triangles for later.
    std::size_t best = rest.size();
    double best_shape = -1;
    for (std::size_t i = 0; i < rest.size(); ++i) {
      const Vector3d &a = corner(i), &b = corner(i + 1), &c = corner(i + 2);
      const double twice_area = turn(a, b, c, normal);
      if (twice_area < -rounding) continue;
      bool empty = true;
      for (std::size_t k = i + 3; empty && k < i + rest.size(); ++k) {
        const Vector3d& other = corner(k);
        empty = twice_area <= rounding || other == a || other == b || other == c || !inside(other, a, b, c, normal);
      }
      if (!empty) continue;
      const double longest = std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
      const double shape = longest > 0 ? std::max(twice_area, 0.0) / longest : 0;
      if (shape > best_shape) best_shape = shape, best = i;
    }
    if (best == rest.size()) throw InvalidParams("the polygon's outline crosses itself; expected a simple outline.");
    if (best_shape > 0) parts.push_back({{corner(best), corner(best + 1), corner(best + 2), Vector3d::Zero()}, 3});
    rest.erase(rest.begin() + static_cast<std::ptrdiff_t>((best + 1) % rest.size()));
  }
  parts.push_back({{rest[0], rest[1], rest[2], Vector3d::Zero()}, 3});
  double covered = 0;
  for (const Polygon& part : parts) covered += turn(part.corner[0], part.corner[1], part.corner[2], normal) / 2;
  if (std::abs(covered - area.norm()) > 1e-9 * size * size)
    throw InvalidParams("the polygon's outline crosses itself; expected a simple outline.");
  return parts;
}

}  // namespace interglow::radiosity
