// SPDX-License-Identifier: GPL-3.0-or-later
/// Form factors between polygons that nothing hides from one another, and from a point to a polygon.
#pragma once

#include <Eigen/Core>

#include "radiosity/polygon.h"

namespace interglow::radiosity {

/// How a value was obtained, cheapest last resort first.
enum class FormFactorMethod {
  kZero,                ///< no part of either lies in front of the other: exactly 0
  kFarQuadrature,       ///< tensor quadrature of cosθ1 cosθ2 / (π r²) over both patches
  kEdgeQuadrature,      ///< Gauss-Legendre on the edges of both patches
  kContourQuadrature,   ///< edge pairs, inner integral closed form, outer Gauss-Legendre or graded
  kClosedForm,          ///< edge pairs in closed form
  kPointArea,           ///< outer quadrature over one patch of Lambert's contour formula for the other
  kOccluded,            ///< the same with the visible part of the source at each point
  kBlocked,             ///< provably hidden: exactly 0
  kUndefined,           ///< the limit depends on orientation (coincident opposite patches); value by convention, flagged
};

const char* name(FormFactorMethod method);

/// A value with the error it may have.
struct FormFactor {
  double value = 0.0;           ///< F12 in [0, 1]
  double error_estimate = 0.0;  ///< bound on |value - exact| that is met in practice; never below rounding
  FormFactorMethod method = FormFactorMethod::kZero;
};

/// F12 = (1 / A1) ∫_A1 ∫_A2 cosθ1 cosθ2 / (π r²) dA2 dA1, front to front; what lies behind the other's plane is clipped away.
/// The cheapest rule whose error estimate meets `tolerance` is taken. A1 F12 computed as (1, 2) and as (2, 1) is the same
/// double: the pair is put in a canonical order first, and `form_factor` divides that exchange area by A1.
///
/// @param tolerance  wanted absolute error of F12; 0 asks for round-off
/// @throws InvalidParams if a corner is not finite. A patch without area gives 0.
/// Scale-free: multiplying all coordinates by a power of two changes no bit.
FormFactor form_factor(const Polygon& from, const Polygon& to, double tolerance = 0.0);

/// The exchange area A1 F12 = A2 F21 [unit² of the coordinates], symmetric to the bit, with `tolerance` absolute in it.
FormFactor exchange_area(const Polygon& a, const Polygon& b, double tolerance);

/// Lambert: share of the flux leaving a surface element at `point` with unit `normal` that reaches the front of `to`,
/// clipped at the element's horizon. The configuration factor F_dA→2, to round-off.
double point_form_factor(const Eigen::Vector3d& point, const Eigen::Vector3d& normal, const Polygon& to);

}  // namespace interglow::radiosity
