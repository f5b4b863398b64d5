// SPDX-License-Identifier: GPL-3.0-or-later
/// Form factors between polygons past obstacles.
#pragma once

#include <span>

#include "radiosity/form_factor.h"
#include "radiosity/polygon.h"
#include "radiosity/visible_part.h"

namespace interglow::radiosity {

/// F12 = (1 / A1) ∫_A1 (configuration factor of the part of `to` that the point sees) dA1, front to front.
///
/// Occluders are opaque and two-sided and may overlap one another; one that crosses a patch hides what is behind it.
/// The inner factor is exact at every point; the outer patch is cut where visibility events (planes through an edge of
/// one outline and a corner of another) make the integrand kink, and refined until the estimate meets the tolerance.
/// The value is the unoccluded factor times the visible share, so it never exceeds the unoccluded one.
///
/// @param tolerance  wanted absolute error of F12, at least 1e-12
/// @throws InvalidParams if a corner is not finite or the tolerance not positive
FormFactor form_factor(const Polygon& from, const Polygon& to, std::span<const Polygon> occluders, double tolerance);

/// The share of the exchange between two patches that blockers leave.
struct VisibleShare {
  double share = 1.0;
  double error_estimate = 0.0;  ///< of the share
  bool partial = false;         ///< neither provably clear nor provably blocked
};

/// The share for an outer patch and a source, to `tolerance` absolute in the share; event planes are cut at if
/// `cut_events`. Symmetric to the bit in the result only if the caller chooses the outer patch symmetrically.
VisibleShare visible_share(const Polygon& outer, const Polygon& source, std::span<const BlockerOutline> blockers,
                           double tolerance, bool cut_events, VisiblePart& work);

}  // namespace interglow::radiosity
