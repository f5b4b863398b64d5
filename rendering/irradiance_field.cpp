// SPDX-License-Identifier: GPL-3.0-or-later
#include "rendering/irradiance_field.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <unordered_map>

#include "rendering/interpolation_error.h"

namespace interglow::rendering {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// An edge that is seen shorter than this many pixels has no value at its middle.
constexpr double kSmallestEdgePixels = 1.0 / 16.0;
// Bends along edges up to this many pixels are bends within a pixel.
constexpr double kLargestBentPixels = 2.0;
// One above this size has one in any case, since something may happen between ends that look alike.
constexpr double kLargestEdgePixels = 24.0;
constexpr int kMaxLevels = 10;
// A kink in the middle of an edge departs by four times what the slopes at its ends say, a smooth bend by once.
constexpr double kGuessSafety = 2.0;
// A point at which surfaces meet is moved into its own face by this share of its size: the irradiance there is the
// limit from inside.
constexpr double kInset = 1e-3;
// Surfaces that stop short of each other by less than this share of a pixel, or of a face if that is smaller, meet as
// well. What is seen through such a gap fades away over some gaps' width, while interpolation would spread it over
// the face: the point is moved beyond it, by this many gaps.
constexpr double kSmallGap = 0.1;
constexpr double kGapsInset = 20.0;
constexpr double kLargestInset = 0.5;  // of the pixel or face

/// Points that coincide and look the same way share one gather. Rounded, since an edge's middle is computed from both
/// sides.
struct Key {
  std::array<std::int64_t, 8> entry;
  bool operator==(const Key&) const = default;
};

struct KeyHash {
  std::size_t operator()(const Key& key) const {
    std::uint64_t h = 0x9e3779b97f4a7c15ULL;
    for (const std::int64_t e : key.entry) {
      h ^= static_cast<std::uint64_t>(e);
      h *= 0xff51afd7ed558ccdULL;
      h ^= h >> 32U;
    }
    return h;
  }
};

struct Leaf {
  int triangle;
  int face;
  bool back;
  int half;
  int level;
  std::array<Vector3d, 3> weights;  ///< of its corners in the face's triangle
  std::array<double, 3> expected;   ///< error of interpolation at the middle of edge k, from corner k to k + 1
};

/// A triangle to be split: which edges get a gathered value at their middle, and the points there.
struct Split {
  Leaf leaf;
  std::array<double, 3> pixels{};  ///< lengths of its edges in the picture
  std::array<bool, 3> gathered{};
  std::array<int, 3> middle{};
};

}  // namespace

struct IrradianceField::Known {
  std::unordered_map<Key, int, KeyHash> points;
};

IrradianceField::IrradianceField(const Surface& surface, const Gatherer& gatherer, const CameraRays& camera,
                                 const Eigen::VectorXd& weight, double tolerance)
    : surface_(&surface),
      gatherer_(&gatherer),
      camera_(&camera),
      weight_(weight),
      tolerance_(tolerance),
      channels_(static_cast<int>(weight.size())),
      known_(std::make_unique<Known>()),
      bent_pixel_(static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height), 0),
      root_(2 * static_cast<std::size_t>(surface.face_count()), -1) {}

IrradianceField::~IrradianceField() = default;

