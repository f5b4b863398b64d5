// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/coverage.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "radiosity/beam_view.h"
#include "radiosity/direct_light.h"

namespace interglow::fitting {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr std::size_t kChunk = 64;
/// Triangles lit to all but this share of their area count as wholly lit: what is left is rounding along edges.
constexpr double kRounding = 1e-9;

/// Corners of an outline nearer than this are one [px]: the direction of the edge between them is rounding.
constexpr double kPoint = 1e-8;

double cross(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

double area_of(const Outline& outline) {
  double twice = 0.0;
  for (std::size_t k = 2; k < outline.size(); ++k) twice += cross(outline[k - 1] - outline[0], outline[k] - outline[0]);
  return 0.5 * twice;
}

/// Cuts at p[axis] = limit into what lies below and above.
void split_at(const Outline& outline, int axis, double limit, Outline& below, Outline& above) {
  below.clear();
  above.clear();
  for (std::size_t k = 0; k < outline.size(); ++k) {
    const Vector2d& a = outline[k];
    const Vector2d& b = outline[k + 1 == outline.size() ? 0 : k + 1];
    const double da = a[axis] - limit;
    const double db = b[axis] - limit;
    if (da <= 0.0) below.push_back(a);
    if (da >= 0.0) above.push_back(a);
    if ((da < 0.0 && db > 0.0) || (da > 0.0 && db < 0.0)) {
      Vector2d crossing = a + da / (da - db) * (b - a);
      crossing[axis] = limit;
      below.push_back(crossing);
      above.push_back(crossing);
    }
  }
  if (below.size() < 3) below.clear();
  if (above.size() < 3) above.clear();
}

/// Calls visit(row, column, outline) for the parts of a convex outline in the pixels of a picture.
template <class Visit>
void for_each_pixel(const Outline& outline, int width, int height, const Visit& visit) {
  const auto range = [](const Outline& of, int axis) {
    double low = of[0][axis];
    double high = low;
    for (const Vector2d& p : of) {
      low = std::min(low, p[axis]);
      high = std::max(high, p[axis]);
    }
    return std::pair(low, high);
  };
  thread_local Outline rest, strip, next, cell, after;
  const auto cut = [](Outline& from, int axis, double limit, Outline& part, Outline& remainder) {
    split_at(from, axis, limit, part, remainder);
    from.swap(remainder);
  };
  rest = outline;
  auto [low, high] = range(rest, 1);
  if (high <= 0.0 || low >= height) return;
  if (low < 0.0) cut(rest, 1, 0.0, strip, next);
  const int last_row = std::min(height - 1, static_cast<int>(std::floor(high)));
  for (int row = std::max(0, static_cast<int>(std::floor(low))); row <= last_row && !rest.empty(); ++row) {
    if (high > row + 1) {
      cut(rest, 1, row + 1.0, strip, next);
    } else {
      strip.swap(rest);
      rest.clear();
    }
    if (strip.empty()) continue;
    auto [left, right] = range(strip, 0);
    if (right <= 0.0 || left >= width) continue;
    if (left < 0.0) cut(strip, 0, 0.0, cell, after);
    const int last_column = std::min(width - 1, static_cast<int>(std::floor(right)));
    for (int column = std::max(0, static_cast<int>(std::floor(left))); column <= last_column && !strip.empty();
         ++column) {
      if (right > column + 1) {
        cut(strip, 0, column + 1.0, cell, after);
      } else {
        cell.swap(strip);
        strip.clear();
      }
      if (!cell.empty()) visit(row, column, cell);
    }
  }
}

/// What two convex outlines share.
Outline intersection(const Outline& a, const Outline& b) {
  Outline kept = a;
  Outline next;
  for (std::size_t e = 0; e < b.size() && kept.size() >= 3; ++e) {
    const Vector2d& from = b[e];
    const Vector2d edge = b[e + 1 == b.size() ? 0 : e + 1] - from;
    if (edge.squaredNorm() < kPoint * kPoint) continue;
    next.clear();
    for (std::size_t k = 0; k < kept.size(); ++k) {
      const Vector2d& p = kept[k];
      const Vector2d& q = kept[k + 1 == kept.size() ? 0 : k + 1];
      const double dp = cross(edge, p - from);
      const double dq = cross(edge, q - from);
      if (dp >= 0.0) next.push_back(p);
      if ((dp < 0.0 && dq > 0.0) || (dp > 0.0 && dq < 0.0)) next.push_back(p + dp / (dp - dq) * (q - p));
    }
    kept.swap(next);
  }
  if (kept.size() < 3) kept.clear();
  return kept;
}

/// Of points in the plane of a triangle, the weights of corners 1 and 2.
struct PlaneWeights {
  Vector2d origin;
  Matrix2d inverse;
  PlaneWeights(const Vector2d& a, const Vector2d& b, const Vector2d& c) : origin(a) {
    Matrix2d edges;
    edges << b - a, c - a;
    inverse = edges.inverse();
  }
  Vector2d operator()(const Vector2d& point) const { return inverse * (point - origin); }
};

/// Weights in space from weights in the picture: each counts with its corner's 1 / depth. Rounding leads out of
/// triangles that are seen edge on: clamped.
Vector2d in_space(const Vector2d& seen, const std::array<Vector3d, 3>& at) {
  const double w0 = std::max(0.0, 1.0 - seen.x() - seen.y()) * at[0].z();
  const double w1 = std::max(0.0, seen.x()) * at[1].z();
  const double w2 = std::max(0.0, seen.y()) * at[2].z();
  return Vector2d(w1, w2) / (w0 + w1 + w2);
}

/// The picture of a point with these weights in space.
Vector2d in_picture(const Vector2d& weights, const std::array<Vector3d, 3>& at) {
  const double b0 = (1.0 - weights.x() - weights.y()) / at[0].z();
  const double b1 = weights.x() / at[1].z();
  const double b2 = weights.y() / at[2].z();
  return (b0 * at[0].head<2>() + b1 * at[1].head<2>() + b2 * at[2].head<2>()) / (b0 + b1 + b2);
}

void orient(Outline& outline) {
  if (area_of(outline) < 0.0) std::reverse(outline.begin(), outline.end());
}

/// Adds the integrals over a part of a triangle: a fan of triangles, in each the middles of the sides, which is exact
/// for quadratic functions, so that cutting a part in two changes nothing.
void integrate(const Triangles& triangles, const Outline& part, const PlaneWeights& weights,
               const std::array<Vector3d, 3>& at, bool back, Fragment& fragment) {
  const auto& n = triangles.normal[static_cast<std::size_t>(fragment.triangle)];
  const auto& of = triangles.weights[static_cast<std::size_t>(fragment.triangle)];
  for (std::size_t k = 2; k < part.size(); ++k) {
    const std::array<Vector2d, 3> corner{part[0], part[k - 1], part[k]};
    const double area = 0.5 * cross(corner[1] - corner[0], corner[2] - corner[0]);
    if (!(area > 0.0)) continue;
    fragment.area += area;
    for (std::size_t side = 0; side < 3; ++side) {
      const Vector2d w = in_space(weights(0.5 * (corner[side] + corner[(side + 1) % 3])), at);
      const double w0 = 1.0 - w.x() - w.y();
      const Vector3d h = w0 * of[0] + w.x() * of[1] + w.y() * of[2];
      const std::array<double, 6> shape{h[0] * (2.0 * h[0] - 1.0), h[1] * (2.0 * h[1] - 1.0), h[2] * (2.0 * h[2] - 1.0),
                                        4.0 * h[0] * h[1],         4.0 * h[1] * h[2],         4.0 * h[2] * h[0]};
      for (std::size_t s = 0; s < 6; ++s) fragment.shape[s] += area / 3.0 * shape[s];
      fragment.normal += area / 3.0 * (w0 * n[0] + w.x() * n[1] + w.y() * n[2]).normalized();
    }
  }
  if (back) fragment.normal = -fragment.normal;
}

template <class Work>
void for_chunks(std::size_t count, const Work& work) {
  const std::size_t chunks = (count + kChunk - 1) / kChunk;
  tbb::parallel_for(std::size_t{0}, chunks,
                    [&](std::size_t chunk) { work(chunk, chunk * kChunk, std::min(count, (chunk + 1) * kChunk)); });
}

}  // namespace

CameraView camera_view(const Triangles& triangles, const LensCamera& camera) {
  CameraView view;
  view.camera = camera;
  const std::size_t count = triangles.size();
  view.back.assign(count, 0);
  view.at.resize(count);
  view.part.resize(count);
  // Heights in pixels of the same size as the others, so that slopes in space and in the picture are alike.
  const double scale = camera.focal_px * camera.pivot_in_camera.z();
  radiosity::Faces seen;
  std::vector<Vector3d> place(triangles.faces.points.size());
  std::vector<char> in_front(place.size(), 0);
  for (std::size_t p = 0; p < place.size(); ++p) {
    if (const auto at = camera.project(triangles.faces.points[p])) {
      place[p] = *at;
      in_front[p] = 1;
    }
  }
  for (const Vector3d& at : place) seen.points.emplace_back(at.x(), at.y(), scale * at.z());
  std::vector<int> triangle_of;
  for (std::size_t t = 0; t < count; ++t) {
    const mesh::Face& corners = triangles.faces.corners[t];
    bool whole = true;
    for (std::size_t k = 0; k < 3; ++k) {
      whole = whole && in_front[static_cast<std::size_t>(corners[k])];
      view.at[t][k] = place[static_cast<std::size_t>(corners[k])];
    }
    if (!whole) continue;
    seen.corners.push_back(corners);
    seen.object.push_back(triangles.faces.object[t]);
    triangle_of.push_back(static_cast<int>(t));
  }
  const Vector3d eye = camera.position();
  const radiosity::BeamView beam(seen, -Vector3d::UnitZ());
  std::vector<std::vector<Fragment>> found((triangle_of.size() + kChunk - 1) / kChunk);
  for_chunks(triangle_of.size(), [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    for (std::size_t s = begin; s < end; ++s) {
      const auto t = static_cast<std::size_t>(triangle_of[s]);
      const auto& at = view.at[t];
      double left = at[0].x(), right = left, top = at[0].y(), bottom = top;
      for (const Vector3d& corner : at) {
        left = std::min(left, corner.x());
        right = std::max(right, corner.x());
        top = std::min(top, corner.y());
        bottom = std::max(bottom, corner.y());
      }
      if (right <= 0.0 || bottom <= 0.0 || left >= camera.width || top >= camera.height) continue;
      const Vector3d& p0 = seen.points[static_cast<std::size_t>(seen.corners[s][0])];
      const Vector3d& p1 = seen.points[static_cast<std::size_t>(seen.corners[s][1])];
      const Vector3d& p2 = seen.points[static_cast<std::size_t>(seen.corners[s][2])];
      Vector3d normal = (p1 - p0).cross(p2 - p0);
      if (!(std::abs(normal.z()) > 0.0)) continue;
      if (normal.z() < 0.0) normal = -normal;
      view.back[t] = triangles.face_normal[t].dot(eye - triangles.corner[t][0]) < 0.0 ? 1 : 0;
      const PlaneWeights weights(at[0].head<2>(), at[1].head<2>(), at[2].head<2>());
      for (const Outline& relative : beam.lit_outlines(static_cast<int>(s), normal.normalized())) {
        Outline outline;
        for (const Vector2d& p : relative) {
          const Vector3d spot = p0 + p.x() * beam.axis_u() + p.y() * beam.axis_v();
          outline.emplace_back(spot.x(), spot.y());
        }
        orient(outline);
        for_each_pixel(outline, camera.width, camera.height, [&](int row, int column, const Outline& part) {
          Fragment fragment;
          fragment.pixel = row * camera.width + column;
          fragment.triangle = static_cast<int>(t);
          integrate(triangles, part, weights, at, view.back[t] != 0, fragment);
          if (fragment.area > 0.0) found[chunk].push_back(fragment);
        });
        view.part[t].push_back(std::move(outline));
      }
    }
  });
  const std::size_t pixels = static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  view.first.assign(pixels + 1, 0);
  for (const auto& chunk : found) {
    for (const Fragment& fragment : chunk) ++view.first[static_cast<std::size_t>(fragment.pixel) + 1];
  }
  std::partial_sum(view.first.begin(), view.first.end(), view.first.begin());
  view.fragments.resize(view.first.back());
  std::vector<std::size_t> next(view.first.begin(), view.first.end() - 1);
  for (const auto& chunk : found) {
    for (const Fragment& fragment : chunk) view.fragments[next[static_cast<std::size_t>(fragment.pixel)]++] = fragment;
  }
  return view;
}

LightView light_view(const Triangles& triangles, const Vector3d& direction, double half_angle_rad) {
  LightView view;
  view.direction = direction;
  const std::size_t count = triangles.size();
  view.share.assign(count, {0.0, 0.0});
  view.partly.assign(count, -1);
  view.factor.assign(count, 0.0);
  for (std::size_t t = 0; t < count; ++t) view.back.push_back(triangles.face_normal[t].dot(direction) > 0.0 ? 1 : 0);
  const std::vector<radiosity::BeamDirection> beams = radiosity::ring_directions(direction, half_angle_rad);
  // What each beam lights of the side that faces the axis of the source.
  std::vector<std::vector<std::vector<Outline>>> lit(beams.size(), std::vector<std::vector<Outline>>(count));
  std::vector<double> whole(count, 1.0);
  for (std::size_t b = 0; b < beams.size(); ++b) {
    const radiosity::BeamView beam(triangles.faces, beams[b].direction);
    std::vector<double> lit_share(count, 0.0);
    for_chunks(count, [&](std::size_t, std::size_t begin, std::size_t end) {
      for (std::size_t t = begin; t < end; ++t) {
        const Vector3d normal = (view.back[t] ? -1.0 : 1.0) * triangles.face_normal[t];
        const double cosine = -normal.dot(beams[b].direction);
        if (!(cosine > 0.0)) continue;
        const auto& c = triangles.corner[t];
        const auto across = [&](const Vector3d& p) {
          return Vector2d(beam.axis_u().dot(p - c[0]), beam.axis_v().dot(p - c[0]));
        };
        const Vector2d b1 = across(c[1]);
        const Vector2d b2 = across(c[2]);
        const double full = 0.5 * std::abs(cross(b1, b2));
        if (!(full > 0.0)) continue;
        const PlaneWeights weights(Vector2d::Zero(), b1, b2);
        double area = 0.0;
        for (const Outline& outline : beam.lit_outlines(static_cast<int>(t), normal)) {
          area += std::abs(area_of(outline));
          Outline in_weights;
          for (const Vector2d& p : outline) in_weights.push_back(weights(p));
          lit[b][t].push_back(std::move(in_weights));
        }
        lit_share[t] = area / full;
        if (area > (1.0 - kRounding) * full) lit_share[t] = 1.0;
      }
    });
    const double weight = 1.0 / static_cast<double>(beams.size());
    for (std::size_t t = 0; t < count; ++t) {
      view.share[t][view.back[t] ? 1 : 0] += weight * lit_share[t];
      view.factor[t] += beams[b].weight * lit_share[t] * std::abs(triangles.face_normal[t].dot(beams[b].direction));
      if (lit_share[t] < 1.0) whole[t] = 0.0;
    }
  }
  int partly = 0;
  for (std::size_t t = 0; t < count; ++t) {
    double& share = view.share[t][view.back[t] ? 1 : 0];
    if (whole[t] > 0.0) {
      share = 1.0;
    } else if (share > 0.0) {
      view.partly[t] = partly++;
    }
  }
  for (std::size_t b = 0; b < beams.size(); ++b) {
    LightView::Beam beam{beams[b].direction, beams[b].weight, {}};
    beam.part.resize(static_cast<std::size_t>(partly));
    for (std::size_t t = 0; t < count; ++t) {
      if (view.partly[t] >= 0) beam.part[static_cast<std::size_t>(view.partly[t])] = std::move(lit[b][t]);
    }
    view.beam.push_back(std::move(beam));
  }
  // The other side of a facet at the edge of attached shadow: as lit as the neighbours that face the light.
  const std::vector<std::array<double, 2>> facing = view.share;
  for (std::size_t t = 0; t < count; ++t) {
    const std::size_t side = view.back[t] ? 0 : 1;
    const double sign = side == 0 ? 1.0 : -1.0;
    bool lit_corner = false;
    for (const Vector3d& n : triangles.normal[t]) lit_corner = lit_corner || -sign * n.dot(direction) > 0.0;
    if (!lit_corner) continue;
    double sum = 0.0;
    int neighbours = 0;
    for (const int other : triangles.neighbour[t]) {
      if (other < 0 || !(-sign * triangles.face_normal[static_cast<std::size_t>(other)].dot(direction) > 0.0)) continue;
      sum += facing[static_cast<std::size_t>(other)][side];
      ++neighbours;
    }
    view.share[t][side] = neighbours > 0 ? sum / neighbours : 0.0;
  }
  return view;
}

radiosity::RowMatrix direct_image(const Triangles& triangles, const CameraView& camera, const LightView& light,
                                  const std::vector<int>& group, int groups) {
  const int width = camera.camera.width;
  const int height = camera.camera.height;
  radiosity::RowMatrix image = radiosity::RowMatrix::Zero(static_cast<Eigen::Index>(width) * height, groups);
  const auto lit_side = [&](std::size_t t) -> int { return light.back[t]; };
  tbb::parallel_for(tbb::blocked_range<int>(0, width * height, 1024), [&](const tbb::blocked_range<int>& range) {
    for (int pixel = range.begin(); pixel < range.end(); ++pixel) {
      const auto p = static_cast<std::size_t>(pixel);
      for (std::size_t f = camera.first[p]; f < camera.first[p + 1]; ++f) {
        const Fragment& fragment = camera.fragments[f];
        const auto t = static_cast<std::size_t>(fragment.triangle);
        if (group[t] < 0) continue;
        const int side = camera.back[t];
        if (side == lit_side(t) && light.partly[t] >= 0) continue;  // below, with its outlines
        const double share = light.share[t][static_cast<std::size_t>(side)];
        if (!(share > 0.0)) continue;
        const double cosine = -fragment.normal.dot(light.direction);
        if (cosine > 0.0) image(pixel, group[t]) += share * cosine;
      }
    }
  });
  // Partly lit triangles: what is seen ∩ what is lit, pixel by pixel.
  struct Amount {
    int pixel;
    int group;
    double value;
  };
  std::vector<std::vector<Amount>> found((triangles.size() + kChunk - 1) / kChunk);
  for_chunks(triangles.size(), [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      if (group[t] < 0 || light.partly[t] < 0 || camera.part[t].empty() || camera.back[t] != lit_side(t)) continue;
      const auto& at = camera.at[t];
      const PlaneWeights weights(at[0].head<2>(), at[1].head<2>(), at[2].head<2>());
      for (const LightView::Beam& beam : light.beam) {
        for (const Outline& lit_weights : beam.part[static_cast<std::size_t>(light.partly[t])]) {
          Outline lit;
          for (const Vector2d& w : lit_weights) lit.push_back(in_picture(w, at));
          orient(lit);
          for (const Outline& seen : camera.part[t]) {
            const Outline both = intersection(seen, lit);
            if (both.empty()) continue;
            for_each_pixel(both, width, height, [&](int row, int column, const Outline& part) {
              Fragment fragment;
              fragment.triangle = static_cast<int>(t);
              integrate(triangles, part, weights, at, camera.back[t] != 0, fragment);
              const double cosine = -fragment.normal.dot(beam.direction);
              if (cosine > 0.0) found[chunk].push_back({row * width + column, group[t], beam.weight * cosine});
            });
          }
        }
      }
    }
  });
  for (const auto& chunk : found) {
    for (const Amount& amount : chunk) image(amount.pixel, amount.group) += amount.value;
  }
  return image;
}

}  // namespace interglow::fitting
