// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/contact.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <set>
#include <utility>

#include "mesh/half_edges.h"
#include "mesh/surface_index.h"

namespace interglow::mesh {
namespace {

using Eigen::Vector3d;

constexpr double kInwards_mm = 1.5;  ///< how far behind a border a contact line is looked for
constexpr int kSmallestRun = 8;      ///< border points; shorter contacts are left to chance
constexpr int kGap = 10;             ///< border points without a contact between two with one
constexpr double kSmoothing = 8;     ///< border points; standard deviation of the smoothing along the border

using Loop = std::vector<int>;

/// The border as closed loops of points, each in the direction of its edges.
std::vector<Loop> border_loops(const FittedSurface& surface) {
  std::vector<int> next(surface.points.size(), -1);
  for (const auto& [a, b] : surface.borders) next[a] = b;
  std::vector<Loop> loops;
  for (const auto& [start, unused] : surface.borders) {
    Loop loop;
    for (int v = start; v >= 0 && next[v] >= 0;) {
      loop.push_back(v);
      v = std::exchange(next[v], -1);
    }
    if (loop.size() >= 3) loops.push_back(std::move(loop));
  }
  return loops;
}

/// One of the quadrics at each point.
std::vector<int> quadric_at(const FittedSurface& surface) {
  std::vector<int> quadric(surface.points.size(), -1);
  for (std::size_t t = 0; t < surface.triangles.size(); ++t)
    for (int k = 0; k < 3; ++k) quadric[surface.triangles[t][k]] = surface.quadric_of[t][k];
  return quadric;
}

/// Height of `x` over the surface or its continuation, and the normal there.
std::pair<double, Vector3d> height_over(const FittedSurface& surface, const SurfaceIndex& index, const Vector3d& x) {
  const SurfacePoint on = index.closest(x);
  Vector3d normal = Vector3d::Zero();
  double height = 0;
  for (int k = 0; k < 3; ++k) {
    const auto [p, n] = surface.quadrics[surface.quadric_of[on.triangle][k]].at(x);
    height += on.barycentric[k] * (x - p).dot(n);
    normal += on.barycentric[k] * n;
  }
  return {height, normal.normalized()};
}

/// The contact with `other` on the quadric `q` outwards from the border point `p`, if there is one.
std::optional<Vector3d> contact_point(const LocalQuadric& q, const Vector3d& p, const Vector3d& outwards, double reach,
                                      const FittedSurface& other, const SurfaceIndex& other_index, double noise) {
  constexpr double kStep = 0.1;  // mm; the gap is smooth
  struct Sample {
    double s, gap, cosine;
    Vector3d x, normal;
  };
  std::vector<Sample> samples;
  for (double s = -kInwards_mm; s <= reach + kInwards_mm; s += kStep) {
    const auto [x, own_normal] = q.at(p + s * outwards);
    const auto [gap, normal] = height_over(other, other_index, x);
    samples.push_back({s, gap, own_normal.dot(normal), x, normal});
  }
  const double facing = samples[samples.size() / 2].cosine;
  if (facing > 0.7) return std::nullopt;  // side by side, not face to face
  if (facing > -0.7) {                    // they meet at an angle
    for (std::size_t i = 1; i < samples.size(); ++i) {
      const Sample &a = samples[i - 1], &b = samples[i];
      if (!(a.gap > 0 && b.gap <= 0) || b.s > reach + kStep) continue;
      const double share = a.gap / (a.gap - b.gap);
      return a.x + share * (b.x - a.x);
    }
    return std::nullopt;
  }
  // They face each other: the minimum of the parabola through the gap.
  Eigen::Matrix3d normal_matrix = Eigen::Matrix3d::Zero();
  Vector3d right = Vector3d::Zero();
  for (const Sample& sample : samples) {
    const Vector3d row(1, sample.s, sample.s * sample.s);
    normal_matrix += row * row.transpose();
    right += sample.gap * row;
  }
  const Vector3d c = normal_matrix.ldlt().solve(right);
  if (!(c[2] > 0)) return std::nullopt;
  const double at = -c[1] / (2 * c[2]), least = c[0] + c[1] * at / 2;
  if (at < -kInwards_mm || at > reach || std::abs(least) > std::max(0.05, 3 * noise)) return std::nullopt;
  const Vector3d x = q.at(p + at * outwards).first;
  const auto [gap, normal] = height_over(other, other_index, x);
  return x - gap / 2 * normal;
}

/// Local lines through the points near each point, weighted along the sequence: smooth, and without shrinking at the
/// ends.
std::vector<Vector3d> smoothed(const std::vector<Vector3d>& line) {
  std::vector<Vector3d> result(line.size());
  const int reach = static_cast<int>(3 * kSmoothing);
  for (int i = 0; i < static_cast<int>(line.size()); ++i) {
    double w0 = 0, w1 = 0, w2 = 0;
    Vector3d m0 = Vector3d::Zero(), m1 = Vector3d::Zero();
    for (int k = std::max(0, i - reach); k <= std::min(static_cast<int>(line.size()) - 1, i + reach); ++k) {
      const double d = k - i, w = std::exp(-d * d / (2 * kSmoothing * kSmoothing));
      w0 += w, w1 += w * d, w2 += w * d * d;
      m0 += w * line[k], m1 += w * d * line[k];
    }
    result[i] = (w2 * m0 - w1 * m1) / (w0 * w2 - w1 * w1);
  }
  return result;
}

std::vector<Vector3d> resampled(const std::vector<Vector3d>& line, double spacing) {
  double length = 0;
  for (std::size_t i = 1; i < line.size(); ++i) length += (line[i] - line[i - 1]).norm();
  const int pieces = std::max(2, static_cast<int>(std::lround(length / spacing)));
  std::vector<Vector3d> result{line.front()};
  double travelled = 0;
  for (std::size_t i = 1; i < line.size(); ++i) {
    const double step = (line[i] - line[i - 1]).norm();
    while (static_cast<int>(result.size()) < pieces &&
           travelled + step >= length * static_cast<double>(result.size()) / pieces) {
      const double share = (length * static_cast<double>(result.size()) / pieces - travelled) / step;
      result.push_back(line[i - 1] + share * (line[i] - line[i - 1]));
    }
    travelled += step;
  }
  result.push_back(line.back());
  return result;
}

/// Cuts the ends of a line that reach beyond the points of the surface whose contact it is.
void cut_ends(std::vector<Vector3d>& line, const FittedSurface& surface) {
  constexpr double kNear_mm = 4;
  for (int end = 0; end < 2; ++end) {
    std::reverse(line.begin(), line.end());
    const Vector3d tip = line.back();
    const Vector3d direction = (tip - line[line.size() > 6 ? line.size() - 6 : 0]).normalized();
    double limit = -std::numeric_limits<double>::infinity();
    for (const Vector3d& p : surface.points)
      if ((p - tip).squaredNorm() < kNear_mm * kNear_mm) limit = std::max(limit, p.dot(direction));
    while (line.size() > 2 && line[line.size() - 2].dot(direction) >= limit) line.pop_back();
    const Vector3d inner = line[line.size() - 2];
    const double over = line.back().dot(direction) - limit, rise = (line.back() - inner).dot(direction);
    if (over > 0 && over < rise) line.back() -= over / rise * (line.back() - inner);
  }
}

/// Contact lines that the borders of `own` have with `other`.
std::vector<std::vector<Vector3d>> contact_lines(const FittedSurface& own, const FittedSurface& other,
                                                 const SurfaceIndex& other_index, double reach, double spacing) {
  std::vector<std::vector<Vector3d>> lines;
  const std::vector<int> quadric = quadric_at(own);
  const double noise = std::hypot(own.noise_sigma_mm, other.noise_sigma_mm);
  for (const Loop& loop : border_loops(own)) {
    const int size = static_cast<int>(loop.size());
    std::vector<std::optional<Vector3d>> found(size);
    int count = 0;
    for (int i = 0; i < size; ++i) {
      const Vector3d& p = own.points[loop[i]];
      if ((other_index.closest(p).point - p).norm() > 2 * reach + 2 * own.mean_edge_mm) continue;
      // Over several points, or a ragged border would send every point another way.
      const int window = std::min(8, size / 4);
      const Vector3d along = own.points[loop[(i + window) % size]] - own.points[loop[(i + size - window) % size]];
      const LocalQuadric& q = own.quadrics[quadric[loop[i]]];
      const Vector3d outwards = along.cross(q.at(p).second).normalized();
      found[i] = contact_point(q, p, outwards, reach, other, other_index, noise);
      count += found[i].has_value();
    }
    if (count < kSmallestRun) continue;
    // Runs around the loop, begun behind a stretch without contact.
    int begin = 0, empty = 0;
    for (int i = 0; i < 2 * size && empty <= kGap; ++i) {
      empty = found[i % size] ? 0 : empty + 1;
      begin = (i + 1) % size;
    }
    std::vector<Vector3d> run;
    empty = 0;
    for (int i = 0; i <= size; ++i) {
      const std::optional<Vector3d>& c = found[(begin + i) % size];
      if (i < size && c) {
        run.push_back(*c);
        empty = 0;
      } else if (i == size || ++empty > kGap) {
        if (static_cast<int>(run.size()) >= kSmallestRun) {
          const std::vector<Vector3d> line = smoothed(smoothed(run));
          std::vector<Vector3d> forward{line.front()};
          const Vector3d end = line.back();
          for (std::size_t k = 1; k + 1 < line.size(); ++k) {
            const std::size_t far = std::min(line.size() - 1, k + 8), near = k > 8 ? k - 8 : 0;
            const Vector3d direction = (line[far] - line[near]).normalized();
            if ((line[k] - forward.back()).dot(direction) > 0.05 * spacing && (end - line[k]).dot(direction) > 0)
              forward.push_back(line[k]);
          }
          forward.push_back(end);
          if (forward.size() > 2) cut_ends(forward, own);
          double length = 0;
          for (std::size_t k = 1; k < forward.size(); ++k) length += (forward[k] - forward[k - 1]).norm();
          if (length > 4 * spacing) lines.push_back(resampled(forward, spacing));
        }
        run.clear();
      }
    }
  }
  return lines;
}

/// Nearest point of a polyline.
struct OnLine {
  double parameter = 0;  ///< index of the point before it plus a share
  Vector3d point, direction;
  double distance = std::numeric_limits<double>::infinity();
};

OnLine nearest_on(const std::vector<Vector3d>& line, const Vector3d& x) {
  OnLine best;
  for (std::size_t i = 0; i + 1 < line.size(); ++i) {
    const Vector3d d = line[i + 1] - line[i];
    const double share = std::clamp((x - line[i]).dot(d) / d.squaredNorm(), 0.0, 1.0);
    const Vector3d p = line[i] + share * d;
    const double distance = (x - p).norm();
    if (distance < best.distance) best = {static_cast<double>(i) + share, p, d.normalized(), distance};
  }
  return best;
}

/// Trims the surface to the line and joins it by a strip. @return false, with the surface unchanged, if no border runs
/// along it
bool join(ContactSurface& side, const std::vector<Vector3d>& line, double reach) {
  FittedSurface& surface = *side.surface;
  const double edge = surface.mean_edge_mm;
  const double last = static_cast<double>(line.size()) - 1;
  const double far = reach + kInwards_mm + 2 * edge;
  Eigen::AlignedBox3d box;
  for (const Vector3d& c : line) box.extend(c);
  box.min().array() -= far;
  box.max().array() += far;

  const std::vector<int> quadric = quadric_at(surface);
  std::vector<OnLine> nearest(surface.points.size());
  std::vector<double> beyond(surface.points.size(), 0);
  double balance = 0;
  for (std::size_t i = 0; i < surface.points.size(); ++i) {
    if (quadric[i] < 0 || !box.contains(surface.points[i])) continue;
    nearest[i] = nearest_on(line, surface.points[i]);
    if (nearest[i].distance > far) continue;
    const Vector3d normal = surface.quadrics[quadric[i]].at(surface.points[i]).second;
    beyond[i] = (surface.points[i] - nearest[i].point).dot(nearest[i].direction.cross(normal));
    balance += beyond[i];
  }
  if (balance > 0)
    for (double& b : beyond) b = -b;  // the body lies on the negative side

  FittedSurface trimmed = surface;
  trimmed.triangles.clear();
  trimmed.quadric_of.clear();
  for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
    const auto& corners = surface.triangles[t];
    const bool goes = std::any_of(corners.begin(), corners.end(),
                                  [&](int v) { return nearest[v].distance <= far && beyond[v] > -0.3 * edge; });
    if (goes) continue;
    trimmed.triangles.push_back(corners);
    trimmed.quadric_of.push_back(surface.quadric_of[t]);
  }
  if (trimmed.triangles.empty()) return false;
  TriangleMesh fans = separate_fans({trimmed.points, trimmed.triangles});
  trimmed.points = std::move(fans.points);
  trimmed.triangles = std::move(fans.triangles);
  find_curves(trimmed);

