// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/finer_faces.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>

#include "mesh/quality.h"
#include "mesh/surface_index.h"

namespace interglow::mesh {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

/// Corners this near to a line count as on it, and lines this near to an edge as that edge, in sizes of the face.
constexpr double kOnLine = 1e-3;
/// Surfaces this near touch, in sizes of the face.
constexpr double kTouch = 1e-3;
/// Quads farther than this from a plane, in sizes of the face, become triangles.
constexpr double kPlanar = 1e-8;
/// Lines cut through one of the original faces; more is a surface that runs along it.
constexpr int kMostLines = 4;
/// A face is halved while its extent is above this share of its distance to another object ...
constexpr double kExtent = 0.6;
/// ... and that distance changes over it by more than this share;
constexpr double kChange = 0.35;
/// along a contact, beside its end, while it is longer than this many times that distance: what falls into a cusp from
/// its end is reflected across the gap, and reaches about as far in as the gap is wide.
constexpr double kSlender = 1.0;
/// Cosine between normals of surfaces that make a cusp.
constexpr double kFacing = -0.7;
constexpr int kMostPasses = 64;

struct Piece {
  int count = 3;
  std::array<int, 4> corner{};
  std::array<Vector3d, 4> normal{};
  int halvings = 0;   ///< towards contacts
  int shortened = 0;  ///< times halved along contacts
  int lines = 0;      ///< along contacts
};

using Triangle = std::array<Vector3d, 3>;

/// Triangles of the other objects, and who sees them.
struct Obstacles {
  struct One {
    std::vector<Triangle> triangle;
    bool two_sided = false;
    Vector3d low, high;
    std::optional<SurfaceIndex> index;  ///< where distances are asked for
  };
  std::vector<One> object;
};

/// Faces of one object that can be split.
class Refiner {
 public:
  explicit Refiner(const PatchMesh& mesh) : smooth_(!mesh.corner_normals.empty()), closed_(mesh.closed) {
    points_ = mesh.points;
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
      Piece piece;
      piece.count = corner_count(mesh.faces[f]);
      const Vector3d flat = vector_area(mesh, mesh.faces[f]).normalized();
      for (std::size_t k = 0; k < static_cast<std::size_t>(piece.count); ++k) {
        piece.corner[k] = mesh.faces[f][k];
        piece.normal[k] = smooth_ ? mesh.corner_normals[f][k] : flat;
      }
      pieces_.push_back(piece);
    }
  }

  std::size_t size() const { return pieces_.size(); }

  PatchMesh mesh() const {
    PatchMesh result;
    result.points = points_;
    result.closed = closed_;
    for (const Piece& piece : pieces_) {
      Face face{-1, -1, -1, -1};
      std::array<Vector3d, 4> normals;
      normals.fill(piece.normal[0]);
      for (std::size_t k = 0; k < static_cast<std::size_t>(piece.count); ++k) {
        face[k] = piece.corner[k];
        normals[k] = piece.normal[k];
      }
      result.faces.push_back(face);
      if (smooth_) result.corner_normals.push_back(normals);
    }
    return result;
  }

  /// Halves edges over which the normal turns by more than `limit` [rad].
  void halve_turns(double limit) {
    if (!smooth_) return;
    repeat(false, [&](const Piece& piece, std::vector<Piece>& out) {
      std::array<double, 4> turn{};
      int widest = 0;
      for (int k = 0; k < piece.count; ++k) {
        turn[at(k)] = std::acos(std::clamp(piece.normal[at(k)].dot(piece.normal[next(piece, k)]), -1.0, 1.0));
        if (turn[at(k)] > turn[at(widest)]) widest = k;
      }
      if (!(turn[at(widest)] > limit)) return false;
      if (piece.count == 4) {
        const double across = std::max(turn[at((widest + 1) % 4)], turn[at((widest + 3) % 4)]);
        if (across > limit || !halve_quad(piece, widest, out)) in_two_triangles(piece, out);
      } else {
        halve_triangle(piece, widest, 0.5, out);
      }
      return true;
    });
  }

