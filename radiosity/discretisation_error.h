// SPDX-License-Identifier: GPL-3.0-or-later
/// How far the solution on these elements may be from that of the continuous surfaces.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "diagnostics/progress.h"
#include "radiosity/solution.h"
#include "radiosity/transport.h"

namespace interglow::radiosity {

/// Groups of neighbouring elements of one object, side and smooth surface: the elements of a mesh about twice as
/// coarse.
struct Aggregates {
  std::vector<int> of_element;  ///< aggregate of each element
  /// Spread of positions within the elements over that between the elements of the aggregate, 1/3 where four similar
  /// elements make one twice as large; 0 where an element has no neighbour.
  Eigen::VectorXd spread_ratio;
  Eigen::VectorXd area_mm2;
};

/// Cost O(elements log elements). Same result for any number of threads.
Aggregates aggregate(const Elements& elements);

/// Estimated change of the irradiance if the elements were infinitely small, elements x bands [W m^-2 nm^-1].
struct IrradianceError {
  RowMatrix reflected;          ///< of H_R
  RowMatrix luminescent;        ///< of H_L; 0 x 0 if nothing luminesces
  double assessed_share = 1.0;  ///< share of the sending area whose elements have neighbours to be compared with
};

/// Constant sources X stand for sources that vary within the elements; averaged exactly, the irradiance they give is
/// wrong by O(h²), where the exchange changes little from an element to its neighbour. The same operator gives the
/// solution of the mesh of the aggregates: with Π the area-weighted mean over an aggregate its sources differ from X by
///
///     δ = (I - Π) X + Π D F δ
///
/// and so its irradiance by F δ. What lies below the elements follows from what lies between the elements of an
/// aggregate by the ratio κ of their spreads (a field that is linear over the aggregate): δ' = κ (I - Π) X + D F δ' to
/// first order, which is a solve with few columns and a coarse tolerance. With n bounces, n - 1 follow.
///
/// The estimate carries no safety factor. It is low where elements are so coarse that aggregates are no better guide
/// (the contact of two surfaces on which patches are longer than their gap), and 0 where an element has no neighbour.
///
/// Cost: products with the few columns that span (I - Π) X, and a solve to 1e-2.
IrradianceError discretisation_error(const Elements& elements, const Transport& transport,
                                     const std::vector<spectral::Material>& materials, const Solution& solution,
                                     const Progress& progress = {});

}  // namespace interglow::radiosity
