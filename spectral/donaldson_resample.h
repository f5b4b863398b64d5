// SPDX-License-Identifier: GPL-3.0-or-later
/// A measured Donaldson matrix on another wavelength grid.
#pragma once

#include <Eigen/Core>
#include <string>

#include "diagnostics/error.h"
#include "spectral/donaldson_matrix.h"
#include "spectral/wavelength_grid.h"

namespace interglow::spectral {

/// A bispectral table as it was measured, rows emission and columns excitation, with a grid for each.
struct BispectralTable {
  WavelengthGrid emission;
  WavelengthGrid excitation;
  /// Donaldson radiance factor [1]: off the diagonal the bispectral luminescent radiance factor [1/nm] times the
  /// excitation band width; where emission and excitation band are the same, that band's whole radiance factor.
  Eigen::MatrixXd radiance_factor;
  std::string source;
};

struct DonaldsonResampleParams {
  /// Keep emission at shorter wavelengths than the excitation. In instrument data it is partly slit leakage (1 to 8 %
  /// of the luminescence of common samples), and with it a solve couples bands both ways and costs iterations.
  bool keep_anti_stokes = false;
  /// Keep negative entries and those of bands without luminescence above the noise. They are unbiased as a whole, but
  /// emit where nothing luminesces, or negative light; otherwise they are set to 0.
  bool keep_noise = false;
};

/// The matrix, and what is to be known about how it came about.
struct DonaldsonReading {
  DonaldsonMatrix donaldson;
  Warnings warnings;
};

/// Resamples a table to `grid`, conserving what it radiates.
///
///  1. The diagonal is split: the same-band luminescence, half of what the best product α(λ) β(μ) of the Stokes part
///     has in that cell (for emission is longer than excitation in half of the cell), is set apart from the
///     reflectance.
///  2. The reflectance goes to the new bands by `resample_means`; below and above the measured range its end value
///  holds.
///  3. The rest is a density per nm of excitation and a mean over emission. Both axes are resampled by
///  `resample_means`,
///     the Stokes side (with the same-band part) and the anti-Stokes side each by itself, never across the diagonal.
///  4. Same-band luminescence of the new grid joins the reflectance; none lies on the other side of the diagonal.
///
/// So the radiance under light that is equal in all bands integrates, over whole old bands within the new grid, to what
/// the table has. On the table's own grid the numbers come back unchanged. Cost O(bands^2) and a small fit.
///
/// @throws InvalidInput if a value is not finite, sizes disagree, the emission bands that lie in the range of the
///         excitation are not excitation bands too, or the reflectance is outside [0, 1] by more than noise (0.05).
DonaldsonReading resample(const BispectralTable& table, const WavelengthGrid& grid,
                          const DonaldsonResampleParams& params = {});

}  // namespace interglow::spectral
