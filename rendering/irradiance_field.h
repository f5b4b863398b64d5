// SPDX-License-Identifier: GPL-3.0-or-later
/// Indirect irradiance over the faces that a camera sees.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "diagnostics/progress.h"
#include "rendering/camera_rays.h"
#include "rendering/gather.h"
#include "rendering/surface.h"

namespace interglow::rendering {

/// Values gathered at the corners of the faces and interpolated linearly. Where a value gathered at the middle of an
/// edge differs from its interpolation by more than the tolerance, the triangle is split into four, as often as needed;
/// below the size of a pixel the difference counts by its share of the pixel.
class IrradianceField {
 public:
  /// Nothing is gathered yet. Keeps references to surface, gatherer and camera.
  /// @param weight  size of one unit of each channel, in the unit of `tolerance`
  IrradianceField(const Surface& surface, const Gatherer& gatherer, const CameraRays& camera,
                  const Eigen::VectorXd& weight, double tolerance);
  ~IrradianceField();

  /// @param sides  face sides that are seen: 2 × face + (1 for the back), sorted, distinct
  /// Sides that are there already are left as they are. Cost: one gather a corner, three for each triangle split. The
  /// same bits for any number of threads.
  void add(const std::vector<int>& sides, const Progress& progress);

  /// Writes one value a channel at a point of a side that was added.
  void evaluate(int face, bool back, const FacePoint& at, double* channels) const;

  /// One value a pixel: 1 where the field of what was added bends so much within the pixel that its value at the
  /// middle may differ from the pixel's mean by more than the tolerance.
  const std::vector<char>& bent_pixels() const { return bent_pixel_; }

  std::size_t gather_points() const { return points_.size(); }

 private:
  struct Triangle {
    std::array<int, 3> point;
    int first_child = -1;  ///< of four: at corners 0, 1, 2, and the middle one
  };

  struct Known;

  const Surface* surface_;
  const Gatherer* gatherer_;
  const CameraRays* camera_;
  Eigen::VectorXd weight_;
  double tolerance_;
  int channels_;
  std::unique_ptr<Known> known_;  ///< points that later faces may share
  std::vector<char> bent_pixel_;
  std::vector<SurfacePoint> points_;
  std::vector<double> value_;  ///< points x channels
  std::vector<Triangle> triangles_;
  std::vector<int> root_;  ///< first triangle of each face side (a quad has two); -1: not added
};

}  // namespace interglow::rendering
