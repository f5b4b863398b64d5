// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/adaptive_remesh.h"

// OpenMesh appends default-constructed points, which Eigen leaves unset on purpose (GCC 12).
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
// After the mesh, which declares what it specialises.
#include <OpenMesh/Core/Geometry/EigenVectorT.hh>

#include <tbb/parallel_for.h>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <set>

#include "diagnostics/error.h"

namespace interglow::mesh {
namespace {

using Eigen::Vector3d;

struct MeshTraits : OpenMesh::DefaultTraits {
  using Point = Eigen::Vector3d;
  using Normal = Eigen::Vector3d;
  VertexAttributes(OpenMesh::Attributes::Status);
  EdgeAttributes(OpenMesh::Attributes::Status);
  FaceAttributes(OpenMesh::Attributes::Status);
  HalfedgeAttributes(OpenMesh::Attributes::PrevHalfedge | OpenMesh::Attributes::Status);
};
using Mesh = OpenMesh::TriMesh_ArrayKernelT<MeshTraits>;
using Vertex = Mesh::VertexHandle;
using Edge = Mesh::EdgeHandle;
using Halfedge = Mesh::HalfedgeHandle;

enum class Kind : char { kSmooth, kCurve, kCorner };

// Edges between 4/5 and 4/3 of the wanted length stay [Botsch and Kobbelt 2004].
constexpr double kShort = 0.8;
constexpr double kLong = 4.0 / 3.0;

class Remesher {
 public:
  Remesher(const FittedSurface& surface, const SurfaceIndex& index, const AdaptiveRemeshParams& params)
      : surface_(surface),
        index_(index),
        params_(params),
        creases_(surface.points, surface.creases),
        borders_(surface.points, surface.borders) {
    build();
    find_corners();
  }

  RemeshedSurface run() {
    for (int round = 0; round < params_.rounds; ++round) {
      refresh_lengths();
      split_long();
      collapse_short();
      flip_to_delaunay();
      for (int i = 0; i < (round + 1 == params_.rounds ? 3 : 1); ++i) {
        relocate();
        flip_to_delaunay();
      }
      if (params_.triangles)
        scale_ *= std::sqrt(static_cast<double>(mesh_.n_faces()) / static_cast<double>(*params_.triangles));
    }
    return result();
  }

 private:
  double length(Edge e) const { return mesh_.calc_edge_length(e); }
  double wanted(Edge e) const {
    const Halfedge h = mesh_.halfedge_handle(e, 0);
    return (wanted_[mesh_.from_vertex_handle(h).idx()] + wanted_[mesh_.to_vertex_handle(h).idx()]) / 2;
  }
  bool is_curve(Edge e) const { return mesh_.is_boundary(e) || mesh_.status(e).feature(); }
  bool is_locked(Vertex v) const { return mesh_.status(v).locked(); }
  bool is_locked(Edge e) const {
    const Halfedge h = mesh_.halfedge_handle(e, 0);
    return is_curve(e) && is_locked(mesh_.from_vertex_handle(h)) && is_locked(mesh_.to_vertex_handle(h));
  }
  Kind kind(Vertex v) const { return kind_[v.idx()]; }

  void build() {
    for (std::size_t i = 0; i < surface_.points.size(); ++i) mesh_.add_vertex(surface_.points[i]);
    on_.resize(surface_.points.size());
    for (std::size_t t = 0; t < surface_.triangles.size(); ++t) {
      const auto& corners = surface_.triangles[t];
      const auto face = mesh_.add_face(Vertex(corners[0]), Vertex(corners[1]), Vertex(corners[2]));
      if (!face.is_valid())
        throw InvalidInput(
            "A triangle could not be joined to its neighbours: several surfaces meet at one of its points. "
            "Repair the mesh first.");
      for (int k = 0; k < 3; ++k) {
        SurfacePoint& on = on_[corners[k]];
        if (on.triangle >= 0) continue;
        on.triangle = static_cast<int>(t);
        on.point = surface_.points[corners[k]];
        on.barycentric = Vector3d::Unit(k);
      }
    }
    mark_creases();
    for (int v : params_.locked_points) mesh_.status(Vertex(v)).set_locked(true);
    wanted_.assign(mesh_.n_vertices(), 0);
  }