  /// Cuts along the lines where others touch or cross the faces.
  void cut_along(const Obstacles& others) {
    repeat(true, [&](const Piece& piece, std::vector<Piece>& out) {
      if (piece.lines >= kMostLines) return false;
      const auto line = contact_line(piece, others);
      return line && cut(piece, line->first, line->second, out);
    });
  }

  /// Halves faces towards others that see them.
  void grade_towards(const Obstacles& others, int halvings) {
    const PatchMesh whole = mesh();
    own_.emplace(whole.points, triangles_of(whole));
    repeat(false, [&](const Piece& piece, std::vector<Piece>& out) {
      const NearEdges near = near_edges(piece, others, halvings);
      const bool towards = near.steepest >= 0 && piece.halvings < halvings;
      const int edge = towards ? near.steepest : near.long_edge;
      if (edge < 0) return false;
      const std::size_t first = out.size();
      if (piece.count == 4) {
        if (!halve_quad(piece, edge, out)) {
          in_two_triangles(piece, out);
          return true;  // the triangles are looked at in the next pass
        }
      } else {
        halve_triangle(piece, edge, 0.5, out);
      }
      for (std::size_t k = first; k < out.size(); ++k) ++(towards ? out[k].halvings : out[k].shortened);
      return true;
    });
  }

 private:
  static std::size_t at(int k) { return static_cast<std::size_t>(k); }
  static std::size_t next(const Piece& piece, int k) { return static_cast<std::size_t>((k + 1) % piece.count); }
  const Vector3d& point(const Piece& piece, std::size_t k) const {
    return points_[static_cast<std::size_t>(piece.corner[k])];
  }
  double size_of(const Piece& piece) const {
    double size = 0.0;
    for (int i = 0; i < piece.count; ++i) {
      for (int j = 0; j < i; ++j) size = std::max(size, (point(piece, at(i)) - point(piece, at(j))).norm());
    }
    return size;
  }

  std::pair<int, int> key(const Piece& piece, int k) const {
    return std::minmax(piece.corner[at(k)], piece.corner[next(piece, k)]);
  }

  /// The point that splits an edge, and where it lies along it.
  struct Split {
    int point = -1;
    double share = 0.5;  ///< from the corner of the smaller index
  };

  /// The edge's split point, made at `share` from corner k unless it exists. @returns its share from corner k
  std::pair<int, double> split_edge(const Piece& piece, int k, double share) {
    const std::pair<int, int> edge = key(piece, k);
    const bool forward = edge.first == piece.corner[at(k)];
    const auto [found, is_new] = splits_.try_emplace(edge);
    if (is_new) {
      const Vector3d& a = point(piece, at(k));
      const Vector3d& b = point(piece, next(piece, k));
      Vector3d middle = a + share * (b - a);
      if (smooth_) {
        // The cubic whose ends are tangent to the surface, at its middle; a parabola beside it.
        const Vector3d& na = piece.normal[at(k)];
        const Vector3d& nb = piece.normal[next(piece, k)];
        middle += share * (1.0 - share) / 2.0 * ((b - a).dot(nb) * nb - (b - a).dot(na) * na);
      }
      found->second = {static_cast<int>(points_.size()), forward ? share : 1.0 - share};
      points_.push_back(middle);
    }
    return {found->second.point, forward ? found->second.share : 1.0 - found->second.share};
  }

  static Vector3d between(const Vector3d& a, const Vector3d& b, double share) {
    return ((1.0 - share) * a + share * b).normalized();
  }

  void halve_triangle(const Piece& piece, int k, double share, std::vector<Piece>& out) {
    const auto [middle, where] = split_edge(piece, k, share);
    const Vector3d normal = between(piece.normal[at(k)], piece.normal[next(piece, k)], where);
    Piece one = piece;
    one.corner[next(piece, k)] = middle;
    one.normal[next(piece, k)] = normal;
    Piece two = piece;
    two.corner[at(k)] = middle;
    two.normal[at(k)] = normal;
    out.push_back(one);
    out.push_back(two);
  }

