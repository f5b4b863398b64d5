// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/repair.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "mesh/flat_faces.h"
#include "mesh/hole_filling.h"
#include "mesh/manifold.h"
#include "mesh/weld_points.h"

namespace interglow::mesh {
namespace {

using detail::Neighbours;

struct Components {
  std::vector<int> of_face;
  std::vector<double> area_mm2;
  std::vector<bool> closed;
  std::size_t count() const { return area_mm2.size(); }
};

Eigen::Vector3d vector_area(const TriangleMesh& mesh, const std::array<int, 3>& t) {
  return 0.5 * (mesh.points[t[1]] - mesh.points[t[0]]).cross(mesh.points[t[2]] - mesh.points[t[0]]);
}

Components find_components(const TriangleMesh& mesh, const Neighbours& across) {
  Components components;
  components.of_face.assign(mesh.triangles.size(), -1);
  std::vector<int> to_visit;
  for (std::size_t seed = 0; seed < mesh.triangles.size(); ++seed) {
    if (components.of_face[seed] >= 0) continue;
    const int component = static_cast<int>(components.count());
    components.area_mm2.push_back(0.0);
    components.closed.push_back(true);
    components.of_face[seed] = component;
    to_visit.assign(1, static_cast<int>(seed));
    while (!to_visit.empty()) {
      const int face = to_visit.back();
      to_visit.pop_back();
      components.area_mm2[component] += vector_area(mesh, mesh.triangles[face]).norm();
      for (const int other : across[face]) {
        if (other < 0) {
          components.closed[component] = false;
        } else if (components.of_face[other / 3] < 0) {
          components.of_face[other / 3] = component;
          to_visit.push_back(other / 3);
        }
      }
    }
  }
  return components;
}

void drop_unused_points(TriangleMesh& mesh) {
  std::vector<int> new_index(mesh.points.size(), -1);
  for (const auto& triangle : mesh.triangles) {
    for (const int corner : triangle) new_index[corner] = 0;
  }
  int next = 0;
  for (std::size_t i = 0; i < mesh.points.size(); ++i) {
    if (new_index[i] < 0) continue;
    new_index[i] = next;
    mesh.points[next++] = mesh.points[i];
  }
  mesh.points.resize(next);
  for (auto& triangle : mesh.triangles) {
    for (int& corner : triangle) corner = new_index[corner];
  }
}

/// How often a closed component winds around a point: 0 outside, +-1 inside [van Oosterom and Strackee 1983, solid
/// angle].
double winding_number(const TriangleMesh& mesh, const Components& components, int component,
                      const Eigen::Vector3d& point) {
  double solid_angle = 0.0;
  for (std::size_t face = 0; face < mesh.triangles.size(); ++face) {
    if (components.of_face[face] != component) continue;
    const auto& t = mesh.triangles[face];
    const Eigen::Vector3d a = mesh.points[t[0]] - point;
    const Eigen::Vector3d b = mesh.points[t[1]] - point;
    const Eigen::Vector3d c = mesh.points[t[2]] - point;
    const double la = a.norm();
    const double lb = b.norm();
    const double lc = c.norm();
    solid_angle += 2.0 * std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  return solid_angle / (4.0 * M_PI);
}

class Repair {
 public:
  Repair(TriangleMesh mesh, const RepairParams& params) : mesh_(std::move(mesh)), params_(params) {}

  Repaired run() {
    if (mesh_.triangles.empty()) throw InvalidInput("The mesh has no triangles to repair.");
    weld();
    clean_topology();
    if (params_.fill_holes_up_to_edges) fill_holes();
    remove_small_components();
    turn_outward();
    measure();
    warn();
    return {std::move(mesh_), std::move(report_)};
  }

 private:
  void weld() {
    WeldedPoints welded = weld_equal_points(mesh_.points);
    apply(std::move(welded));
    if (!params_.weld_distance) return;
    Eigen::AlignedBox3d box;
    for (const auto& triangle : mesh_.triangles) {
      for (const int corner : triangle) box.extend(mesh_.points[corner]);
    }
    const double distance = *params_.weld_distance * box.diagonal().norm();
    if (distance > 0.0) apply(weld_near_points(mesh_.points, distance));
  }
  void apply(WeldedPoints welded) {
    report_.points_merged += mesh_.points.size() - welded.points.size();
    mesh_.points = std::move(welded.points);
    for (auto& triangle : mesh_.triangles) {
      for (int& corner : triangle) corner = welded.index_of[corner];
    }
  }

  void clean_topology() {
    const std::size_t points_before = used_points();
    report_.unused_points_removed += mesh_.points.size() - points_before;
    detail::FlatFaces flat = detail::remove_flat_faces(std::move(mesh_));
    report_.points_merged += flat.points_merged;
    report_.faces_with_repeated_corner_removed += flat.repeated_corner;
    report_.duplicate_faces_removed += flat.duplicates;
    report_.flat_faces_removed += flat.removed;
    report_.flat_faces_flipped += flat.flipped;
    if (flat.mesh.triangles.empty()) {
      throw InvalidInput(
          "No triangle with an area is left: all are flat, repeated or incomplete. Export the scan again.");
    }
    detail::Manifold manifold = detail::make_manifold(flat.mesh);
    report_.edges_split += manifold.edges_split;
    report_.points_split += manifold.points_split;
    report_.faces_turned += manifold.faces_turned;
    report_.unorientable_edges_cut += manifold.unorientable_edges;
    report_.faces_detached += manifold.faces_detached;
    mesh_ = std::move(manifold.mesh);
    across_ = detail::neighbours_across_edges(mesh_);
  }

  std::size_t used_points() const {
    std::vector<bool> used(mesh_.points.size(), false);
    for (const auto& triangle : mesh_.triangles) {
      for (const int corner : triangle) used[corner] = true;
    }
    return static_cast<std::size_t>(std::count(used.begin(), used.end(), true));
  }

  /// The loops of border edges, each in the direction of faces that would close it.
  std::vector<std::vector<int>> border_loops() const {
    std::vector<int> next(mesh_.points.size(), -1);
    for (std::size_t face = 0; face < mesh_.triangles.size(); ++face) {
      for (int k = 0; k < 3; ++k) {
        if (across_[face][k] < 0) next[mesh_.triangles[face][(k + 1) % 3]] = mesh_.triangles[face][k];
      }
    }
    std::vector<std::vector<int>> loops;
    for (std::size_t first = 0; first < next.size(); ++first) {
      if (next[first] < 0) continue;
      std::vector<int> loop;
      for (int point = static_cast<int>(first); point >= 0;) {
        loop.push_back(point);
        point = std::exchange(next[point], -1);
      }
      loop.pop_back();  // the first point again
      loops.push_back(std::move(loop));
    }
    return loops;
  }

  void fill_holes() {
    bool changed = false;
    for (const std::vector<int>& loop : border_loops()) {
      if (loop.size() > static_cast<std::size_t>(*params_.fill_holes_up_to_edges)) continue;
      std::vector<Eigen::Vector3d> points;
      for (const int i : loop) points.push_back(mesh_.points[i]);
      const auto patch = loop.size() == 3 ? std::vector<std::array<int, 3>>{{0, 1, 2}} : detail::span_loop(points);
      if (patch.empty()) continue;
      for (const auto& [a, b, c] : patch) mesh_.triangles.push_back({loop[a], loop[b], loop[c]});
      ++report_.holes_filled;
      report_.faces_added += patch.size();
      changed = true;
    }
    if (!changed) return;
    // A patch may hold flat faces, or edges and faces that are there already (perhaps between split points).
    const RepairReport before = std::exchange(report_, {});
    weld();
    clean_topology();
    const RepairReport after = std::exchange(report_, before);
    report_.edges_split = after.edges_split;
    report_.points_split = after.points_split;
    report_.unorientable_edges_cut = after.unorientable_edges_cut;
    report_.faces_detached = after.faces_detached;
    report_.faces_turned += after.faces_turned;
    report_.faces_added -= std::min(report_.faces_added, after.duplicate_faces_removed + after.flat_faces_removed);
  }

  void remove_small_components() {
    const Components components = find_components(mesh_, across_);
    const double whole = std::accumulate(components.area_mm2.begin(), components.area_mm2.end(), 0.0);
    const auto is_small = [&](int component) {
      return components.area_mm2[component] < params_.smallest_component_share * whole;
    };
    for (std::size_t i = 0; i < components.count(); ++i) {
      if (is_small(static_cast<int>(i))) ++report_.components_removed;
    }
    if (report_.components_removed == 0) return;
    if (report_.components_removed == components.count()) {
      throw InvalidInput(
          fmt::format("Each of the {} pieces has less than {:g} of the whole area (smallest_component_share). The "
                      "triangles do not form a surface; weld them (weld_distance) or keep small pieces (0).",
                      components.count(), params_.smallest_component_share));
    }
    std::size_t index = 0;
    report_.faces_of_removed_components =
        std::erase_if(mesh_.triangles, [&](const auto&) { return is_small(components.of_face[index++]); });
    drop_unused_points(mesh_);
    across_ = detail::neighbours_across_edges(mesh_);
  }

  void turn_outward() {
    components_ = find_components(mesh_, across_);
    if (!params_.closed_outward) return;
    std::vector<double> volume(components_.count(), 0.0);
    std::vector<int> first_point(components_.count(), -1);
    for (std::size_t face = 0; face < mesh_.triangles.size(); ++face) {
      const auto& t = mesh_.triangles[face];
      const int component = components_.of_face[face];
      if (first_point[component] < 0) first_point[component] = t[0];
      // Around a point of the component: far from the origin the volumes of the tetrahedra would cancel badly.
      volume[component] += (mesh_.points[t[0]] - mesh_.points[first_point[component]]).dot(vector_area(mesh_, t)) / 3.0;
    }
    std::vector<bool> turned(components_.count(), false);
    for (std::size_t i = 0; i < components_.count(); ++i) {
      if (!components_.closed[i] || volume[i] >= 0.0) continue;
      int depth = 0;
      for (std::size_t other = 0; other < components_.count(); ++other) {
        if (other == i || !components_.closed[other]) continue;
        const double windings =
            winding_number(mesh_, components_, static_cast<int>(other), mesh_.points[first_point[i]]);
        if (std::abs(windings) > 0.5) ++depth;
      }
      turned[i] = depth % 2 == 0;
      if (turned[i]) ++report_.components_turned_outward;
    }
    if (report_.components_turned_outward == 0) return;
    for (std::size_t face = 0; face < mesh_.triangles.size(); ++face) {
      if (turned[components_.of_face[face]]) std::swap(mesh_.triangles[face][1], mesh_.triangles[face][2]);
    }
  }

  void measure() {
    report_.components = components_.count();
    for (const auto& triangle : mesh_.triangles) report_.area_mm2 += vector_area(mesh_, triangle).norm();
    for (const std::vector<int>& loop : border_loops()) {
      BorderLoop border{.edges = static_cast<int>(loop.size()), .length_mm = 0.0, .area_mm2 = 0.0};
      Eigen::Vector3d twice_area = Eigen::Vector3d::Zero();
      const Eigen::Vector3d& origin = mesh_.points[loop.front()];
      for (std::size_t k = 0; k < loop.size(); ++k) {
        const Eigen::Vector3d& here = mesh_.points[loop[k]];
        const Eigen::Vector3d& there = mesh_.points[loop[(k + 1) % loop.size()]];
        border.length_mm += (there - here).norm();
        twice_area += (here - origin).cross(there - origin);
      }
      border.area_mm2 = 0.5 * twice_area.norm();
      report_.borders.push_back(border);
    }
    std::stable_sort(report_.borders.begin(), report_.borders.end(),
                     [](const BorderLoop& a, const BorderLoop& b) { return a.length_mm > b.length_mm; });
    report_.closed = report_.borders.empty();
    if (params_.count_self_intersections) report_.self_intersections = detail::count_self_intersections(mesh_);
  }

  void warn() {
    const auto say = [&](std::size_t count, std::string_view one, std::string_view many) {
      if (count > 0) report_.warnings.push_back(fmt::format("{} {}.", count, count == 1 ? one : many));
    };
    const RepairReport& r = report_;
    say(r.points_merged, "point merged into an equal or near one", "points merged into equal or near ones");
    say(r.unused_points_removed, "point without faces removed", "points without faces removed");
    say(r.faces_with_repeated_corner_removed, "face with a repeated corner removed",
        "faces with a repeated corner removed");
    say(r.duplicate_faces_removed, "duplicate face removed", "duplicate faces removed");
    say(r.flat_faces_removed, "face without area removed", "faces without area removed");
    say(r.flat_faces_flipped, "face without area joined to its neighbour",
        "faces without area joined to their neighbours");
    say(r.edges_split, "edge of three or more faces split", "edges of three or more faces split");
    say(r.points_split, "point copied where fans of faces met in it", "points copied where fans of faces met in them");
    say(r.faces_turned, "face turned to agree with its neighbours", "faces turned to agree with their neighbours");
    say(r.unorientable_edges_cut, "edge cut, because the surface has one side only (a Moebius strip)",
        "edges cut, because the surface has one side only (a Moebius strip)");
    say(r.faces_detached, "face detached to make the surface manifold", "faces detached to make the surface manifold");
    say(r.components_turned_outward, "closed piece turned so that its front is outside",
        "closed pieces turned so that their front is outside");
    say(r.components_removed, fmt::format("tiny piece removed ({} faces)", r.faces_of_removed_components),
        fmt::format("tiny pieces removed ({} faces)", r.faces_of_removed_components));
    say(r.holes_filled, fmt::format("hole filled with {} faces", r.faces_added),
        fmt::format("holes filled with {} faces", r.faces_added));
    say(r.self_intersections.value_or(0), "pair of triangles crosses; it was left as it is",
        "pairs of triangles cross; they were left as they are");
  }

  TriangleMesh mesh_;
  const RepairParams& params_;
  RepairReport report_;
  Neighbours across_;
  Components components_;
};

}  // namespace

void validate(const RepairParams& params) {
  if (params.weld_distance && !(*params.weld_distance > 0.0 && *params.weld_distance <= 0.01)) {
    throw InvalidParams(fmt::format("RepairParams: weld_distance is {}; expected a share of the diagonal in (0, 0.01].",
                                    *params.weld_distance));
  }
  if (!(params.smallest_component_share >= 0.0 && params.smallest_component_share < 1.0)) {
    throw InvalidParams(
        fmt::format("RepairParams: smallest_component_share is {}; expected a share of the area in [0, 1).",
                    params.smallest_component_share));
  }
  if (params.fill_holes_up_to_edges && (*params.fill_holes_up_to_edges < 3 || *params.fill_holes_up_to_edges > 5000)) {
    throw InvalidParams(
        fmt::format("RepairParams: fill_holes_up_to_edges is {}; expected 3 to 5000.", *params.fill_holes_up_to_edges));
  }
}

Repaired repair(TriangleMesh mesh, const RepairParams& params) {
  validate(params);
  return Repair(std::move(mesh), params).run();
}

}  // namespace interglow::mesh
