// SPDX-License-Identifier: GPL-3.0-or-later
/// Indirect irradiance over the faces that a camera sees.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "diagnostics/progress.h"
#include "rendering/camera_rays.h"
#include "rendering/gather.h"
#include "rendering/surface.h"

namespace interglow::rendering {

/// Values gathered at the corners of the faces and interpolated linearly. Where a value gathered at the middle of an
/// edge differs from its interpolation by more than the tolerance, the triangle is split into four, as often as needed,
/// down to the size of a pixel.
class IrradianceField {
 public:
  /// @param visible  face sides that are seen: 2 × face + (1 for the back), sorted, distinct
  /// @param weight   size of one unit of each channel, in the unit of `tolerance`
  /// Cost: one gather a corner, three for each triangle split. The same bits for any number of threads.
  IrradianceField(const Surface& surface, const Gatherer& gatherer, const CameraRays& camera,
                  const std::vector<int>& visible, const Eigen::VectorXd& weight, double tolerance,
                  const Progress& progress);

  /// Writes one value a channel at a point of a visible face side.
  void evaluate(int face, bool back, const FacePoint& at, double* channels) const;

  std::size_t gather_points() const { return points_.size(); }

 private:
  struct Triangle {
    std::array<int, 3> point;
    int first_child = -1;  ///< of four: at corners 0, 1, 2, and the middle one
  };

  int channels_ = 0;
  std::vector<SurfacePoint> points_;
  std::vector<double> value_;  ///< points x channels
  std::vector<Triangle> triangles_;
  std::vector<int> root_;  ///< first triangle of each face side (a quad has two); -1: not visible
};

}  // namespace interglow::rendering
