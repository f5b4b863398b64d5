// SPDX-License-Identifier: GPL-3.0-or-later
/// A planar convex polygon of three or four corners: the shape the form-factor kernels work on.
#pragma once

#include <Eigen/Core>
#include <array>

namespace interglow::radiosity {

/// Counter-clockwise seen from its front. Non-convex outlines are triangulated before they come here.
struct Polygon {
  std::array<Eigen::Vector3d, 4> corner;
  int corners = 0;
};

}  // namespace interglow::radiosity