  /// The creases at which the surface still bends when each side is averaged over one wanted length.
  std::vector<std::array<int, 2>> coarse_creases() const {
    std::vector<char> keep(surface_.creases.size(), 0);
    tbb::parallel_for(std::size_t{0}, keep.size(), [&](std::size_t i) {
      const auto& [a, b] = surface_.creases[i];
      keep[i] =
          bend_deg(mesh_.find_halfedge(Vertex(a), Vertex(b)), params_.edge_length(on_[a])) >= params_.feature_angle_deg;
    });
    std::vector<std::array<int, 2>> kept;
    for (std::size_t i = 0; i < keep.size(); ++i)
      if (keep[i]) kept.push_back(surface_.creases[i]);
    return kept;
  }

  /// Angle between the mean normals of the connected surface within `reach` of an edge, on either side of it.
  double bend_deg(Halfedge h, double reach) const {
    const Vector3d from = mesh_.point(mesh_.from_vertex_handle(h)), to = mesh_.point(mesh_.to_vertex_handle(h));
    const Vector3d middle = (from + to) / 2, along = (to - from).normalized();
    const Vector3d apex = mesh_.point(mesh_.to_vertex_handle(mesh_.next_halfedge_handle(h)));
    const Vector3d other =
        mesh_.point(mesh_.to_vertex_handle(mesh_.next_halfedge_handle(mesh_.opposite_halfedge_handle(h))));
    // From the right side to the left one, across the edge.
    const Vector3d across = (apex - middle).normalized() - (other - middle).normalized();
    std::array<Vector3d, 2> sum = {Vector3d::Zero(), Vector3d::Zero()};
    std::vector<Mesh::FaceHandle> found = {mesh_.face_handle(h), mesh_.face_handle(mesh_.opposite_halfedge_handle(h))};
    std::set<int> seen = {found[0].idx(), found[1].idx()};
    for (std::size_t next = 0; next < found.size(); ++next) {
      const auto face = found[next];
      std::array<Vector3d, 3> p;
      int k = 0;
      for (auto it = mesh_.cfv_ccwiter(face); it.is_valid(); ++it) p[k++] = mesh_.point(*it);
      const Vector3d from_middle = (p[0] + p[1] + p[2]) / 3 - middle;
      // The two triangles at the edge count whatever their size.
      if (next > 1 && from_middle.norm() > reach) continue;
      const bool left = next < 2 ? next == 0 : (from_middle - from_middle.dot(along) * along).dot(across) > 0;
      sum[left ? 0 : 1] += (p[1] - p[0]).cross(p[2] - p[0]);
      for (auto it = mesh_.cff_iter(face); it.is_valid(); ++it)
        if (seen.insert(it->idx()).second) found.push_back(*it);
    }
    return std::atan2(sum[0].cross(sum[1]).norm(), sum[0].dot(sum[1])) * 180 / std::numbers::pi;
  }

  /// Marks connected creases that are longer than a few wanted edges; shorter ones no patch could follow.
  void mark_creases() {
    constexpr double kShortest = 4;  // wanted lengths
    std::vector<int> parent(surface_.points.size());
    std::iota(parent.begin(), parent.end(), 0);
    const auto root = [&](int v) {
      while (parent[v] != v) v = parent[v] = parent[parent[v]];
      return v;
    };
    const std::vector<std::array<int, 2>> creases = coarse_creases();
    for (const auto& [a, b] : creases) parent[root(a)] = root(b);
    std::vector<double> lengths(surface_.points.size(), 0);
    const auto measure = [&](int a, int b) { return (surface_.points[a] - surface_.points[b]).norm(); };
    for (const auto& [a, b] : creases) lengths[root(a)] += measure(a, b) / params_.edge_length(on_[a]);
    for (const auto& [a, b] : creases)
      if (lengths[root(a)] > kShortest)
        mesh_.status(mesh_.edge_handle(mesh_.find_halfedge(Vertex(a), Vertex(b)))).set_feature(true);
  }

  /// The curve edges at a vertex.
  std::vector<Halfedge> curve_halfedges(Vertex v) const {
    std::vector<Halfedge> found;
    for (auto it = mesh_.cvoh_iter(v); it.is_valid(); ++it)
      if (is_curve(mesh_.edge_handle(*it))) found.push_back(*it);
    return found;
  }

