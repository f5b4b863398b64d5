// SPDX-License-Identifier: GPL-3.0-or-later
#include "rendering/gather.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <vector>

#include "rendering/seen_outline.h"

namespace interglow::rendering {
namespace {

using Eigen::Vector3d;

constexpr int kLeafElements = 4;
// Shares of the tolerance. A cluster of more than kClusterShare is opened before it is tested for visibility; one of
// less than kSingleRayShare is tested by one ray, others by four; a partly hidden element is split while it is above
// kSplitShare.
constexpr double kClusterShare = 2.0;
constexpr double kSingleRayShare = 0.1;
constexpr double kSplitShare = 0.1;
// The quadrature error of one cluster or element; it has one sign, and a few hundred of them make an irradiance.
constexpr double kQuadratureShare = 0.005;
// What is left out altogether.
constexpr double kNegligibleShare = 1e-3;
// A point this near to an element's plane, in radii of the element, lies in it: rounding alone says on which side, and
// for the black back of the point's own plane the contour would be seen from its middle.
constexpr double kInPlane = 1e-9;
constexpr int kMaxSplits = 12;
constexpr int kMaxSampleLevels = 4;

/// A convex piece of an element.
struct Piece : SeenOutline {
  int element = -1;  ///< in tree order
  int splits = 0;
};

struct Node {
  Vector3d centre;  ///< weighted by area times strength
  double radius = 0.0;
  Vector3d axis;  ///< of the cone of normals
  double cone_cosine = 1.0;
  double cone_sine = 0.0;
  double power = 0.0;  ///< Σ area strength
  int first = 0;
  int count = 0;
  int left = -1;  ///< -1: leaf; the right child follows at `right`
  int right = -1;
};

Vector3d centroid(const Piece& piece) {
  Vector3d sum = Vector3d::Zero();
  for (int k = 0; k < piece.corners; ++k) sum += piece.corner[static_cast<std::size_t>(k)];
  return sum / piece.corners;
}

}  // namespace

struct Gatherer::Impl {
  const radiosity::Visibility* visibility = nullptr;
  double tolerance = 0.0;
  int channels = 0;
  std::vector<Node> nodes;
  std::vector<double> moment;  ///< nodes x channels x 3: Σ A b n
  // In tree order.
  std::vector<Vector3d> position;
  std::vector<Vector3d> normal;
  std::vector<double> area;
  std::vector<double> radius;
  std::vector<double> strength;
  std::vector<double> source;  ///< elements x channels
  std::vector<Piece> shape;
  std::vector<int> face;
  std::vector<int> object;
  std::vector<char> back;
  std::vector<int> face_object;

  int build(std::vector<int>& order, int first, int count, const radiosity::Elements& elements,
            const Eigen::VectorXd& strengths);
  void finish(int node);