  /// Splits edges k and k + 2 at their middles. @returns false, with nothing done, if that makes no plane quads
  bool halve_quad(const Piece& piece, int k, std::vector<Piece>& out) {
    const int opposite = (k + 2) % 4;
    for (const int edge : {k, opposite}) {
      const auto found = splits_.find(key(piece, edge));
      if (found != splits_.end() && found->second.share != 0.5) return false;
    }
    const std::size_t before = points_.size();
    const auto saved = std::array{splits_.contains(key(piece, k)), splits_.contains(key(piece, opposite))};
    const int m = split_edge(piece, k, 0.5).first;
    const int n = split_edge(piece, opposite, 0.5).first;
    Piece one = piece;
    one.corner[next(piece, k)] = m;
    one.normal[next(piece, k)] = between(piece.normal[at(k)], piece.normal[next(piece, k)], 0.5);
    one.corner[at(opposite)] = n;
    one.normal[at(opposite)] = between(piece.normal[at(opposite)], piece.normal[next(piece, opposite)], 0.5);
    Piece two = piece;
    two.corner[at(k)] = m;
    two.normal[at(k)] = one.normal[next(piece, k)];
    two.corner[next(piece, opposite)] = n;
    two.normal[next(piece, opposite)] = one.normal[at(opposite)];
    if (!plane(one) || !plane(two)) {
      if (!saved[1]) splits_.erase(key(piece, opposite));
      if (!saved[0]) splits_.erase(key(piece, k));
      points_.resize(before);
      return false;
    }
    out.push_back(one);
    out.push_back(two);
    return true;
  }

  bool plane(const Piece& piece) const {
    const Vector3d normal = (point(piece, 2) - point(piece, 0)).cross(point(piece, 3) - point(piece, 1)).normalized();
    return std::abs(normal.dot(point(piece, 1) - point(piece, 0))) < kPlanar * size_of(piece) &&
           std::abs(normal.dot(point(piece, 3) - point(piece, 0))) < kPlanar * size_of(piece);
  }

  static void in_two_triangles(const Piece& quad, std::vector<Piece>& out) {
    for (const std::array<std::size_t, 3>& half : {std::array<std::size_t, 3>{0, 1, 2}, {0, 2, 3}}) {
      Piece piece = quad;
      piece.count = 3;
      for (std::size_t k = 0; k < 3; ++k) {
        piece.corner[k] = quad.corner[half[k]];
        piece.normal[k] = quad.normal[half[k]];
      }
      out.push_back(piece);
    }
  }

  /// Splits a piece whose edges end within others' edges.
  bool close(const Piece& piece, std::vector<Piece>& out) {
    std::array<bool, 4> hangs{};
    int first = -1;
    for (int k = 0; k < piece.count; ++k) {
      hangs[at(k)] = splits_.contains(key(piece, k));
      if (hangs[at(k)] && first < 0) first = k;
    }
    if (first < 0) return false;
    if (piece.count == 3) {
      halve_triangle(piece, first, 0.5, out);
    } else if (hangs[at(first)] != hangs[at((first + 2) % 4)] || hangs[at((first + 1) % 4)] ||
               hangs[at((first + 3) % 4)] || !halve_quad(piece, first, out)) {
      in_two_triangles(piece, out);
    }
    return true;
  }

  /// Applies a step to all pieces until none changes and no edge ends within another.
  /// @param closed_first  the step needs pieces whose edges are whole
  template <class Step>
  void repeat(bool closed_first, const Step& step) {
    bool changed = true;
    for (int pass = 0; changed && pass < kMostPasses; ++pass) {
      changed = false;
      std::vector<Piece> made;
      for (const Piece& piece : pieces_) {
        if (closed_first ? close(piece, made) || step(piece, made) : step(piece, made) || close(piece, made)) {
          changed = true;
        } else {
          made.push_back(piece);
        }
      }
      pieces_ = std::move(made);
    }
  }

