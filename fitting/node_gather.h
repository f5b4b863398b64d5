// SPDX-License-Identifier: GPL-3.0-or-later
/// Irradiance at fixed points of the surfaces as a linear map of what the elements radiate.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "diagnostics/progress.h"
#include "radiosity/elements.h"
#include "radiosity/transport.h"
#include "rendering/surface.h"

namespace interglow::fitting {

/// Points at the corners and the middles of the edges of faces' halves, with the form factors from each to all
/// elements. In a half the irradiance is the quadratic function through its six points (Fragment::shape). Form factors
/// do not depend on light, camera or materials: they are computed when a half is first asked for, and kept.
class NodeGather {
 public:
  /// Keeps references to all.
  NodeGather(const rendering::Surface& surface, const radiosity::Elements& elements,
             const radiosity::Visibility& visibility);

  /// Half of a face, seen from one side.
  static int side(int face, int half, bool back) { return 4 * face + 2 * half + (back ? 1 : 0); }

  /// Makes the points of these sides, where they do not exist yet.
  /// Cost O(new points × elements).
  void require(const std::vector<int>& sides, const Progress& progress = {});

  /// Σ_j K(x, j) radiosity_j for all points so far: points x columns. @param radiosity  elements x columns
  radiosity::RowMatrix apply(const radiosity::RowMatrix& radiosity) const;

  /// The six points of a side: corners 0, 1, 2, middles of edges 01, 12, 20. @pre required
  const std::array<int, 6>& points(int side) const { return node_[static_cast<std::size_t>(side)]; }
  std::size_t size() const { return position_.size(); }

 private:
  struct Row {
    std::vector<int> element;
    std::vector<float> factor;
  };
  Row row_at(const rendering::SurfacePoint& point, bool& touched, double reach) const;

  const rendering::Surface& surface_;
  const radiosity::Elements& elements_;
  const radiosity::Visibility& visibility_;
  std::vector<std::array<int, 6>> node_;  ///< of each side; -1: not yet
  std::vector<rendering::SurfacePoint> position_;
  std::vector<double> size_mm_;  ///< least width of a triangle of each point
  std::vector<Row> row_;
  std::vector<std::pair<std::array<std::int64_t, 8>, int>> known_;  ///< shared points, sorted by key
};

}  // namespace interglow::fitting
