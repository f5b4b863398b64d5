// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/node_gather.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>

#include "rendering/seen_outline.h"

namespace interglow::fitting {
namespace {

using Eigen::Vector3d;

/// How far a point at which surfaces meet is moved into its own triangle, as a share of the triangle, and how near they
/// come there, as a share of its width: the irradiance is the limit from inside.
constexpr double kInset = 1e-3;
/// A point this near to an element's plane, in radii of the element, lies in it.
constexpr double kInPlane = 1e-9;
/// Elements of at most these form factors are tested for visibility by 1 and 4 rays, larger ones by 16.
constexpr double kOneRay = 1e-4;
constexpr double kFourRays = 2e-3;

/// Appends the middles of `splits`² (or, for triangles, as many) equal parts of a piece.
void sample_points(const rendering::SeenOutline& piece, int per_side, std::vector<Vector3d>& points) {
  for (int first = 1; first + 1 < piece.corners; ++first) {
    const Vector3d& a = piece.corner[0];
    const Vector3d ab = piece.corner[static_cast<std::size_t>(first)] - a;
    const Vector3d ac = piece.corner[static_cast<std::size_t>(first + 1)] - a;
    for (int i = 0; i < per_side; ++i) {
      for (int j = 0; i + j < per_side; ++j) {
        points.push_back(a + (i + 1.0 / 3.0) / per_side * ab + (j + 1.0 / 3.0) / per_side * ac);
        if (i + j + 1 < per_side)
          points.push_back(a + (i + 2.0 / 3.0) / per_side * ab + (j + 2.0 / 3.0) / per_side * ac);
      }
    }
  }
}

}  // namespace

NodeGather::NodeGather(const rendering::Surface& surface, const radiosity::Elements& elements,
                       const radiosity::Visibility& visibility)
    : surface_(surface), elements_(elements), visibility_(visibility) {
  node_.assign(4 * static_cast<std::size_t>(surface.face_count()), {-1, -1, -1, -1, -1, -1});
}

NodeGather::Row NodeGather::row_at(const rendering::SurfacePoint& point, bool& touched, double reach) const {
  Row row;
  touched = false;
  struct Seen {
    int element;
    double factor;
    std::size_t first;
    std::size_t count;
  };
  std::vector<Seen> seen;
  std::vector<radiosity::Segment> segments;
  std::vector<Vector3d> samples;
  for (Eigen::Index e = 0; e < elements_.size(); ++e) {
    const auto i = static_cast<std::size_t>(e);
    if (elements_.face[i] == point.face) continue;
    const mesh::Face& corners = elements_.faces.corners[static_cast<std::size_t>(elements_.face[i])];
    rendering::SeenOutline piece;
    piece.corners = mesh::corner_count(corners);
    const Vector3d centre = elements_.centroid.row(e);
    double radius = 0.0;
    for (int k = 0; k < piece.corners; ++k) {
      const int from = elements_.back[i] ? piece.corners - 1 - k : k;
      const Vector3d& p = elements_.faces.points[static_cast<std::size_t>(corners[static_cast<std::size_t>(from)])];
      piece.corner[static_cast<std::size_t>(k)] = p;
      radius = std::max(radius, (p - centre).norm());
    }
    const Vector3d to = centre - point.position;
    const double in_front = -to.dot(elements_.normal.row(e));
    // Surfaces that meet at the point: one of another object, or one that rises over the horizon here.
    if (!touched && to.norm() < radius + reach && std::abs(in_front) < reach) {
      const rendering::FacePoint nearest = surface_.locate(elements_.face[i], point.position);
      Vector3d at = Vector3d::Zero();
      const std::array<int, 3> which = rendering::Surface::corners(nearest.half);
      for (std::size_t k = 0; k < 3; ++k)
        at += nearest.weights[static_cast<Eigen::Index>(k)] * surface_.corner(elements_.face[i], which[k]);
      bool rises = false;
      for (int k = 0; k < piece.corners; ++k) {
        const Vector3d& p = piece.corner[static_cast<std::size_t>(k)];
        rises = rises || point.normal.dot(p - point.position) > 0.34 * (p - point.position).norm();  // 20 degrees
      }
      const bool other = point.face >= 0 && elements_.object[i] != surface_.object(point.face);
      touched = (at - point.position).norm() < reach && (rises || other);
    }
    if (!(in_front > kInPlane * radius) || elements_.material[i] < 0) continue;
    if (point.normal.dot(to) <= -radius) continue;
    if (point.normal.dot(to) < radius && !rendering::clip_at_horizon(point.position, point.normal, piece)) continue;
    const double factor = rendering::contour_form_factor(point.position, point.normal, piece);
    if (!(factor > 0.0)) continue;
    samples.clear();
    sample_points(piece, factor < kOneRay ? 1 : factor < kFourRays ? 2 : 4, samples);
    seen.push_back({static_cast<int>(e), factor, segments.size(), samples.size()});
    for (const Vector3d& sample : samples) segments.push_back({point.position, sample, point.face, elements_.face[i]});
  }
  std::vector<char> blocked(segments.size(), 0);
  visibility_.blocked(segments, blocked);
  for (const Seen& one : seen) {
    std::size_t hidden = 0;
    for (std::size_t k = one.first; k < one.first + one.count; ++k) hidden += blocked[k] != 0 ? 1 : 0;
    const double factor = one.factor * (1.0 - static_cast<double>(hidden) / static_cast<double>(one.count));
    if (!(factor > 0.0)) continue;
    row.element.push_back(one.element);
    row.factor.push_back(static_cast<float>(factor));
  }
  return row;
}

void NodeGather::require(const std::vector<int>& sides, const Progress& progress) {
  std::map<std::array<std::int64_t, 8>, int> known(known_.begin(), known_.end());
  const double grid = 1e-3 * surface_.smallest_face_mm();
  const std::size_t old = position_.size();
  struct Use {
    int side;
    std::size_t k;
    int point;
  };
  std::vector<Use> uses;
  const auto point_of = [&](int side, std::size_t k, double inset) {
    Vector3d weights = Vector3d::Zero();
    if (k < 3) {
      weights[static_cast<Eigen::Index>(k)] = 1.0;
    } else {
      weights[static_cast<Eigen::Index>(k - 3)] = 0.5;
      weights[static_cast<Eigen::Index>((k - 2) % 3)] = 0.5;
    }
    weights = (1.0 - inset) * weights + inset * Vector3d::Constant(1.0 / 3.0);
    return surface_.point(side / 4, side % 2 != 0, {side / 2 % 2, weights});
  };
  const auto size_of = [&](int side) {
    const std::array<int, 3> which = rendering::Surface::corners(side / 2 % 2);
    const std::array<Vector3d, 3> corner{surface_.corner(side / 4, which[0]), surface_.corner(side / 4, which[1]),
                                         surface_.corner(side / 4, which[2])};
    return (corner[1] - corner[0]).cross(corner[2] - corner[0]).norm() /
           std::max({(corner[1] - corner[0]).norm(), (corner[2] - corner[1]).norm(), (corner[0] - corner[2]).norm()});
  };
  for (const int side : sides) {
    if (node_[static_cast<std::size_t>(side)][0] >= 0) continue;
    for (std::size_t k = 0; k < 6; ++k) {
      const rendering::SurfacePoint point = point_of(side, k, 0.0);
      std::array<std::int64_t, 8> key{};
      for (int axis = 0; axis < 3; ++axis) {
        key[static_cast<std::size_t>(axis)] = std::llround(point.position[axis] / grid);
        key[static_cast<std::size_t>(axis) + 3] = std::llround(point.normal[axis] * 1e5);
      }
      key[6] = surface_.object(point.face);
      const auto [found, is_new] = known.try_emplace(key, static_cast<int>(position_.size()));
      if (is_new) {
        position_.push_back(point);
        size_mm_.push_back(size_of(side));
      }
      node_[static_cast<std::size_t>(side)][k] = found->second;
      uses.push_back({side, k, found->second});
    }
  }
  known_.assign(known.begin(), known.end());
  row_.resize(position_.size());
  std::vector<char> touched(position_.size(), 0);
  const auto gather = [&](std::size_t begin, std::size_t end) {
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(begin, end, 16), [&](const tbb::blocked_range<std::size_t>& range) {
          for (std::size_t p = range.begin(); p < range.end(); ++p) {
            bool meets = false;
            const double reach = kInset * size_mm_[p];
            row_[p] = row_at(position_[p], meets, reach);
            touched[p] = meets ? 1 : 0;
          }
          if (progress.report || progress.cancelled)
            progress.update("form factors of points", static_cast<double>(range.begin()) / static_cast<double>(end));
        });
  };
  gather(old, position_.size());
  // Where surfaces meet every triangle has points of its own, just inside.
  const std::size_t shared = position_.size();
  for (const Use& use : uses) {
    if (static_cast<std::size_t>(use.point) < old || !touched[static_cast<std::size_t>(use.point)]) continue;
    node_[static_cast<std::size_t>(use.side)][use.k] = static_cast<int>(position_.size());
    position_.push_back(point_of(use.side, use.k, kInset));
    size_mm_.push_back(size_of(use.side));
  }
  // A later call must not share a point at which surfaces meet.
  std::erase_if(known_, [&](const auto& entry) {
    return static_cast<std::size_t>(entry.second) < touched.size() && touched[static_cast<std::size_t>(entry.second)];
  });
  row_.resize(position_.size());
  touched.resize(position_.size(), 0);
  gather(shared, position_.size());
}

radiosity::RowMatrix NodeGather::apply(const radiosity::RowMatrix& radiosity) const {
  radiosity::RowMatrix result = radiosity::RowMatrix::Zero(static_cast<Eigen::Index>(row_.size()), radiosity.cols());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, row_.size(), 32),
                    [&](const tbb::blocked_range<std::size_t>& range) {
                      for (std::size_t p = range.begin(); p < range.end(); ++p) {
                        const Row& row = row_[p];
                        auto sum = result.row(static_cast<Eigen::Index>(p));
                        for (std::size_t k = 0; k < row.element.size(); ++k)
                          sum += static_cast<double>(row.factor[k]) * radiosity.row(row.element[k]);
                      }
                    });
  return result;
}

}  // namespace interglow::fitting
