// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/remesh.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <numbers>

#include "diagnostics/error.h"
#include "mesh/adaptive_remesh.h"
#include "mesh/contact.h"
#include "mesh/fitted_surface.h"
#include "mesh/half_edges.h"
#include "mesh/hole_filling.h"
#include "mesh/small_holes.h"
#include "mesh/surface_index.h"

namespace interglow::mesh {
namespace {

using Eigen::Vector3d;
using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

/// Area of an equilateral triangle over its squared edge.
const double kEquilateral = std::sqrt(3.0) / 4;

/// Distance to the next object where there is none; finite, so that it can be interpolated.
constexpr double kFarAway_mm = 1e30;

/// An object on its way from scan to patches.
struct Work {
  const RemeshInput* input = nullptr;
  TriangleMesh scan;
  FittedSurface surface;
  std::unique_ptr<SurfaceIndex> index;
  std::vector<double> neighbour_mm;  ///< per point: distance to the nearest other object
  std::vector<double> bend;          ///< per point: largest curvature [1/mm]
  double longest_mm = 0;             ///< wanted edge length far from everything
  RemeshedSurface remeshed;
  std::vector<int> locked_points;  ///< of the surface: on contact lines
  double closed_contact_mm = 0;
  int closed_holes = 0;
  double fit_s = 0, remesh_s = 0;
};

double area_of(const std::vector<Vector3d>& points, const std::array<int, 3>& t) {
  return (points[t[1]] - points[t[0]]).cross(points[t[2]] - points[t[0]]).norm() / 2;
}

double largest_curvature(const LocalQuadric& q) {
  Eigen::Matrix2d shape;
  shape << 2 * q.c[3], q.c[4], q.c[4], 2 * q.c[5];
  return shape.selfadjointView<Eigen::Lower>().eigenvalues().cwiseAbs().maxCoeff();
}

double distance_to_others(const std::vector<Work>& all, const Work& own, const Vector3d& point) {
  double nearest = kFarAway_mm;
  for (const Work& other : all)
    if (&other != &own) nearest = std::min(nearest, (other.index->closest(point).point - point).norm());
  return nearest;
}

/// Edge length at distance `near_mm` from the next object on a surface of curvature `bend`.
double edge_length(const RemeshParams& params, double longest_mm, double near_mm, double bend) {
  double length = std::clamp(params.proximity_slope * near_mm, params.proximity_ratio * longest_mm, longest_mm);
  // An edge shall not turn by more than half a radian; at most three times finer for that.
  if (bend * length > 0.5) length = std::max(0.5 / bend, std::min(length, longest_mm / 3));
  return length;
}

void index_surface(Work& work) {
  work.index = std::make_unique<SurfaceIndex>(work.surface.points, work.surface.triangles);
  work.bend.assign(work.surface.points.size(), 0);
  for (std::size_t t = 0; t < work.surface.triangles.size(); ++t)
    for (int k = 0; k < 3; ++k) {
      double& bend = work.bend[work.surface.triangles[t][k]];
      bend = std::max(bend, largest_curvature(work.surface.quadrics[work.surface.quadric_of[t][k]]));
    }
}

void fit(Work& work) {
  const auto start = Clock::now();
  const RemeshParams& params = work.input->params;
  work.scan = separate_fans(work.input->scan);
  if (params.close_holes_mm > 0) {
    HolesFilled filled = fill_small_holes(work.scan, params.close_holes_mm);
    work.scan = separate_fans(filled.mesh);
    work.closed_holes = filled.holes;
  }
  work.surface =
      fit_surface(work.scan, {.feature_angle_deg = params.feature_angle_deg, .noise_sigma_mm = params.noise_sigma_mm});
  index_surface(work);
  work.fit_s = seconds_since(start);
}

/// Finds the edge length that gives the wanted number of patches, or takes the wanted one.
void choose_lengths(const std::vector<Work>& all, Work& work) {
  const RemeshParams& params = work.input->params;
  const FittedSurface& surface = work.surface;
  work.neighbour_mm.resize(surface.points.size());
  tbb::parallel_for(std::size_t{0}, surface.points.size(),
                    [&](std::size_t i) { work.neighbour_mm[i] = distance_to_others(all, work, surface.points[i]); });
  if (params.edge_length_mm && !params.patches) {
    work.longest_mm = *params.edge_length_mm;
    return;
  }
  const double wanted = params.patches.value_or(4000);
  double area = 0;
  for (const auto& t : surface.triangles) area += area_of(surface.points, t);
  const auto count = [&](double longest) {
    double sum = 0;
    for (const auto& t : surface.triangles) {
      double length = 0;
      for (int v : t) length += edge_length(params, longest, work.neighbour_mm[v], work.bend[v]) / 3;
      sum += area_of(surface.points, t) / (kEquilateral * length * length);
    }
    return sum;
  };
  double low = std::sqrt(area / (kEquilateral * wanted)) / 2, high = low * 2 / params.proximity_ratio + 4 * low;
  for (int i = 0; i < 30; ++i) {
    const double middle = std::sqrt(low * high);
    (count(middle) > wanted ? low : high) = middle;
  }
  work.longest_mm = std::sqrt(low * high);
}

void remesh_one(const std::vector<Work>& all, Work& work) {
  const auto start = Clock::now();
  const RemeshParams& params = work.input->params;
  const FittedSurface& surface = work.surface;
  const double finest = params.proximity_ratio * work.longest_mm;
  AdaptiveRemeshParams adaptive;
  adaptive.locked_points = work.locked_points;
  adaptive.feature_angle_deg = params.feature_angle_deg;
  adaptive.triangles = params.patches;
  if (!params.patches && !params.edge_length_mm) adaptive.triangles = 4000;
  adaptive.edge_length = [&](const SurfacePoint& at) {
    const auto& t = surface.triangles[at.triangle];
    double near_mm = 0, bend = 0, longest_side = 0;
    for (int k = 0; k < 3; ++k) {
      near_mm += at.barycentric[k] * work.neighbour_mm[t[k]];
      bend += at.barycentric[k] * work.bend[t[k]];
      longest_side = std::max(longest_side, (surface.points[t[k]] - surface.points[t[(k + 1) % 3]]).norm());
    }
    // Distances at the corners of a large triangle say little about its middle.
    if (longest_side > 2.5 * finest && all.size() > 1) near_mm = distance_to_others(all, work, at.point);
    return edge_length(params, work.longest_mm, near_mm, bend);
  };
  work.remeshed = adaptive_remesh(surface, *work.index, adaptive);
  work.remesh_s = seconds_since(start);
}

/// Normals at the corners of a patch: of the fitted surface at the corner, on the patch's side of a crease.
std::array<Vector3d, 4> normals_of(const Work& work, const std::array<int, 3>& patch) {
  const auto& points = work.remeshed.points;
  const Vector3d centre = (points[patch[0]] + points[patch[1]] + points[patch[2]]) / 3;
  const Vector3d flat = (points[patch[1]] - points[patch[0]]).cross(points[patch[2]] - points[patch[0]]).normalized();
  std::array<Vector3d, 4> normals;
  normals[3] = Vector3d::Zero();
  for (int k = 0; k < 3; ++k) {
    const SurfacePoint& hint = work.remeshed.on_surface[patch[k]];
    // A step of a tenth towards the centre picks the side.
    const SurfacePoint inside = work.index->closest(0.9 * points[patch[k]] + 0.1 * centre, hint);
    Vector3d normal = Vector3d::Zero();
    for (int c = 0; c < 3; ++c)
      normal += inside.barycentric[c] *
                work.surface.quadrics[work.surface.quadric_of[inside.triangle][c]].at(points[patch[k]]).second;
    normals[k] = normal.normalized();
    if (!(normals[k].dot(flat) > 0)) normals[k] = flat;
  }
  return normals;
}

/// The fit tells corners of neighbouring patches in one point apart by fractions of a degree; on one side of a crease
/// they share their mean, so that light and normals go on across the edge.
void share_normals(PatchMesh& patches) {
  const double same_side = std::cos(15 * std::numbers::pi / 180);
  const auto fitted = patches.corner_normals;
  std::vector<std::vector<std::pair<std::size_t, int>>> around(patches.points.size());
  for (std::size_t f = 0; f < patches.faces.size(); ++f) {
    for (int k = 0; k < 3; ++k) around[patches.faces[f][k]].emplace_back(f, k);
  }
  for (const auto& corners : around) {
    for (const auto& [face, k] : corners) {
      Vector3d sum = Vector3d::Zero();
      for (const auto& [other, c] : corners) {
        if (fitted[other][c].dot(fitted[face][k]) >= same_side) sum += fitted[other][c];
      }
      patches.corner_normals[face][k] = sum.normalized();
    }
  }
}

PatchMesh to_patches(const Work& work) {
  PatchMesh patches;
  patches.points = work.remeshed.points;
  for (const auto& t : work.remeshed.triangles) {
    patches.faces.push_back({t[0], t[1], t[2], -1});
    patches.corner_normals.push_back(normals_of(work, t));
  }
  share_normals(patches);
  patches.closed = is_closed(patches);
  return patches;
}

/// Shifts corners outwards by the mean height of the smooth surface over the flat patches around them.
///
/// Over an edge d with end normals n, m the surface rises by s = (m - n)·d / 8 in the middle; over a triangle by
/// (s1 + s2 + s3) / 3 in the mean.
void balance_sagitta(PatchMesh& patches, const std::vector<char>& is_fixed) {
  const std::size_t count = patches.points.size();
  std::vector<Eigen::Matrix3d> a(count, Eigen::Matrix3d::Zero());
  std::vector<Vector3d> b(count, Vector3d::Zero());
  for (std::size_t f = 0; f < patches.faces.size(); ++f) {
    const Face& face = patches.faces[f];
    const auto& normals = patches.corner_normals[f];
    double height = 0;
    for (int k = 0; k < 3; ++k) {
      const int next = (k + 1) % 3;
      height += (normals[next] - normals[k]).dot(patches.points[face[next]] - patches.points[face[k]]) / 24;
    }
    const double area = vector_area(patches, face).norm();
    for (int k = 0; k < 3; ++k) {
      a[face[k]] += area * normals[k] * normals[k].transpose();
      b[face[k]] += area * height * normals[k];
    }
  }
  for (std::size_t i = 0; i < count; ++i) {
    const double trace = a[i].trace();
    if (!(trace > 0) || is_fixed[i]) continue;
    // The smallest shift: directions that the normals around a corner leave free stay put.
    const Eigen::Matrix3d regular = a[i] + 1e-3 * trace * Eigen::Matrix3d::Identity();
    patches.points[i] += regular.ldlt().solve(b[i]);
  }
}

/// RMS angle between scan triangles and the patches' interpolated normals at the nearest points, weighted by area.
double normal_change_deg(const TriangleMesh& scan, const PatchMesh& patches) {
  const SurfaceIndex index(patches.points, triangles_of(patches));
  std::vector<double> squares(scan.triangles.size(), 0), areas(scan.triangles.size(), 0);
  tbb::parallel_for(std::size_t{0}, scan.triangles.size(), [&](std::size_t i) {
    const auto& t = scan.triangles[i];
    const Vector3d normal = (scan.points[t[1]] - scan.points[t[0]]).cross(scan.points[t[2]] - scan.points[t[0]]);
    if (!(normal.norm() > 0)) return;
    const SurfacePoint on = index.closest((scan.points[t[0]] + scan.points[t[1]] + scan.points[t[2]]) / 3);
    Vector3d smooth = Vector3d::Zero();
    for (int k = 0; k < 3; ++k) smooth += on.barycentric[k] * patches.corner_normals[on.triangle][k];
    const double angle = std::atan2(normal.cross(smooth).norm(), normal.dot(smooth)) * 180 / std::numbers::pi;
    squares[i] = angle * angle * normal.norm();
    areas[i] = normal.norm();
  });
  double square = 0, area = 0;
  for (std::size_t i = 0; i < squares.size(); ++i) square += squares[i], area += areas[i];
  return area > 0 ? std::sqrt(square / area) : 0;
}

Remeshed keep(const TriangleMesh& scan) {
  Remeshed result;
  result.patches.points = scan.points;
  for (const auto& t : scan.triangles) result.patches.faces.push_back({t[0], t[1], t[2], -1});
  result.patches.closed = is_closed(result.patches);
  return result;
}

/// Continues fitted surfaces to their contact lines where asked to. @return true if a surface changed
bool close_all_contacts(std::vector<Work>& all) {
  std::vector<ContactSurface> surfaces(all.size());
  bool asked = false;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const RemeshParams& params = all[i].input->params;
    surfaces[i].surface = &all[i].surface;
    if (params.keep_triangles) continue;
    surfaces[i].reach_mm = params.close_contact_mm;
    surfaces[i].spacing_mm = params.proximity_ratio * all[i].longest_mm;
    asked = asked || params.close_contact_mm > 0;
  }
  if (!asked || all.size() < 2) return false;
  close_contacts(surfaces);
  for (std::size_t i = 0; i < all.size(); ++i) {
    all[i].closed_contact_mm = surfaces[i].closed_mm;
    all[i].locked_points = surfaces[i].locked_points;
    if (surfaces[i].closed_mm > 0) index_surface(all[i]);
  }
  return true;
}

/// Deeper than this behind another surface, a point is elsewhere rather than inside.
double overlap_tolerance(const Work& work) {
  // Triangles of a plane may be as large as the scene; patches are not.
  const bool kept = work.input->params.keep_triangles;
  const double edge_mm = kept ? work.surface.mean_edge_mm : std::min(work.surface.mean_edge_mm, work.longest_mm);
  return std::max(3 * edge_mm, 8 * work.surface.noise_sigma_mm);
}

/// Measures how far scans and patches pass through each other and moves patches apart.
void resolve_overlaps(const std::vector<Work>& all, std::vector<Remeshed>& results) {
  std::vector<SolidSurface> scans, surfaces;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const Work& work = all[i];
    const double tolerance = overlap_tolerance(work);
    const TriangleMesh& scan = work.input->scan;
    scans.push_back({scan.points, scan.triangles, point_normals(scan.points, scan.triangles), {}, tolerance});
    const PatchMesh& patches = results[i].patches;
    SolidSurface surface{patches.points, triangles_of(patches), {}, work.remeshed.is_locked, tolerance};
    surface.normals = point_normals(surface.points, surface.triangles);
    if (work.input->params.keep_triangles) surface.is_fixed.assign(surface.points.size(), 1);
    surfaces.push_back(std::move(surface));
  }
  const std::vector<Overlap> before = measure_overlap(scans);
  separate(surfaces);
  const std::vector<Overlap> after = measure_overlap(surfaces);
  for (std::size_t i = 0; i < all.size(); ++i) {
    results[i].report.scan_overlap = before[i];
    results[i].report.patch_overlap = after[i];
    if (!all[i].input->params.keep_triangles) results[i].patches.points = surfaces[i].points;
  }
}

}  // namespace

