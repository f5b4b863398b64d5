// SPDX-License-Identifier: GPL-3.0-or-later
/// A spectrum as it was tabulated, and its conversion to bands.
#pragma once

#include <Eigen/Core>
#include <string>

#include "diagnostics/error.h"
#include "spectral/wavelength_grid.h"

namespace interglow::spectral {

/// A table of values over wavelength, linear in between. Units are the caller's: a reflectance [1] or a density
/// [.../nm].
struct Spectrum {
  Eigen::VectorXd wavelength_nm;  ///< strictly increasing
  Eigen::VectorXd value;          ///< same size
  std::string source;             ///< file and column, or a formula; for messages
};

/// What to take outside the table's range.
enum class Outside {
  kZero,    ///< nothing was emitted there (illuminants; a warning is due when the grid reaches out)
  kHold,    ///< the end value (reflectances)
  kRefuse,  ///< throw
};

/// Mean of the spectrum over each band, (1/Δλ) ∫ value dλ, exact for the piecewise linear table: the integral over any
/// range covered by whole bands is conserved, whatever the grid. The table reaches half its end spacing beyond its
/// first and last entry, where the end value holds, because an entry stands for a band. A table whose entries within
/// the grid are the grid's own centres already holds band values, which are returned unchanged. Cost O(table + bands).
/// @returns one value a band, in the unit of the table
/// @throws InvalidInput if the table is empty, not finite or not increasing, or leaves a band uncovered with kRefuse
Eigen::VectorXd band_means(const Spectrum& spectrum, const WavelengthGrid& grid, Outside outside);

/// One sentence if the grid reaches beyond the table, saying what band_means takes there; for light that ends at 380 nm
/// it is the ultraviolet that excites luminescence which is lost. Empty if the table covers the grid.
Warnings warn_where_uncovered(const Spectrum& spectrum, const WavelengthGrid& grid, Outside outside);

/// @throws InvalidInput naming source, entry and value if the table is not finite, not increasing or its sizes differ.
void validate(const Spectrum& spectrum);

}  // namespace interglow::spectral