  /// A piece's plane, corners in it, and box.
  struct Flat {
    Vector3d origin, normal, u, v;
    std::vector<Vector2d> corner;
    double size = 0.0;
    Vector3d low, high;
    Vector2d across(const Vector3d& p) const { return {u.dot(p - origin), v.dot(p - origin)}; }
  };
  Flat flat(const Piece& piece) const {
    Flat result;
    result.origin = point(piece, 0);
    const Vector3d& a = point(piece, 1);
    const Vector3d& b = point(piece, 2);
    result.normal = piece.count == 3 ? (a - result.origin).cross(b - result.origin).normalized()
                                     : (b - result.origin).cross(point(piece, 3) - a).normalized();
    result.u = (a - result.origin - result.normal.dot(a - result.origin) * result.normal).normalized();
    result.v = result.normal.cross(result.u);
    result.low = result.high = result.origin;
    for (int k = 0; k < piece.count; ++k) {
      const Vector3d& p = point(piece, at(k));
      result.corner.push_back(result.across(p));
      result.low = result.low.cwiseMin(p);
      result.high = result.high.cwiseMax(p);
    }
    result.size = size_of(piece);
    return result;
  }

  /// Ends of what lies within a convex outline of the segment a b; nothing if it runs along an edge or outside.
  static std::optional<std::pair<Vector2d, Vector2d>> within(const Flat& flat, const Vector2d& a, const Vector2d& b) {
    double from = 0.0, to = 1.0;
    const Vector2d way = b - a;
    for (std::size_t k = 0; k < flat.corner.size(); ++k) {
      const Vector2d& p = flat.corner[k];
      const Vector2d edge = (flat.corner[(k + 1) % flat.corner.size()] - p).normalized();
      const Vector2d inward(-edge.y(), edge.x());
      const double start = inward.dot(a - p) - kOnLine * flat.size;
      const double slope = inward.dot(way);
      if (start + from * slope <= 0.0 && start + to * slope <= 0.0) return std::nullopt;
      if (start + from * slope < 0.0) from = -start / slope;
      if (start + to * slope < 0.0) to = -start / slope;
    }
    if (!((to - from) * way.norm() > 2.0 * kOnLine * flat.size)) return std::nullopt;
    return std::pair<Vector2d, Vector2d>(a + from * way, a + to * way);
  }

  /// The longest segment along which another object touches or crosses the piece's inside.
  std::optional<std::pair<Vector3d, Vector3d>> contact_line(const Piece& piece, const Obstacles& others) const {
    const Flat face = flat(piece);
    const double reach = kTouch * face.size;
    const Vector3d low = face.low.array() - reach;
    const Vector3d high = face.high.array() + reach;
    std::optional<std::pair<Vector3d, Vector3d>> best;
    double longest = 0.0;
    for (const Obstacles::One& other : others.object) {
      if ((other.low.array() > high.array()).any() || (other.high.array() < low.array()).any()) continue;
      for (const Triangle& triangle : other.triangle) {
        if ((triangle[0].cwiseMin(triangle[1]).cwiseMin(triangle[2]).array() > high.array()).any() ||
            (triangle[0].cwiseMax(triangle[1]).cwiseMax(triangle[2]).array() < low.array()).any())
          continue;
        std::array<double, 3> height{};
        int touching = 0;
        for (std::size_t k = 0; k < 3; ++k) {
          height[k] = face.normal.dot(triangle[k] - face.origin);
          if (std::abs(height[k]) < reach) height[k] = 0.0;
          touching += height[k] == 0.0 ? 1 : 0;
        }
        if (touching == 3) continue;  // it lies on the face: its neighbours that rise from it tell where it ends
        std::array<Vector3d, 3> ends;
        std::size_t count = 0;
        for (std::size_t k = 0; k < 3; ++k) {
          const double a = height[k];
          const double b = height[(k + 1) % 3];
          if (a == 0.0) ends[count++] = triangle[k];
          if (a * b < 0.0) ends[count++] = triangle[k] + a / (a - b) * (triangle[(k + 1) % 3] - triangle[k]);
        }
        if (count != 2) continue;
        const auto inside = within(face, face.across(ends[0]), face.across(ends[1]));
        if (!inside) continue;
        const double length = (inside->second - inside->first).norm();
        if (!(length > longest)) continue;
        longest = length;
        best = {ends[0], ends[1]};
      }
    }
    return best;
  }