  /// Direction from `v` to the point of the curve about `reach` away along the edge `h`.
  Vector3d direction_along(Halfedge h, double reach) const {
    const Vector3d start = mesh_.point(mesh_.from_vertex_handle(h));
    const Vertex first = mesh_.from_vertex_handle(h);
    double travelled = mesh_.calc_edge_length(mesh_.edge_handle(h));
    while (travelled < reach) {
      const Vertex v = mesh_.to_vertex_handle(h);
      const std::vector<Halfedge> next = curve_halfedges(v);
      if (next.size() != 2 || v == first) break;
      h = mesh_.to_vertex_handle(next[0]) == mesh_.from_vertex_handle(h) ? next[1] : next[0];
      travelled += mesh_.calc_edge_length(mesh_.edge_handle(h));
    }
    return (mesh_.point(mesh_.to_vertex_handle(h)) - start).normalized();
  }

  void find_corners() {
    kind_.assign(mesh_.n_vertices(), Kind::kSmooth);
    std::vector<double> turn(mesh_.n_vertices(), 0);
    for (const Vertex v : mesh_.vertices()) {
      if (mesh_.is_isolated(v)) continue;
      const std::vector<Halfedge> curve = curve_halfedges(v);
      if (curve.empty()) continue;
      kind_[v.idx()] = Kind::kCurve;
      if (curve.size() != 2 || is_locked(v)) {
        kind_[v.idx()] = Kind::kCorner;
        continue;
      }
      // Seen over the wanted length, so that a ragged border has no corners of its own.
      const double reach = params_.edge_length(on_[v.idx()]);
      const double cosine = -direction_along(curve[0], reach).dot(direction_along(curve[1], reach));
      turn[v.idx()] = std::acos(std::clamp(cosine, -1.0, 1.0)) * 180 / std::numbers::pi;
    }
    for (const Vertex v : mesh_.vertices()) {
      const double here = turn[v.idx()];
      if (here <= params_.corner_angle_deg) continue;
      bool is_sharpest = true;
      for (Halfedge h : curve_halfedges(v)) {
        const double reach = params_.edge_length(on_[v.idx()]);
        double travelled = 0;
        Vertex at = v;
        while (is_sharpest && travelled < reach) {
          at = mesh_.to_vertex_handle(h);
          travelled += mesh_.calc_edge_length(mesh_.edge_handle(h));
          if (travelled > reach) break;
          const double there = turn[at.idx()];
          if (there > here || (there == here && at.idx() < v.idx() && at != v)) is_sharpest = false;
          const std::vector<Halfedge> next = curve_halfedges(at);
          if (next.size() != 2 || at == v) break;
          h = mesh_.to_vertex_handle(next[0]) == mesh_.from_vertex_handle(h) ? next[1] : next[0];
        }
      }
      // An edge longer than the wanted length ends the walk at once: every real bend of a coarse curve is a corner.
      if (is_sharpest) kind_[v.idx()] = Kind::kCorner;
    }
  }

  void refresh_lengths() {
    wanted_.resize(mesh_.n_vertices());
    for (const Vertex v : mesh_.vertices())
      if (!mesh_.is_isolated(v)) wanted_[v.idx()] = scale_ * params_.edge_length(on_[v.idx()]);
    limit_gradation();
  }

  void limit_gradation() {
    for (int sweep = 0; sweep < 4; ++sweep)
      for (const Edge e : mesh_.edges()) {
        const Halfedge h = mesh_.halfedge_handle(e, 0);
        double& a = wanted_[mesh_.from_vertex_handle(h).idx()];
        double& b = wanted_[mesh_.to_vertex_handle(h).idx()];
        const double rise = params_.gradation * length(e);
        a = std::min(a, b + rise);
        b = std::min(b, a + rise);
      }
  }

  /// Puts a vertex on the surface near `target`; curve vertices stay on their curve.
  void place(Vertex v, Vector3d target, bool on_border) {
    const SurfacePoint hint = on_[v.idx()];
    if (kind(v) == Kind::kCurve) {
      const CurveIndex& curve = on_border ? borders_ : creases_;
      if (!curve.empty()) target = curve.closest(target);
    }
    SurfacePoint on = index_.closest(target, hint);
    on_[v.idx()] = on;
    mesh_.set_point(v, position(on, target, kind(v) == Kind::kCurve && !on_border));
    wanted_[v.idx()] = scale_ * params_.edge_length(on);
  }