void IrradianceField::add(const std::vector<int>& sides, const Progress& progress) {
  const Surface& surface = *surface_;
  const Gatherer& gatherer = *gatherer_;
  const CameraRays& camera = *camera_;
  const Eigen::VectorXd& weight = weight_;
  std::unordered_map<Key, int, KeyHash>& known = known_->points;
  const double grid = 1e-3 * surface.smallest_face_mm();
  std::vector<SurfacePoint> wanted;  // not yet gathered; numbered after points_

  const auto point_at = [&](int face, bool back, int half, const Vector3d& weights) {
    const SurfacePoint at = surface.point(face, back, {half, weights});
    Key key{};
    for (int axis = 0; axis < 3; ++axis) {
      key.entry[static_cast<std::size_t>(axis)] = std::llround(at.position[axis] / grid);
      key.entry[static_cast<std::size_t>(axis) + 3] = std::llround(at.normal[axis] * 1e5);
    }
    key.entry[6] = surface.object(face);
    key.entry[7] = -1;
    const int next = static_cast<int>(points_.size() + wanted.size());
    const auto [found, is_new] = known.try_emplace(key, next);
    if (!is_new && found->second >= 0) return found->second;
    const double same_cosine =
        surface.smooth(face) ? 0.94 : 1.0 - 1e-6;  // 20 degrees between facets of a smooth surface
    const double edge = surface.face_size_mm(face);
    const double depth = camera.forward.dot(at.position - camera.origin);
    const double fine = depth > 0.0 ? std::min(edge, camera.pixel_side() * depth) : edge;
    const std::optional<double> gap = gatherer.gap(at, kSmallGap * fine, kInset * edge, same_cosine);
    if (is_new && !gap) {
      wanted.push_back(at);
      return next;
    }
    // Surfaces meet here: every face has a value of its own.
    found->second = -1;
    key.entry[7] = 2 * face + half;
    const auto [own, own_new] = known.try_emplace(key, next);
    if (own_new) {
      const Vector3d third = Vector3d::Constant(1.0 / 3.0);
      const double way = (surface.point(face, back, {half, third}).position - at.position).norm();
      const double beyond = std::min(kGapsInset * gap.value_or(0.0), kLargestInset * fine);
      const double inset = way > 0.0 ? std::clamp(beyond / way, kInset, 1.0) : kInset;
      const Vector3d inside = (1.0 - inset) * weights + inset * third;
      wanted.push_back(surface.point(face, back, {half, inside}));
    }
    return own->second;
  };
  const auto gather_wanted = [&] {
    const std::size_t first = points_.size();
    points_.insert(points_.end(), wanted.begin(), wanted.end());
    wanted.clear();
    value_.resize(points_.size() * static_cast<std::size_t>(channels_));
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(first, points_.size(), 64), [&](const tbb::blocked_range<std::size_t>& range) {
          for (std::size_t p = range.begin(); p < range.end(); ++p) {
            gatherer.irradiance(points_[p], value_.data() + p * static_cast<std::size_t>(channels_));
          }
          if (progress.cancelled || progress.report) {
            progress.update("gathering", static_cast<double>(range.begin()) / static_cast<double>(points_.size()));
          }
        });
  };
  const auto difference = [&](const double* a, const double* b, const double* c) {
    // |a - (b + c) / 2|
    double sum = 0.0;
    for (int k = 0; k < channels_; ++k) sum += weight[k] * std::abs(a[k] - 0.5 * (b[k] + c[k]));
    return sum;
  };
  const auto values = [&](int point) -> const double* {
    return value_.data() + static_cast<std::size_t>(point) * static_cast<std::size_t>(channels_);
  };
  const auto middle_of = [](const Leaf& leaf, std::size_t k) -> Vector3d {
    return 0.5 * (leaf.weights[k] + leaf.weights[(k + 1) % 3]);
  };
  /// Where the corners are seen; nothing if one of them is behind the camera.
  const auto places = [&](const Leaf& leaf) -> std::optional<std::array<Vector2d, 3>> {
    const auto c = Surface::corners(leaf.half);
    std::array<Vector2d, 3> place;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vector3d p = leaf.weights[k][0] * surface.corner(leaf.face, c[0]) +
                         leaf.weights[k][1] * surface.corner(leaf.face, c[1]) +
                         leaf.weights[k][2] * surface.corner(leaf.face, c[2]);
      const std::optional<Vector2d> seen = camera.project(p);
      if (!seen) return std::nullopt;
      place[k] = *seen;
    }
    return place;
  };
  /// Lengths of the three edges in the picture [pixels]; nothing if the triangle lies outside of it.
  const auto edge_pixels = [&](const Leaf& leaf) -> std::optional<std::array<double, 3>> {
    const std::optional<std::array<Vector2d, 3>> seen = places(leaf);
    // Behind the camera: as large as can be.
    if (!seen) return std::array<double, 3>{kInfinity, kInfinity, kInfinity};
    const std::array<Vector2d, 3>& place = *seen;
    const Vector2d low = place[0].cwiseMin(place[1]).cwiseMin(place[2]);
    const Vector2d high = place[0].cwiseMax(place[1]).cwiseMax(place[2]);
    if (high.x() < 0.0 || high.y() < 0.0 || low.x() > camera.width || low.y() > camera.height) return std::nullopt;
    return std::array<double, 3>{(place[1] - place[0]).norm(), (place[2] - place[1]).norm(),
                                 (place[0] - place[2]).norm()};
  };
  const auto mark_bent = [&](const Leaf& leaf) {
    const std::optional<std::array<Vector2d, 3>> seen = places(leaf);
    if (!seen) return;
    const Vector2d low = (*seen)[0].cwiseMin((*seen)[1]).cwiseMin((*seen)[2]);
    const Vector2d high = (*seen)[0].cwiseMax((*seen)[1]).cwiseMax((*seen)[2]);
    const auto pixel = [](double place, int count) { return std::clamp(static_cast<int>(place), 0, count - 1); };
    for (int row = pixel(low.y(), camera.height); row <= pixel(high.y(), camera.height); ++row) {
      for (int column = pixel(low.x(), camera.width); column <= pixel(high.x(), camera.width); ++column) {
        bent_pixel_[static_cast<std::size_t>(row) * static_cast<std::size_t>(camera.width) +
                    static_cast<std::size_t>(column)] = 1;
      }
    }
  };
  const auto spread = [&](const std::array<int, 3>& point, std::size_t k) {
    const double* other = values(point[(k + 1) % 3]);
    return difference(values(point[k]), other, other);
  };

  /// What the corners alone say about the error along the edges of the first triangles.
  const auto expect_errors = [&](std::vector<Leaf>& first) {
    std::vector<Vector3d> positions;
    for (const SurfacePoint& point : points_) positions.push_back(point.position);
    std::vector<std::array<int, 3>> triangles;
    for (std::size_t side = 0; side < root_.size(); ++side) {
      if (root_[side] < 0) continue;
      for (int half = 0; half < surface.triangles(static_cast<int>(side / 2)); ++half)
        triangles.push_back(triangles_[static_cast<std::size_t>(root_[side] + half)].point);
    }
    const radiosity::RowMatrix values_of_points = Eigen::Map<const radiosity::RowMatrix>(
        value_.data(), static_cast<Eigen::Index>(points_.size()), static_cast<Eigen::Index>(channels_));
    const InterpolationError error(positions, values_of_points, triangles, weight);
    for (Leaf& leaf : first) {
      const std::array<int, 3>& corner = triangles_[static_cast<std::size_t>(leaf.triangle)].point;
      for (std::size_t k = 0; k < 3; ++k) {
        const double guess = kGuessSafety * error.at_middle(corner[k], corner[(k + 1) % 3]);
        // A quarter of the spread is what a parabola that starts level departs from the line.
        leaf.expected[k] = std::isfinite(guess) ? guess : 0.25 * spread(corner, k);
      }
    }
  };

  std::vector<Leaf> leaves;
  for (const int side : sides) {
    if (root_[static_cast<std::size_t>(side)] >= 0) continue;
    const int face = side / 2;
    const bool back = side % 2 != 0;
    root_[static_cast<std::size_t>(side)] = static_cast<int>(triangles_.size());
    for (int half = 0; half < surface.triangles(face); ++half) {
      Leaf leaf{static_cast<int>(triangles_.size()),
                face,
                back,
                half,
                0,
                {Vector3d::UnitX(), Vector3d::UnitY(), Vector3d::UnitZ()},
                {0.0, 0.0, 0.0}};
      Triangle triangle;
      for (std::size_t k = 0; k < 3; ++k) triangle.point[k] = point_at(face, back, half, leaf.weights[k]);
      triangles_.push_back(triangle);
      leaves.push_back(leaf);
    }
  }
  gather_wanted();

  expect_errors(leaves);

  for (int level = 0; level < kMaxLevels && !leaves.empty(); ++level) {
    std::vector<Split> splits;
    for (const Leaf& leaf : leaves) {
      const std::optional<std::array<double, 3>> pixels = edge_pixels(leaf);
      if (!pixels) continue;
      Split split{leaf, *pixels};
      for (std::size_t k = 0; k < 3; ++k) {
        const double share = std::min(1.0, std::max({(*pixels)[0], (*pixels)[1], (*pixels)[2]}));
        split.gathered[k] = (*pixels)[k] > kSmallestEdgePixels &&
                            (share * leaf.expected[k] > tolerance_ || (*pixels)[k] > kLargestEdgePixels);
      }
      if (split.gathered[0] || split.gathered[1] || split.gathered[2]) splits.push_back(split);
    }
    for (Split& split : splits) {
      for (std::size_t k = 0; k < 3; ++k) {
        if (split.gathered[k])
          split.middle[k] = point_at(split.leaf.face, split.leaf.back, split.leaf.half, middle_of(split.leaf, k));
      }
    }
    gather_wanted();
    leaves.clear();
    for (Split& split : splits) {
      const Leaf& leaf = split.leaf;
      const std::array<int, 3> corner = triangles_[static_cast<std::size_t>(leaf.triangle)].point;
      std::array<double, 3> error{};
      double bend = 0.0;  // largest difference between a pixel's mean and its middle that an edge within it makes
      for (std::size_t k = 0; k < 3; ++k) {
        const int from = corner[k];
        const int to = corner[(k + 1) % 3];
        if (split.gathered[k]) {
          error[k] = difference(values(split.middle[k]), values(from), values(to));
          // A kink of height e over L pixels bends the line by 4 e/L, which moves the mean over a pixel by e/(2 L).
          if (split.pixels[k] <= kLargestBentPixels)
            bend = std::max(bend, error[k] * std::min(1.0, 0.5 / split.pixels[k]));
          continue;
        }
        split.middle[k] = static_cast<int>(points_.size());
        points_.push_back(points_[static_cast<std::size_t>(from)]);
        for (int c = 0; c < channels_; ++c) value_.push_back(0.5 * (values(from)[c] + values(to)[c]));
      }
      if (bend > tolerance_) mark_bent(leaf);
      const auto [m01, m12, m20] = split.middle;
      const auto first = static_cast<int>(triangles_.size());
      triangles_[static_cast<std::size_t>(leaf.triangle)].first_child = first;
      const Vector3d w01 = middle_of(leaf, 0);
      const Vector3d w12 = middle_of(leaf, 1);
      const Vector3d w20 = middle_of(leaf, 2);
      // Edge k of each child is parallel to edge k of the parent.
      const std::array<std::array<int, 3>, 4> points{
          {{corner[0], m01, m20}, {m01, corner[1], m12}, {m20, m12, corner[2]}, {m12, m20, m01}}};
      const std::array<std::array<Vector3d, 3>, 4> weights{
          {{leaf.weights[0], w01, w20}, {w01, leaf.weights[1], w12}, {w20, w12, leaf.weights[2]}, {w12, w20, w01}}};
      for (std::size_t child = 0; child < 4; ++child) {
        triangles_.push_back({points[child], -1});
        Leaf next{first + static_cast<int>(child), leaf.face, leaf.back, leaf.half, level + 1, weights[child], {}};
        for (std::size_t k = 0; k < 3; ++k) {
          // Linear interpolation errs four times less on half the length, and half the spread is left.
          next.expected[k] = 0.25 * std::max(error[k], std::abs(spread(points[child], k) - 0.5 * spread(corner, k)));
        }
        leaves.push_back(next);
      }
    }
  }
}

void IrradianceField::evaluate(int face, bool back, const FacePoint& at, double* channels) const {
  const int side = 2 * face + (back ? 1 : 0);
  const Triangle* triangle = &triangles_[static_cast<std::size_t>(root_[static_cast<std::size_t>(side)] + at.half)];
  Vector3d w = at.weights;
  while (triangle->first_child >= 0) {
    int child = 3;
    for (int k = 0; k < 3; ++k) {
      if (w[k] >= 0.5) child = k;
    }
    if (child == 3) {
      w = Vector3d::Ones() - 2.0 * w;
    } else {
      w *= 2.0;
      w[child] -= 1.0;
    }
    triangle = &triangles_[static_cast<std::size_t>(triangle->first_child + child)];
  }
  for (int c = 0; c < channels_; ++c) {
    double sum = 0.0;
    for (int k = 0; k < 3; ++k) {
      sum += w[k] * value_[static_cast<std::size_t>(triangle->point[static_cast<std::size_t>(k)]) *
                               static_cast<std::size_t>(channels_) +
                           static_cast<std::size_t>(c)];
    }
    channels[c] = sum;
  }
}

}  // namespace interglow::rendering
