// SPDX-License-Identifier: GPL-3.0-or-later
/// The share of the exchange between two patches that a few convex bodies leave, fast.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "radiosity/blockers.h"
#include "radiosity/polygon.h"

namespace interglow::radiosity {

struct ShadowResult {
  double hidden = 0.0;          ///< exchange area that the bodies take away
  double error_estimate = 0.0;  ///< of `hidden`
  bool touched = false;         ///< some line is blocked
  bool covered = false;         ///< every line is blocked
};

/// ∫ over the outer patch of the configuration factor of the part of the source that lies in the bodies' shadows.
///
/// In the outer patch's plane the shadows of a body's silhouette, thrown by the source's corners, are segments. The
/// patch is cut along those that cross it; within each cell the seen outline keeps its structure, so the integrand is
/// analytic and a rule of low degree is enough. Only where shadows of two bodies cross does it change on curves that
/// are not cut at: the outlines seen from the points of the rule and from a cell's corners are compared, and cells in
/// which they differ are halved. At a point the source is clipped by the cones of the bodies' silhouettes and Lambert's
/// formula summed over what is hidden; overlapping shadows count once. Holds only memory to work in: use one a thread.
class ShadowCells {
 public:
  /// @param tolerance  wanted absolute error of `hidden`
  ShadowResult integrate(const Polygon& outer, const Polygon& source, std::span<const ConvexBody* const> bodies,
                         double tolerance, double flat);

 private:
  static constexpr int kMostCorners = 24;
  struct Outline {
    int corners = 0;
    std::array<Eigen::Vector3d, kMostCorners> corner;
  };
  struct Cell {
    int corners = 0;
    std::array<Eigen::Vector2d, 12> corner;
    double hidden = 0.0;
    double error = 0.0;
    bool touched = false;
    bool covered = false;
  };
  /// A body in the frame of the outer patch (its plane is z = 0), cut down to what lies between the two planes.
  struct LocalBody {
    struct Edge {
      int a, b;
      int face, other;  ///< -1: a side that is never seen (a cut, or the rim of a sheet)
    };
    std::vector<Eigen::Vector3d> vertex;
    std::vector<Eigen::Vector4d> face;  ///< outward normal and minus offset
    std::vector<Edge> edge;
    Eigen::Vector3d centre;
    bool solid = false;
    std::vector<Edge> silhouette;       ///< of the current cell
    std::vector<char> seen;             ///< faces seen from the current cell
    std::vector<Eigen::Vector3d> cone;  ///< inward normals at the current point
  };

  bool make_local(const ConvexBody& body, const Eigen::Matrix3d& axes, const Eigen::Vector3d& origin, double flat,
                  LocalBody& local);
  static void cut_body(LocalBody& body, const Eigen::Vector3d& normal, double offset, double flat);
  void add_events(const LocalBody& body);
  /// Cuts the cells that the line from a to b touches.
  void add_line(const Eigen::Vector2d& a, const Eigen::Vector2d& b);
  void find_silhouettes(const Eigen::Vector2d& position);
  /// What a point of the outer patch sees.
  struct Look {
    double hidden = 0.0;        ///< configuration factor of what is hidden
    std::uint64_t outline = 0;  ///< tells outlines of what is hidden that differ in structure
    int bodies = 0;             ///< that hide something
    bool covered = false;
  };
  /// Of a point of the outer patch from the source.
  double distance_square(const Eigen::Vector2d& point) const;
  void evaluate(Cell& cell);
  Look look(const Eigen::Vector2d& point);
  double uncovered(const Outline& part, int bodies, std::uint64_t& outline);
  bool cone_at(LocalBody& body, const Eigen::Vector3d& point);

  std::vector<LocalBody> bodies_;
  int body_count_ = 0;
  Outline source_;  ///< in the frame, above the outer plane
  Eigen::Vector3d source_normal_;
  double source_offset_ = 0.0;
  Cell patch_;
  Eigen::Vector2d patch_low_, patch_high_;
  double small_ = 0.0;  ///< what a cell hides, if less than this, is taken from its middle alone
  std::vector<Cell> cells_;
};

}  // namespace interglow::radiosity