  /// Two quadrics meet at a crease; its own polyline is the better curve.
  Vector3d position(const SurfacePoint& on, const Vector3d& on_crease, bool is_crease) const {
    return is_crease ? on_crease : surface_.at(on.triangle, on.barycentric).first;
  }

  void split_long() {
    for (int pass = 0; pass < 12; ++pass) {
      std::vector<std::pair<double, int>> longest;
      for (const Edge e : mesh_.edges())
        if (!is_locked(e) && length(e) > kLong * wanted(e)) longest.emplace_back(-length(e), e.idx());
      if (longest.empty()) return;
      std::sort(longest.begin(), longest.end());
      for (const auto& entry : longest) {
        const Edge e(entry.second);
        const Halfedge h = mesh_.halfedge_handle(e, 0);
        const Vertex a = mesh_.from_vertex_handle(h), b = mesh_.to_vertex_handle(h);
        const bool border = mesh_.is_boundary(e), crease = mesh_.status(e).feature();
        const Vertex middle = mesh_.add_vertex((mesh_.point(a) + mesh_.point(b)) / 2);
        kind_.push_back(border || crease ? Kind::kCurve : Kind::kSmooth);
        on_.push_back(on_[a.idx()]);
        wanted_.push_back((wanted_[a.idx()] + wanted_[b.idx()]) / 2);
        mesh_.split(e, middle);
        if (crease)
          for (const Vertex end : {a, b})
            mesh_.status(mesh_.edge_handle(mesh_.find_halfedge(end, middle))).set_feature(true);
        place(middle, mesh_.point(middle), border);
      }
      limit_gradation();
    }
  }

  /// True if no triangle around `moving`, apart from those that vanish, turns over or becomes a needle when it moves to
  /// `to`.
  bool keeps_orientation(Vertex moving, Vertex partner, const Vector3d& to) const {
    for (auto it = mesh_.cvih_iter(moving); it.is_valid(); ++it) {
      if (mesh_.is_boundary(*it)) continue;
      const Vertex a = mesh_.from_vertex_handle(*it);
      const Vertex b = mesh_.to_vertex_handle(mesh_.next_halfedge_handle(*it));
      if (a == partner || b == partner) continue;
      const Vector3d &p = mesh_.point(a), &q = mesh_.point(b), &old = mesh_.point(moving);
      const Vector3d before = (old - p).cross(q - p), after = (to - p).cross(q - p);
      if (after.dot(before) < 0.3 * after.norm() * before.norm()) return false;
      const double longest = std::max({(to - p).squaredNorm(), (q - p).squaredNorm(), (to - q).squaredNorm()});
      if (after.norm() < 0.05 * longest && after.norm() < 0.5 * before.norm()) return false;
    }
    return true;
  }

  void collapse_short() {
    std::vector<std::pair<double, int>> shortest;
    for (int pass = 0; pass < 12; ++pass) {
      shortest.clear();
      for (const Edge e : mesh_.edges())
        if (!mesh_.status(e).deleted() && length(e) < kShort * wanted(e))
          shortest.emplace_back(length(e) / wanted(e), e.idx());
      std::sort(shortest.begin(), shortest.end());
      int collapsed = 0;
      for (const auto& entry : shortest) {
        const Edge e(entry.second);
        if (!mesh_.status(e).deleted() && length(e) < kShort * wanted(e)) collapsed += collapse(e);
      }
      if (collapsed * 50 < static_cast<int>(shortest.size()) || collapsed == 0) break;
    }
    garbage_collection();
  }