  /// Cuts along the whole line through a and b. @returns false, with nothing done, if all of the piece lies on one side
  bool cut(const Piece& piece, const Vector3d& a, const Vector3d& b, std::vector<Piece>& out) {
    const Flat face = flat(piece);
    const Vector2d from = face.across(a);
    const Vector2d along = (face.across(b) - from).normalized();
    std::array<double, 4> side{};
    bool left = false, right = false;
    for (int k = 0; k < piece.count; ++k) {
      const Vector2d to = face.corner[at(k)] - from;
      side[at(k)] = along.x() * to.y() - along.y() * to.x();
      if (std::abs(side[at(k)]) < kOnLine * face.size) side[at(k)] = 0.0;
      left = left || side[at(k)] > 0.0;
      right = right || side[at(k)] < 0.0;
    }
    if (!left || !right) return false;
    std::array<std::vector<int>, 2> corner;
    std::array<std::vector<Vector3d>, 2> normal;
    for (int k = 0; k < piece.count; ++k) {
      const double here = side[at(k)];
      const double there = side[next(piece, k)];
      for (std::size_t half = 0; half < 2; ++half) {
        if (half == 0 ? here >= 0.0 : here <= 0.0) {
          corner[half].push_back(piece.corner[at(k)]);
          normal[half].push_back(piece.normal[at(k)]);
        }
      }
      if (here * there < 0.0) {
        const auto [middle, where] = split_edge(piece, k, here / (here - there));
        for (std::size_t half = 0; half < 2; ++half) {
          corner[half].push_back(middle);
          normal[half].push_back(between(piece.normal[at(k)], piece.normal[next(piece, k)], where));
        }
      }
    }
    for (std::size_t half = 0; half < 2; ++half) {
      const std::size_t count = corner[half].size();
      const auto add = [&](const std::vector<std::size_t>& which) {
        Piece part = piece;
        part.count = static_cast<int>(which.size());
        part.lines = piece.lines + 1;
        for (std::size_t k = 0; k < which.size(); ++k) {
          part.corner[k] = corner[half][which[k]];
          part.normal[k] = normal[half][which[k]];
        }
        if (part.count == 4 && !plane(part)) {
          in_two_triangles(part, out);
        } else {
          out.push_back(part);
        }
      };
      if (count == 3) add({0, 1, 2});
      if (count >= 4) add({0, 1, 2, 3});
      if (count == 5) add({0, 3, 4});
    }
    return true;
  }

  /// Edges of a piece that are too long beside another object that it sees; -1: none.
  struct NearEdges {
    int steepest = -1;   ///< along which the distance changes most
    int long_edge = -1;  ///< longest beside an end
  };
  /// Whether one of two surfaces that are `distance` apart at an edge ends within the edge's length of it, along it.
  bool ends_near(const Piece& piece, int k, double distance, const Obstacles::One& other,
                 const SurfacePoint& nearest) const {
    const Vector3d& a = point(piece, at(k));
    const Vector3d& b = point(piece, next(piece, k));
    for (const Vector3d& beyond : {Vector3d(2.0 * a - b), Vector3d(2.0 * b - a)}) {
      if ((own_->closest(beyond).point - beyond).norm() > 0.5 * (b - a).norm()) return true;
      const double there = (other.index->closest(beyond, nearest).point - beyond).norm();
      if (there - distance > kChange * there) return true;
    }
    return false;
  }