void validate(const RemeshParams& params, const std::string& name) {
  const auto require = [&](bool good, const char* field, double value, const char* range) {
    if (!good)
      throw InvalidParams(fmt::format("Object \"{}\": remesh.{} is {}; expected {}.", name, field, value, range));
  };
  if (params.patches) require(*params.patches >= 4, "patches", *params.patches, "at least 4");
  if (params.edge_length_mm)
    require(*params.edge_length_mm > 0 && std::isfinite(*params.edge_length_mm), "edge_length_mm",
            *params.edge_length_mm, "a positive number");
  if (params.noise_sigma_mm)
    require(*params.noise_sigma_mm >= 0 && std::isfinite(*params.noise_sigma_mm), "noise_sigma_mm",
            *params.noise_sigma_mm, "zero or a positive number");
  require(params.feature_angle_deg > 0 && params.feature_angle_deg <= 180, "feature_angle_deg",
          params.feature_angle_deg, "a number in (0, 180]");
  require(params.proximity_ratio > 0 && params.proximity_ratio <= 1, "proximity_ratio", params.proximity_ratio,
          "a number in (0, 1]");
  require(params.proximity_slope > 0 && std::isfinite(params.proximity_slope), "proximity_slope",
          params.proximity_slope, "a positive number");
  require(params.close_holes_mm >= 0 && std::isfinite(params.close_holes_mm), "close_holes_mm", params.close_holes_mm,
          "zero or a positive number");
  require(params.close_contact_mm >= 0 && std::isfinite(params.close_contact_mm), "close_contact_mm",
          params.close_contact_mm, "zero or a positive number");
}