  bool collapse(Edge e) {
    Halfedge h = mesh_.halfedge_handle(e, 0);
    // The vertex of the lower kind goes.
    if (kind(mesh_.from_vertex_handle(h)) > kind(mesh_.to_vertex_handle(h))) h = mesh_.opposite_halfedge_handle(h);
    const Vertex goes = mesh_.from_vertex_handle(h), stays = mesh_.to_vertex_handle(h);
    // Corners closer than half the wanted length are one corner to these patches, and creases are one crease.
    const bool is_close = length(e) <= 0.5 * wanted(e) && !is_locked(goes);
    const bool merges_creases = is_close && !mesh_.is_boundary(goes) && !mesh_.is_boundary(stays);
    if (kind(goes) == Kind::kCorner && !(is_curve(e) ? is_close : merges_creases)) return false;
    if (kind(goes) == Kind::kCurve && !is_curve(e) && !merges_creases) return false;
    if (!mesh_.is_collapse_ok(h)) return false;
    Vector3d to = mesh_.point(stays);
    SurfacePoint on = on_[stays.idx()];
    const bool border = mesh_.is_boundary(e);
    if (kind(goes) == kind(stays) && kind(goes) != Kind::kCorner) {
      const Vector3d middle = (mesh_.point(goes) + mesh_.point(stays)) / 2;
      Vector3d target = middle;
      if (kind(goes) == Kind::kCurve) target = (border ? borders_ : creases_).closest(middle);
      on = index_.closest(target, on);
      to = position(on, target, kind(goes) == Kind::kCurve && !border);
    }
    for (const Vertex v : {goes, stays}) {
      const Vertex other = v == goes ? stays : goes;
      if (!keeps_orientation(v, other, to)) return false;
      for (auto it = mesh_.cvv_iter(v); it.is_valid(); ++it)
        if (*it != other &&
            (mesh_.point(*it) - to).norm() > kLong * (wanted_[it->idx()] + wanted_[stays.idx()]) / 2 * 1.05)
          return false;
    }
    // The edges of the two vanishing triangles merge in pairs; what one of a pair was, the other must be.
    std::vector<Vertex> to_mark;
    for (const Halfedge side : {h, mesh_.opposite_halfedge_handle(h)}) {
      if (mesh_.is_boundary(side)) continue;
      const Vertex apex = mesh_.to_vertex_handle(mesh_.next_halfedge_handle(side));
      const auto feature = [&](Vertex v) {
        return mesh_.status(mesh_.edge_handle(mesh_.find_halfedge(v, apex))).feature();
      };
      if (feature(goes) || feature(stays)) to_mark.push_back(apex);
    }
    mesh_.collapse(h);
    for (const Vertex apex : to_mark) {
      const Halfedge edge = mesh_.find_halfedge(stays, apex);
      if (edge.is_valid()) mesh_.status(mesh_.edge_handle(edge)).set_feature(true);
    }
    mesh_.set_point(stays, to);
    on_[stays.idx()] = on;
    wanted_[stays.idx()] = std::min(wanted_[stays.idx()], scale_ * params_.edge_length(on));
    return true;
  }

  void garbage_collection() {
    std::vector<Mesh::VertexHandle> vertices;
    for (std::size_t i = 0; i < mesh_.n_vertices(); ++i) vertices.emplace_back(static_cast<int>(i));
    std::vector<Vertex*> vertex_pointers;
    for (Vertex& v : vertices) vertex_pointers.push_back(&v);
    std::vector<Halfedge*> no_halfedges;
    std::vector<Mesh::FaceHandle*> no_faces;
    mesh_.garbage_collection(vertex_pointers, no_halfedges, no_faces);
    std::vector<Kind> kind(mesh_.n_vertices());
    std::vector<SurfacePoint> on(mesh_.n_vertices());
    std::vector<double> wanted(mesh_.n_vertices());
    for (std::size_t i = 0; i < vertices.size(); ++i) {
      if (!vertices[i].is_valid()) continue;
      kind[vertices[i].idx()] = kind_[i];
      on[vertices[i].idx()] = on_[i];
      wanted[vertices[i].idx()] = wanted_[i];
    }
    kind_ = std::move(kind);
    on_ = std::move(on);
    wanted_ = std::move(wanted);
  }

  static double corner_angle(const Vector3d& at, const Vector3d& a, const Vector3d& b) {
    return std::atan2((a - at).cross(b - at).norm(), (a - at).dot(b - at));
  }

