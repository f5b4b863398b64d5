// SPDX-License-Identifier: GPL-3.0-or-later
/// Irradiance at points of surfaces from the elements that radiate.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>

#include "radiosity/elements.h"
#include "radiosity/transport.h"
#include "radiosity/visibility.h"

namespace interglow::rendering {

/// A point of a surface and the side it looks to.
struct SurfacePoint {
  Eigen::Vector3d position;  ///< mm
  Eigen::Vector3d normal;    ///< unit
  int face = -1;             ///< face it belongs to; -1: none
};

/// H_c(x) = Σ_j K(x, j) b_jc with K the visible part of Lambert's point form factor of element j.
///
/// The elements stand in a tree. A cluster whose share is large, or that is seen in part, is opened down to pieces of
/// single elements; one that is wholly seen or hidden (by rays to points spread over it) is summed or dropped as a
/// whole. What is seen is summed by the cluster's vector moment Σ A_j b_jc n_j where it is small and far, by one point
/// an element where that suffices, and by Lambert's contour formula, clipped at the horizon, where it is near.
class Gatherer {
 public:
  /// @param sources    elements x channels
  /// @param strength   one value an element, >= 0: size of its sources, in the unit of `tolerance`
  /// @param tolerance  wanted absolute error of Σ_j K(x, j) strength_j, > 0
  /// Keeps references to elements and visibility.
  Gatherer(const radiosity::Elements& elements, const radiosity::Visibility& visibility,
           const radiosity::RowMatrix& sources, const Eigen::VectorXd& strength, double tolerance);
  ~Gatherer();

  /// Writes one value a channel. Thread-safe; the same bits for the same point.
  void irradiance(const SurfacePoint& point, double* channels) const;

  /// Distance to the plane of another surface that meets the point within `distance`: one of another object, or one of
  /// the same object whose normal differs by more than the angle of cosine `same_cosine` and that rises above the
  /// point's horizon. The smallest; nothing if there is none. What runs along the point's own plane meets it within
  /// `distance_along`; in between the sine of the angle decides.
  std::optional<double> gap(const SurfacePoint& point, double distance, double distance_along,
                            double same_cosine) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace interglow::rendering