  // The longest stretch of border along the line.
  std::vector<int> best;
  for (const Loop& loop : border_loops(trimmed)) {
    const int size = static_cast<int>(loop.size());
    std::vector<char> along(size);
    for (int i = 0; i < size; ++i) {
      const OnLine on = nearest_on(line, trimmed.points[loop[i]]);
      along[i] = on.distance <= far && on.parameter > 0 && on.parameter < last;
    }
    const auto gap = std::find(along.begin(), along.end(), 0);
    if (gap == along.end()) continue;
    const int begin = static_cast<int>(gap - along.begin());
    std::vector<int> run;
    for (int i = 1; i <= size; ++i) {
      if (along[(begin + i) % size]) {
        run.push_back(loop[(begin + i) % size]);
      } else {
        if (run.size() > best.size()) best = run;
        run.clear();
      }
    }
  }
  if (best.size() < 4) return false;
  // A stretch that covers a part of the line only (a hole beside it) would leave the rest open.
  const auto parameter = [&](int v) { return nearest_on(line, trimmed.points[v]).parameter; };
  if (std::abs(parameter(best.back()) - parameter(best.front())) < 0.6 * last) return false;

  const bool reversed = parameter(best.back()) < parameter(best.front());
  const int count = static_cast<int>(line.size());
  const int first = static_cast<int>(trimmed.points.size());
  const std::vector<int> own_quadric = quadric_at(trimmed);
  std::vector<int> line_quadric(count);
  for (int j = 0; j < count; ++j) {
    const Vector3d& c = line[reversed ? count - 1 - j : j];
    trimmed.points.push_back(c);
    const int nearest_border = *std::min_element(best.begin(), best.end(), [&](int a, int b) {
      return (trimmed.points[a] - c).squaredNorm() < (trimmed.points[b] - c).squaredNorm();
    });
    // The same bending, shifted to pass through the contact point.
    LocalQuadric q = trimmed.quadrics[own_quadric[nearest_border]];
    const Vector3d normal = q.at(c).second;
    q.u = (q.u - q.u.dot(normal) * normal).normalized();
    q.normal = normal;
    q.v = normal.cross(q.u);
    q.origin = c;
    q.c[0] = q.c[1] = q.c[2] = 0;
    line_quadric[j] = static_cast<int>(trimmed.quadrics.size());
    trimmed.quadrics.push_back(q);
  }
  // The strip: both sides advance at the same pace along the line, however ragged the border is.
  const int border_last = static_cast<int>(best.size()) - 1;
  std::vector<double> pace;
  for (int v : best) {
    const double here = reversed ? last - parameter(v) : parameter(v);
    pace.push_back(pace.empty() ? here : std::max(here, pace.back()));
  }
  for (int i = 0, j = 0; i < border_last || j < count - 1;) {
    const bool along_border = j == count - 1 || (i < border_last && pace[i + 1] <= j + 0.5);
    if (along_border) {
      trimmed.triangles.push_back({best[i + 1], best[i], first + j});
      trimmed.quadric_of.push_back({own_quadric[best[i + 1]], own_quadric[best[i]], line_quadric[j]});
      ++i;
    } else {
      trimmed.triangles.push_back({best[i], first + j, first + j + 1});
      trimmed.quadric_of.push_back({own_quadric[best[i]], line_quadric[j], line_quadric[j + 1]});
      ++j;
    }
  }
  find_curves(trimmed);
  for (std::size_t i = 1; i < line.size(); ++i) side.closed_mm += (line[i] - line[i - 1]).norm();
  surface = std::move(trimmed);
  return true;
}

}  // namespace