  void flip_to_delaunay() {
    for (int pass = 0; pass < 6; ++pass) {
      int flipped = 0;
      for (const Edge e : mesh_.edges()) {
        if (is_curve(e) || !mesh_.is_flip_ok(e)) continue;
        const Halfedge h = mesh_.halfedge_handle(e, 0), o = mesh_.halfedge_handle(e, 1);
        const Vector3d &a = mesh_.point(mesh_.from_vertex_handle(h)), &b = mesh_.point(mesh_.to_vertex_handle(h));
        const Vector3d& c = mesh_.point(mesh_.to_vertex_handle(mesh_.next_halfedge_handle(h)));
        const Vector3d& d = mesh_.point(mesh_.to_vertex_handle(mesh_.next_halfedge_handle(o)));
        // 1e-6: a square's diagonal stays.
        if (corner_angle(c, a, b) + corner_angle(d, a, b) < std::numbers::pi + 1e-6) continue;
        const Vector3d before_1 = (b - a).cross(c - a), before_2 = (d - a).cross(b - a);
        const Vector3d after_1 = (d - c).cross(b - c), after_2 = (a - c).cross(d - c);
        const Vector3d mean = before_1 + before_2;
        if (after_1.dot(mean) < 0.5 * after_1.norm() * mean.norm() ||
            after_2.dot(mean) < 0.5 * after_2.norm() * mean.norm())
          continue;
        mesh_.flip(e);
        ++flipped;
      }
      if (flipped == 0) return;
    }
  }

  void relocate() {
    const int count = static_cast<int>(mesh_.n_vertices());
    std::vector<Vector3d> targets(count);
    std::vector<char> moves(count, 0);
    for (const Vertex v : mesh_.vertices()) {
      if (mesh_.is_isolated(v) || kind(v) == Kind::kCorner) continue;
      const Vector3d here = mesh_.point(v);
      Vector3d sum = Vector3d::Zero();
      double weights = 0;
      if (kind(v) == Kind::kCurve) {
        for (const Halfedge h : curve_halfedges(v)) {
          const Vector3d middle = (here + mesh_.point(mesh_.to_vertex_handle(h))) / 2;
          const double w = length(mesh_.edge_handle(h)) / wanted(mesh_.edge_handle(h));
          sum += w * middle;
          weights += w;
        }
      } else {
        for (auto it = mesh_.cvf_iter(v); it.is_valid(); ++it) {
          Vector3d centre = Vector3d::Zero();
          double size = 0;
          std::array<Vector3d, 3> p;
          int k = 0;
          for (auto corner = mesh_.cfv_iter(*it); corner.is_valid(); ++corner, ++k) {
            p[k] = mesh_.point(*corner);
            centre += p[k] / 3;
            size += wanted_[corner->idx()] / 3;
          }
          const double w = (p[1] - p[0]).cross(p[2] - p[0]).norm() / (size * size);
          sum += w * centre;
          weights += w;
        }
      }
      if (!(weights > 0)) continue;
      targets[v.idx()] = sum / weights;
      moves[v.idx()] = 1;
    }
    for (const Vertex v : mesh_.vertices()) {
      if (!moves[v.idx()]) continue;
      const Vector3d old = mesh_.point(v);
      const SurfacePoint old_on = on_[v.idx()];
      place(v, targets[v.idx()], mesh_.is_boundary(v));
      const Vector3d now = mesh_.point(v);
      mesh_.set_point(v, old);
      if (keeps_orientation(v, Vertex(), now)) {
        mesh_.set_point(v, now);
      } else {
        on_[v.idx()] = old_on;
      }
    }
    limit_gradation();
  }

  RemeshedSurface result() const {
    RemeshedSurface out;
    std::vector<int> index(mesh_.n_vertices(), -1);
    for (const Vertex v : mesh_.vertices()) {
      if (mesh_.is_isolated(v)) continue;
      index[v.idx()] = static_cast<int>(out.points.size());
      out.points.push_back(mesh_.point(v));
      out.on_surface.push_back(on_[v.idx()]);
      out.is_locked.push_back(is_locked(v));
    }
    for (const auto f : mesh_.faces()) {
      std::array<int, 3> corners{};
      int k = 0;
      for (auto it = mesh_.cfv_ccwiter(f); it.is_valid(); ++it) corners[k++] = index[it->idx()];
      out.triangles.push_back(corners);
    }
    return out;
  }

  const FittedSurface& surface_;
  const SurfaceIndex& index_;
  const AdaptiveRemeshParams& params_;
  CurveIndex creases_, borders_;
  Mesh mesh_;
  std::vector<Kind> kind_;
  std::vector<SurfacePoint> on_;
  std::vector<double> wanted_;
  double scale_ = 1;  ///< on the wanted lengths, to arrive at the wanted number of triangles
};

}  // namespace

RemeshedSurface adaptive_remesh(const FittedSurface& surface, const SurfaceIndex& index,
                                const AdaptiveRemeshParams& params) {
  return Remesher(surface, index, params).run();
}

}  // namespace interglow::mesh
