// SPDX-License-Identifier: GPL-3.0-or-later
/// The smooth surface behind a noisy scan: one local quadratic a scan point, blended over the scan's triangles.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <utility>
#include <vector>

#include "mesh/surface_index.h"
#include "mesh/triangle_mesh.h"

namespace interglow::mesh {

/// Height z = c0 + c1 u + c2 v + c3 u² + c4 u v + c5 v² [mm] over the plane (u, v) through `origin`.
struct LocalQuadric {
  Eigen::Vector3d origin, u, v, normal;  ///< right-handed orthonormal frame at a scan point
  std::array<double, 6> c{};
  double radius_mm = 0;     ///< of the scan points it was fitted to
  double tilt_std_rad = 0;  ///< predicted error of its normal, from noise and the number of points

  /// The point of the quadric over (or under) `x`, and the unit normal there.
  std::pair<Eigen::Vector3d, Eigen::Vector3d> at(const Eigen::Vector3d& x) const;
};

struct FittedSurface {
  std::vector<Eigen::Vector3d> points;         ///< one a scan point, moved onto the surface
  std::vector<std::array<int, 3>> triangles;   ///< those of the scan
  std::vector<std::array<int, 3>> quadric_of;  ///< per triangle corner; a crease point has one a side
  std::vector<LocalQuadric> quadrics;
  std::vector<std::array<int, 2>> creases;  ///< edges kept sharp
  std::vector<std::array<int, 2>> borders;  ///< edges with one triangle, in its direction
  double noise_sigma_mm = 0;                ///< given or estimated
  double mean_edge_mm = 0;

  /// Point and unit normal of the smooth surface over a point of a triangle. Exact to third order in the triangle's
  /// size.
  std::pair<Eigen::Vector3d, Eigen::Vector3d> at(int triangle, const Eigen::Vector3d& barycentric) const;
};

/// Sets `creases` and `borders` from the triangles and their quadrics.
void find_curves(FittedSurface& surface);

struct FitParams {
  /// Edges bent by more than this stay sharp [degrees], in (0, 180]; 180: none.
  double feature_angle_deg = 40;
  /// Standard deviation of the scan points across the surface [mm]; unset: estimated; 0: the points are exact.
  std::optional<double> noise_sigma_mm{};
  /// Wanted error of normals [degrees]; the radius of the fits grows until noise allows it or the surface bends too
  /// much.
  double normal_error_deg = 0.3;
};

/// Fits the surface.
///
/// At each point a weighted quadratic is fitted to the points within a radius r that are connected to it without
/// crossing a crease. r follows from the noise: the tilt of a fit is about 2√2 σ / (√(π ρ) r²) for ρ points per mm².
/// Where the residuals exceed the noise (a detail smaller than r) r shrinks; at borders, where points lie on one side
/// only, r grows. Fits move points along normals and have no tendency to shrink: a quadratic follows curvature.
/// @throws InvalidInput if an edge has three triangles or two of opposite orientation
/// Cost: O(points · points in r). Deterministic for any thread count.
FittedSurface fit_surface(const TriangleMesh& scan, const FitParams& params);

/// The triangles themselves as a surface: one plane each, nothing moved. Any topology is allowed; curves are not set.
FittedSurface flat_surface(const TriangleMesh& mesh);

/// Standard deviation of the points across the surface [mm]: the median residual of quadratics through the nearest
/// twenty points of up to 2000 points; 0 for meshes too small to tell.
double estimate_noise(const TriangleMesh& scan);

}  // namespace interglow::mesh