void close_contacts(std::vector<ContactSurface>& surfaces) {
  // Found again by their coordinates, since joining renumbers points.
  const auto coordinates = [](const Vector3d& p) { return std::array<double, 3>{p.x(), p.y(), p.z()}; };
  std::vector<std::set<std::array<double, 3>>> on_lines(surfaces.size());
  const auto add_points = [&](std::size_t i, const std::vector<Vector3d>& line) {
    for (const Vector3d& p : line) on_lines[i].insert(coordinates(p));
  };
  for (std::size_t a = 0; a < surfaces.size(); ++a)
    for (std::size_t b = 0; b < surfaces.size(); ++b) {
      ContactSurface &own = surfaces[a], &other = surfaces[b];
      if (a == b || own.reach_mm <= 0) continue;
      // The second of two that are both continued was joined when the first was.
      if (b < a && other.reach_mm > 0) continue;
      const SurfaceIndex index(other.surface->points, other.surface->triangles);
      const double spacing = other.reach_mm > 0 ? (own.spacing_mm + other.spacing_mm) / 2 : own.spacing_mm;
      for (const auto& line : contact_lines(*own.surface, *other.surface, index, own.reach_mm, spacing)) {
        if (join(own, line, own.reach_mm)) add_points(a, line);
        if (other.reach_mm > 0 && join(other, line, other.reach_mm)) add_points(b, line);
      }
    }
  for (std::size_t i = 0; i < surfaces.size(); ++i)
    for (std::size_t v = 0; v < surfaces[i].surface->points.size(); ++v)
      if (on_lines[i].contains(coordinates(surfaces[i].surface->points[v])))
        surfaces[i].locked_points.push_back(static_cast<int>(v));
}

}  // namespace interglow::mesh