  /// Adds what the point sees of a node that nothing hides.
  void sum_visible_node(const SurfacePoint& point, int node, double* out) const;
  void sum_visible_element(const SurfacePoint& point, int element, double* out) const;
  double form_factor(const SurfacePoint& point, int element) const;
  void add(int element, double factor, double* out) const {
    const double* b = source.data() + static_cast<std::size_t>(element) * static_cast<std::size_t>(channels);
    for (int c = 0; c < channels; ++c) out[c] += factor * b[c];
  }
};

int Gatherer::Impl::build(std::vector<int>& order, int first, int count, const radiosity::Elements& elements,
                          const Eigen::VectorXd& strengths) {
  const int index = static_cast<int>(nodes.size());
  nodes.emplace_back();
  Eigen::Matrix<double, 6, 1> low = Eigen::Matrix<double, 6, 1>::Constant(std::numeric_limits<double>::infinity());
  Eigen::Matrix<double, 6, 1> high = -low;
  Vector3d axis = Vector3d::Zero();
  for (int k = first; k < first + count; ++k) {
    const int e = order[static_cast<std::size_t>(k)];
    Eigen::Matrix<double, 6, 1> place;
    place << elements.centroid.row(e).transpose(), elements.normal.row(e).transpose();
    low = low.cwiseMin(place);
    high = high.cwiseMax(place);
    axis += elements.normal.row(e).transpose();
  }
  const double axis_length = axis.norm();
  double cosine = -1.0;
  if (axis_length > 1e-9 * count) {  // opposite normals cancel up to rounding
    axis /= axis_length;
    cosine = 1.0;
    for (int k = first; k < first + count; ++k)
      cosine = std::min(cosine, axis.dot(elements.normal.row(order[static_cast<std::size_t>(k)])));
  }
  {
    Node& node = nodes[static_cast<std::size_t>(index)];
    node.axis = axis;
    node.cone_cosine = cosine;
    node.cone_sine = std::sqrt(std::max(0.0, 1.0 - cosine * cosine));
    node.first = first;
    node.count = count;
  }
  if (count <= kLeafElements) return index;

  // Along the longest side, a normal's change by 1 counting as half of the cluster's size.
  Eigen::Matrix<double, 6, 1> extent = high - low;
  extent.tail<3>() *= 0.5 * extent.head<3>().norm();
  int along = 0;
  extent.maxCoeff(&along);
  const auto key = [&](int e) { return along < 3 ? elements.centroid(e, along) : elements.normal(e, along - 3); };
  const auto begin = order.begin() + first;
  int half = count / 2;
  const auto dark = std::stable_partition(begin, begin + count, [&](int e) { return strengths[e] > 0.0; });
  if (dark != begin && dark != begin + count) {
    half = static_cast<int>(dark - begin);
  } else {
    std::nth_element(begin, begin + half, begin + count,
                     [&](int a, int b) { return key(a) != key(b) ? key(a) < key(b) : a < b; });
  }
  const int left = build(order, first, half, elements, strengths);
  const int right = build(order, first + half, count - half, elements, strengths);
  nodes[static_cast<std::size_t>(index)].left = left;
  nodes[static_cast<std::size_t>(index)].right = right;
  return index;
}

void Gatherer::Impl::finish(int index) {
  Node& node = nodes[static_cast<std::size_t>(index)];
  Vector3d centre = Vector3d::Zero();
  Vector3d plain_centre = Vector3d::Zero();
  double plain = 0.0;
  double* m = moment.data() + static_cast<std::size_t>(index) * static_cast<std::size_t>(channels) * 3;
  for (int k = node.first; k < node.first + node.count; ++k) {
    const auto e = static_cast<std::size_t>(k);
    node.power += area[e] * strength[e];
    centre += area[e] * strength[e] * position[e];
    plain += area[e];
    plain_centre += area[e] * position[e];
    for (int c = 0; c < channels; ++c) {
      Eigen::Map<Vector3d>(m + 3 * c) +=
          area[e] * source[e * static_cast<std::size_t>(channels) + static_cast<std::size_t>(c)] * normal[e];
    }
  }
  node.centre = node.power > 0.0 ? Vector3d(centre / node.power) : Vector3d(plain_centre / plain);
  for (int k = node.first; k < node.first + node.count; ++k) {
    const Piece& piece = shape[static_cast<std::size_t>(k)];
    for (int i = 0; i < piece.corners; ++i)
      node.radius = std::max(node.radius, (piece.corner[static_cast<std::size_t>(i)] - node.centre).norm());
  }
}

Gatherer::Gatherer(const radiosity::Elements& elements, const radiosity::Visibility& visibility,
                   const radiosity::RowMatrix& sources, const Eigen::VectorXd& strength, double tolerance)
    : impl_(std::make_unique<Impl>()) {
  Impl& impl = *impl_;
  impl.visibility = &visibility;
  impl.tolerance = tolerance;
  impl.channels = static_cast<int>(sources.cols());
  const auto count = static_cast<int>(elements.size());
  std::vector<int> order(static_cast<std::size_t>(count));
  std::iota(order.begin(), order.end(), 0);
  impl.nodes.reserve(static_cast<std::size_t>(count));
  if (count > 0) impl.build(order, 0, count, elements, strength);
  impl.face_object = elements.faces.object;
  for (const int e : order) {
    const auto i = static_cast<std::size_t>(e);
    impl.position.emplace_back(elements.centroid.row(e));
    impl.normal.emplace_back(elements.normal.row(e));
    impl.area.push_back(elements.area_mm2[e]);
    impl.strength.push_back(strength[e]);
    impl.face.push_back(elements.face[i]);
    impl.object.push_back(elements.object[i]);
    impl.back.push_back(elements.back[i]);
    const mesh::Face& corners = elements.faces.corners[static_cast<std::size_t>(elements.face[i])];
    Piece piece;
    piece.corners = mesh::corner_count(corners);
    piece.element = static_cast<int>(impl.shape.size());
    double radius = 0.0;
    for (int k = 0; k < piece.corners; ++k) {
      const int from = elements.back[i] ? piece.corners - 1 - k : k;
      piece.corner[static_cast<std::size_t>(k)] =
          elements.faces.points[static_cast<std::size_t>(corners[static_cast<std::size_t>(from)])];
      radius = std::max(radius, (piece.corner[static_cast<std::size_t>(k)] - impl.position.back()).norm());
    }
    impl.shape.push_back(piece);
    impl.radius.push_back(radius);
    for (int c = 0; c < impl.channels; ++c) impl.source.push_back(sources(e, c));
  }
  impl.moment.assign(impl.nodes.size() * static_cast<std::size_t>(impl.channels) * 3, 0.0);
  for (std::size_t n = 0; n < impl.nodes.size(); ++n) impl.finish(static_cast<int>(n));
}

Gatherer::~Gatherer() = default;

double Gatherer::Impl::form_factor(const SurfacePoint& point, int element) const {
  const auto e = static_cast<std::size_t>(element);
  const Vector3d to = position[e] - point.position;
  const double in_front = -normal[e].dot(to);
  if (!(in_front > kInPlane * radius[e])) return 0.0;
  const double height = point.normal.dot(to);
  if (height <= -radius[e]) return 0.0;
  const double square = to.squaredNorm();
  if (height > radius[e]) {
    const double factor = height * in_front * area[e] / (std::numbers::pi * square * square);
    if (factor * strength[e] * radius[e] * radius[e] < kQuadratureShare * tolerance * square &&
        4.0 * radius[e] * radius[e] < square)
      return factor;
  }
  Piece piece = shape[e];
  if (!clip_at_horizon(point.position, point.normal, piece)) return 0.0;
  return contour_form_factor(point.position, point.normal, piece);
}

void Gatherer::Impl::sum_visible_element(const SurfacePoint& point, int element, double* out) const {
  const double factor = form_factor(point, element);
  if (factor > 0.0) add(element, factor, out);
}

void Gatherer::Impl::sum_visible_node(const SurfacePoint& point, int index, double* out) const {
  const Node& node = nodes[static_cast<std::size_t>(index)];
  if (!(node.power > 0.0)) return;
  const Vector3d to = node.centre - point.position;
  const double height = point.normal.dot(to);
  if (height <= -node.radius) return;
  const double square = to.squaredNorm();
  const double distance = std::sqrt(square);
  if (distance > 2.0 * node.radius && height > node.radius) {
    // Every normal faces the point: angle to the axis + cone + the cluster's angular radius below 90 degrees.
    const double cosine = -node.axis.dot(to) / distance;
    const double spread = node.radius / distance;
    if (node.cone_cosine > 0.0 && cosine > node.cone_sine + spread &&
        height / distance * cosine * node.power * spread * spread <
            kQuadratureShare * tolerance * std::numbers::pi * square) {
      const double scale = -height / (std::numbers::pi * square * square);
      const double* m = moment.data() + static_cast<std::size_t>(index) * static_cast<std::size_t>(channels) * 3;
      for (int c = 0; c < channels; ++c) out[c] += scale * to.dot(Eigen::Map<const Vector3d>(m + 3 * c));
      return;
    }
  }
  if (node.left < 0) {
    for (int k = node.first; k < node.first + node.count; ++k) sum_visible_element(point, k, out);
    return;
  }
  sum_visible_node(point, node.left, out);
  sum_visible_node(point, node.right, out);
}

namespace {

struct Candidate {
  int node = -1;       ///< a cluster,
  int element = -1;    ///< or a whole element,
  int piece = -1;      ///< or, with an element, a piece of it in Scratch::pieces
  double share = 0.0;  ///< bound on its contribution, in tolerances
  int first_segment = 0;
  int segments = 0;
};

struct Scratch {
  std::vector<int> stack;
  std::vector<Candidate> candidates;
  std::vector<Candidate> mixed;
  std::vector<Piece> pieces;
  std::vector<Piece> parts;
  std::vector<radiosity::Segment> segments;
  std::vector<char> blocked;
};

/// Appends the parts of a piece: four, or the triangles of a pentagon.
void split(const Piece& piece, std::vector<Piece>& parts) {
  const auto middle = [&](int a, int b) -> Vector3d {
    return 0.5 * (piece.corner[static_cast<std::size_t>(a)] + piece.corner[static_cast<std::size_t>(b)]);
  };
  const auto part = [&](std::initializer_list<Vector3d> corners) {
    Piece p;
    p.element = piece.element;
    p.splits = piece.splits + 1;
    for (const Vector3d& corner : corners) p.corner[static_cast<std::size_t>(p.corners++)] = corner;
    parts.push_back(p);
  };
  const auto& v = piece.corner;
  if (piece.corners == 3) {
    const Vector3d m01 = middle(0, 1);
    const Vector3d m12 = middle(1, 2);
    const Vector3d m20 = middle(2, 0);
    part({v[0], m01, m20});
    part({m01, v[1], m12});
    part({m20, m12, v[2]});
    part({m12, m20, m01});
  } else if (piece.corners == 4) {
    const Vector3d c = centroid(piece);
    const Vector3d m01 = middle(0, 1);
    const Vector3d m12 = middle(1, 2);
    const Vector3d m23 = middle(2, 3);
    const Vector3d m30 = middle(3, 0);
    part({v[0], m01, c, m30});
    part({m01, v[1], m12, c});
    part({c, m12, v[2], m23});
    part({m30, c, m23, v[3]});
  } else {
    part({v[0], v[1], v[2]});
    part({v[0], v[2], v[3]});
    part({v[0], v[3], v[4]});
  }
}

}  // namespace

void Gatherer::irradiance(const SurfacePoint& point, double* out) const {
  const Impl& impl = *impl_;
  std::fill(out, out + impl.channels, 0.0);
  if (impl.nodes.empty()) return;
  thread_local Scratch scratch;
  scratch.stack.assign(1, 0);
  scratch.candidates.clear();
  scratch.pieces.clear();

  const auto aim = [&](const Vector3d& target) {
    // Points at or below the horizon are not seen in any case.
    if (point.normal.dot(target - point.position) > 0.0)
      scratch.segments.push_back({point.position, target, point.face});
  };
  const auto shape_of = [&](const Candidate& candidate) -> const Piece& {
    return candidate.piece >= 0 ? scratch.pieces[static_cast<std::size_t>(candidate.piece)]
                                : impl.shape[static_cast<std::size_t>(candidate.element)];
  };
  const auto add_piece = [&](Piece piece) {
    if (!clip_at_horizon(point.position, point.normal, piece)) return;
    const double strength = impl.strength[static_cast<std::size_t>(piece.element)];
    const double share = contour_form_factor(point.position, point.normal, piece) * strength / impl.tolerance;
    if (share < kNegligibleShare) return;
    Candidate& candidate = scratch.candidates.emplace_back();
    candidate.element = piece.element;
    candidate.piece = static_cast<int>(scratch.pieces.size());
    candidate.share = share;
    scratch.pieces.push_back(piece);
  };
  const auto add_element = [&](int element) {
    const auto e = static_cast<std::size_t>(element);
    if (!(impl.strength[e] > 0.0) || impl.face[e] == point.face) return;
    const Vector3d to = impl.position[e] - point.position;
    const double height = point.normal.dot(to);
    if (!(-impl.normal[e].dot(to) > kInPlane * impl.radius[e]) || height <= -impl.radius[e]) return;
    if (height > impl.radius[e]) {
      const double share = impl.form_factor(point, element) * impl.strength[e] / impl.tolerance;
      if (share < kNegligibleShare) return;
      if (share <= kClusterShare) {
        Candidate& candidate = scratch.candidates.emplace_back();
        candidate.element = element;
        candidate.share = share;
        return;
      }
    }
    add_piece(impl.shape[e]);
  };

  while (true) {
    while (!scratch.stack.empty()) {
      const int index = scratch.stack.back();
      scratch.stack.pop_back();
      const Node& node = impl.nodes[static_cast<std::size_t>(index)];
      if (!(node.power > 0.0)) continue;
      const Vector3d to = node.centre - point.position;
      const double height = point.normal.dot(to);
      if (height <= -node.radius) continue;
      const double distance = to.norm();
      bool whole = false;
      double share = std::numeric_limits<double>::infinity();
      if (distance > node.radius) {
        const double cosine = -node.axis.dot(to) / distance;
        const double spread = node.radius / distance;
        // All normals look away: angle to the axis - cone - angular radius above 90 degrees, by sines (conservative for
        // sums).
        if (node.cone_cosine > 0.0 && cosine < -(node.cone_sine + spread)) continue;
        const double nearest = distance - node.radius;
        share = node.power / (std::numbers::pi * nearest * nearest * impl.tolerance);
        if (share < kNegligibleShare) continue;
        whole = height > node.radius && node.cone_cosine > 0.0 && cosine > node.cone_sine + spread;
      }
      if (whole && share <= kClusterShare) {
        Candidate& candidate = scratch.candidates.emplace_back();
        candidate.node = index;
        candidate.share = share;
      } else if (node.left >= 0) {
        scratch.stack.push_back(node.right);
        scratch.stack.push_back(node.left);
      } else {
        for (int k = node.first; k < node.first + node.count; ++k) add_element(k);
      }
    }
    if (scratch.candidates.empty()) break;

    scratch.segments.clear();
    for (Candidate& candidate : scratch.candidates) {
      candidate.first_segment = static_cast<int>(scratch.segments.size());
      const bool single = candidate.share < kSingleRayShare;
      if (candidate.node >= 0) {
        const Node& node = impl.nodes[static_cast<std::size_t>(candidate.node)];
        const int samples = single ? 1 : std::min(4, node.count);
        for (int s = 0; s < samples; ++s) {
          aim(impl.position[static_cast<std::size_t>(node.first + ((2 * s + 1) * node.count) / (2 * samples))]);
        }
      } else {
        const Piece& piece = shape_of(candidate);
        if (single) {
          aim(centroid(piece));
        } else {
          // As many rays as if it had been split until its parts were small.
          int levels = 1;
          for (double part = candidate.share; part > kClusterShare && levels < kMaxSampleLevels; part *= 0.25) ++levels;
          scratch.parts.assign(1, piece);
          while (!scratch.parts.empty()) {
            const Piece part = scratch.parts.back();
            scratch.parts.pop_back();
            if (part.splits < piece.splits + levels) {
              split(part, scratch.parts);
            } else {
              aim(centroid(part));
            }
          }
        }
      }
      candidate.segments = static_cast<int>(scratch.segments.size()) - candidate.first_segment;
    }
    scratch.blocked.resize(scratch.segments.size());
    impl.visibility->blocked(scratch.segments, scratch.blocked);

    scratch.mixed.clear();
    for (const Candidate& candidate : scratch.candidates) {
      int hidden = 0;
      for (int s = 0; s < candidate.segments; ++s)
        hidden += scratch.blocked[static_cast<std::size_t>(candidate.first_segment + s)];
      if (hidden == candidate.segments && candidate.segments > 0) continue;
      const bool mixed = hidden > 0;
      if (candidate.node >= 0) {
        if (mixed) {
          scratch.mixed.push_back(candidate);
        } else {
          impl.sum_visible_node(point, candidate.node, out);
        }
      } else if (mixed && candidate.share > kSplitShare && shape_of(candidate).splits < kMaxSplits) {
        scratch.mixed.push_back(candidate);
      } else {
        const auto e = static_cast<std::size_t>(candidate.element);
        const double seen = mixed ? 1.0 - static_cast<double>(hidden) / candidate.segments : 1.0;
        impl.add(candidate.element, seen * candidate.share * impl.tolerance / impl.strength[e], out);
      }
    }
    scratch.candidates.clear();
    for (const Candidate& candidate : scratch.mixed) {
      if (candidate.node < 0) {
        Piece piece = shape_of(candidate);
        if (!clip_at_horizon(point.position, point.normal, piece)) continue;
        scratch.parts.clear();
        split(piece, scratch.parts);
        for (const Piece& part : scratch.parts) add_piece(part);
        continue;
      }
      const Node& node = impl.nodes[static_cast<std::size_t>(candidate.node)];
      if (node.left >= 0) {
        scratch.stack.push_back(node.right);
        scratch.stack.push_back(node.left);
      } else {
        for (int k = node.first; k < node.first + node.count; ++k) add_element(k);
      }
    }
  }
}

std::optional<double> Gatherer::gap(const SurfacePoint& point, double distance, double distance_along,
                                    double same_cosine) const {
  const Impl& impl = *impl_;
  std::optional<double> nearest;
  if (impl.nodes.empty()) return nearest;
  const double largest = std::max(distance, distance_along);
  std::vector<int> stack{0};
  while (!stack.empty()) {
    const Node& node = impl.nodes[static_cast<std::size_t>(stack.back())];
    stack.pop_back();
    if ((node.centre - point.position).norm() > node.radius + largest) continue;
    if (node.left >= 0) {
      stack.push_back(node.left);
      stack.push_back(node.right);
      continue;
    }
    for (int k = node.first; k < node.first + node.count; ++k) {
      const auto e = static_cast<std::size_t>(k);
      if (impl.back[e] || impl.face[e] == point.face) continue;
      const double height = std::abs(impl.normal[e].dot(impl.position[e] - point.position));
      const double reach = std::max(distance_along, distance * impl.normal[e].cross(point.normal).norm());
      if (height > std::min(reach, nearest.value_or(reach))) continue;
      if ((impl.position[e] - point.position).norm() > impl.radius[e] + largest) continue;
      if (point.face >= 0 && impl.object[e] == impl.face_object[static_cast<std::size_t>(point.face)]) {
        if (std::abs(impl.normal[e].dot(point.normal)) > same_cosine) continue;
        bool rises = false;
        const Piece& piece = impl.shape[e];
        for (int i = 0; i < piece.corners; ++i) {
          rises = rises || point.normal.dot(piece.corner[static_cast<std::size_t>(i)] - point.position) > reach;
        }
        if (!rises) continue;
      }
      nearest = height;
    }
  }
  return nearest;
}

}  // namespace interglow::rendering