  NearEdges near_edges(const Piece& piece, const Obstacles& others, int halvings) const {
    const Flat face = flat(piece);
    Vector3d centre = Vector3d::Zero();
    for (int k = 0; k < piece.count; ++k) centre += point(piece, at(k)) / piece.count;
    NearEdges result;
    double steepest = 0.0;
    double longest = 0.0;
    for (const Obstacles::One& other : others.object) {
      const Vector3d margin = Vector3d::Constant(face.size / kExtent);
      if ((other.low.array() > (face.high + margin).array()).any() ||
          (other.high.array() < (face.low - margin).array()).any())
        continue;
      const SurfacePoint nearest = other.index->closest(centre);
      if ((nearest.point - centre).norm() > face.size * (1.0 + 1.0 / kExtent)) continue;
      const Triangle& triangle = other.triangle[static_cast<std::size_t>(nearest.triangle)];
      // Both fronts must see something of each other.
      double above = 0.0;
      for (const Vector3d& corner : triangle) above = std::max(above, face.normal.dot(corner - face.origin));
      const Vector3d front = (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]);
      double before = 0.0;
      for (int k = 0; k < piece.count; ++k) before = std::max(before, front.dot(point(piece, at(k)) - triangle[0]));
      if (!(above > kTouch * face.size) || (!other.two_sided && !(before > kTouch * face.size * front.norm())))
        continue;
      const bool cusp = piece.shortened < halvings && face.normal.dot(front) < kFacing * front.norm();
      const double gap = (nearest.point - centre).norm();
      std::array<double, 4> distance{};
      for (int k = 0; k < piece.count; ++k)
        distance[at(k)] = (other.index->closest(point(piece, at(k)), nearest).point - point(piece, at(k))).norm();
      for (int k = 0; k < piece.count; ++k) {
        const double farther = std::max(distance[at(k)], distance[next(piece, k)]);
        const double change = std::abs(distance[at(k)] - distance[next(piece, k)]);
        const double length = (point(piece, at(k)) - point(piece, next(piece, k))).norm();
        if (length > kExtent * farther && change > kChange * farther && change > steepest) {
          steepest = change;
          result.steepest = k;
        }
        if (cusp && length > kSlender * gap && length > longest && ends_near(piece, k, farther, other, nearest)) {
          longest = length;
          result.long_edge = k;
        }
      }
    }
    return result;
  }

  bool smooth_;
  bool closed_;
  std::vector<Vector3d> points_;
  std::vector<Piece> pieces_;
  std::optional<SurfaceIndex> own_;  ///< the surface, where its ends are asked for
  std::map<std::pair<int, int>, Split> splits_;
};

Obstacles obstacles(std::span<const OtherSurface> others, bool with_distances) {
  Obstacles result;
  for (const OtherSurface& other : others) {
    const std::vector<std::array<int, 3>> triangles = triangles_of(*other.patches);
    if (triangles.empty()) continue;
    Obstacles::One one;
    one.low = one.high = other.patches->points[static_cast<std::size_t>(triangles[0][0])];
    for (const std::array<int, 3>& corners : triangles) {
      Triangle triangle;
      for (std::size_t k = 0; k < 3; ++k) {
        triangle[k] = other.patches->points[static_cast<std::size_t>(corners[k])];
        one.low = one.low.cwiseMin(triangle[k]);
        one.high = one.high.cwiseMax(triangle[k]);
      }
      one.triangle.push_back(triangle);
    }
    one.two_sided = other.two_sided;
    if (with_distances) one.index.emplace(other.patches->points, triangles);
    result.object.push_back(std::move(one));
  }
  return result;
}

}  // namespace

PatchMesh halve_turns(const PatchMesh& mesh, double most_turn_deg) {
  Refiner refiner(mesh);
  refiner.halve_turns(most_turn_deg * std::numbers::pi / 180.0);
  return refiner.mesh();
}

PatchMesh follow_contacts(const PatchMesh& mesh, std::span<const OtherSurface> others, int halvings) {
  const Obstacles surfaces = obstacles(others, halvings > 0);
  Refiner refiner(mesh);
  refiner.cut_along(surfaces);
  if (halvings > 0) refiner.grade_towards(surfaces, halvings);
  return refiner.mesh();
}

}  // namespace interglow::mesh