std::vector<Remeshed> remesh(std::span<const RemeshInput> objects, const Progress& progress) {
  for (const RemeshInput& object : objects) {
    validate(object.params, object.name);
    if (object.scan.triangles.empty())
      throw InvalidInput(fmt::format("Object \"{}\" has no triangles to make patches from.", object.name));
  }
  std::vector<Work> all(objects.size());
  progress.update("Fitting surfaces", 0);
  for (std::size_t i = 0; i < objects.size(); ++i) all[i].input = &objects[i];
  tbb::parallel_for(std::size_t{0}, all.size(), [&](std::size_t i) {
    Work& work = all[i];
    if (!work.input->params.keep_triangles) return fit(work);
    work.surface = flat_surface(work.input->scan);
    work.index = std::make_unique<SurfaceIndex>(work.surface.points, work.surface.triangles);
  });
  progress.update("Remeshing", 0);
  for (Work& work : all)
    if (!work.input->params.keep_triangles) choose_lengths(all, work);
  if (close_all_contacts(all))
    for (Work& work : all)
      if (!work.input->params.keep_triangles) choose_lengths(all, work);
  std::vector<Remeshed> results(objects.size());
  tbb::parallel_for(std::size_t{0}, all.size(), [&](std::size_t i) {
    Work& work = all[i];
    if (work.input->params.keep_triangles) {
      results[i] = keep(work.input->scan);
      return;
    }
    remesh_one(all, work);
    results[i].patches = to_patches(work);
    balance_sagitta(results[i].patches, work.remeshed.is_locked);
  });
  progress.update("Separating objects", 0);
  if (all.size() > 1) resolve_overlaps(all, results);
  progress.update("Measuring patches", 0);
  for (std::size_t i = 0; i < all.size(); ++i) {
    const Work& work = all[i];
    PatchMesh& patches = results[i].patches;
    RemeshReport& report = results[i].report;
    report.patches = static_cast<int>(patches.faces.size());
    report.noise_sigma_mm = work.surface.noise_sigma_mm;
    report.edge_length_mm = work.longest_mm;
    for (const auto& t : work.input->scan.triangles) report.scan_area_mm2 += area_of(work.input->scan.points, t);
    report.patch_area_mm2 = total_area(patches);
    report.angles = angle_statistics(patches);
    report.fit_s = work.fit_s;
    report.remesh_s = work.remesh_s;
    report.closed_holes = work.closed_holes;
    report.closed_contact_mm = work.closed_contact_mm;
    if (work.input->params.keep_triangles) continue;
    report.distance = two_sided_distance(work.input->scan, patches);
    report.normal_change_deg = normal_change_deg(work.input->scan, patches);
    report.crossings = detail::count_self_intersections({patches.points, triangles_of(patches)});
  }
  progress.update("Remeshing", 1);
  return results;
}

}  // namespace interglow::mesh
