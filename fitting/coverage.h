// SPDX-License-Identifier: GPL-3.0-or-later
/// Which part of which face a pixel sees, and which part of it a light reaches: exact areas, no samples, so that a
/// picture changes smoothly with camera and light.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "diagnostics/progress.h"
#include "fitting/lens_camera.h"
#include "fitting/triangles.h"
#include "radiosity/elements.h"
#include "rendering/surface.h"

namespace interglow::fitting {

using Outline = std::vector<Eigen::Vector2d>;  ///< of a convex polygon, counter-clockwise

/// A part of a triangle within one pixel.
struct Fragment {
  int pixel = 0;  ///< row × width + column
  int triangle = 0;
  double area = 0.0;  ///< [px²]
  /// Integrals over the part [px²]: of the six quadratic shape functions of the face's half (corners 0, 1, 2, middles
  /// of edges 01, 12, 20), and of the smooth unit normal on the side that is seen.
  std::array<double, 6> shape{};
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
};

/// What a camera sees.
struct CameraView {
  LensCamera camera;
  std::vector<char> back;                          ///< one a triangle: 1 if its back side is towards the camera
  std::vector<std::array<Eigen::Vector3d, 3>> at;  ///< column, row, 1 / depth of the corners
  std::vector<std::vector<Outline>> part;          ///< of each triangle, what is seen [px]
  std::vector<Fragment> fragments;                 ///< sorted by pixel
  std::vector<std::size_t> first;                  ///< pixels + 1: fragments of pixel p
};

/// Perspective maps planes to planes when 1 / depth is the third coordinate, so what nearer triangles hide is cut out
/// of each triangle as from a parallel beam, and the rest cut at the borders of the pixels. Triangles that reach behind
/// the camera are not seen. Within a triangle the distortion is linear. Cost O(triangles log triangles + fragments).
CameraView camera_view(const Triangles& triangles, const LensCamera& camera);

/// Which part of each triangle's front or back a directional light reaches.
struct LightView {
  Eigen::Vector3d direction;  ///< along which the light travels
  struct Beam {
    Eigen::Vector3d direction;
    double weight = 1.0;
    /// Of the partly lit triangles, in their order: lit outlines in the weights of corners 1 and 2.
    std::vector<std::vector<Outline>> part;
  };
  std::vector<Beam> beam;  ///< those that stand for the source's disk
  /// Of each triangle's front and back: lit share of its projected area, mean over the beams.
  std::vector<std::array<double, 2>> share;
  /// Of each triangle's side that faces the light: mean of cosine × lit share, of the flat triangle; back[t]: its back.
  std::vector<double> factor;
  std::vector<char> back;
  /// Index into `part` of each triangle's lit side; -1: wholly lit or wholly dark.
  std::vector<int> partly;
};

/// @param half_angle_rad  of the source, a ring of 8 beams; 0: one parallel beam. Cost O(beams × triangles log
/// triangles).
LightView light_view(const Triangles& triangles, const Eigen::Vector3d& direction, double half_angle_rad);

/// Σ of area × cosine of the lit parts of what the camera sees, pixels × groups.
/// @param group  of each triangle; negative: it does not count
/// The cosine is that of the smooth normal's mean over each lit part. A facet turned away from the light at whose
/// corners the smooth surface is lit is as lit as its neighbours that face the light.
radiosity::RowMatrix direct_image(const Triangles& triangles, const CameraView& camera, const LightView& light,
                                  const std::vector<int>& group, int groups);

}  // namespace interglow::fitting
