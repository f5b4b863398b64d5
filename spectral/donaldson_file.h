// SPDX-License-Identifier: GPL-3.0-or-later
/// Donaldson matrices and (S, alpha, beta) triples from files, and the one call that makes a material of them.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>

#include "spectral/donaldson_matrix.h"
#include "spectral/donaldson_resample.h"
#include "spectral/wavelength_grid.h"

namespace interglow::spectral {

/// What the rows of a matrix in a file are. It is turned to emission rows while reading and nowhere else.
enum class Orientation {
  kEmissionRows,    ///< columns excitation: this project, Labsphere files, Tominaga
  kExcitationRows,  ///< columns emission: CIE and ASTM tables
};

struct DonaldsonFileParams {
  /// Unset: told by the column names, which begin with "ex" (emission rows) or "em" (excitation rows); names that are
  /// bare wavelengths do not tell, and then it has to be set.
  std::optional<Orientation> orientation{};
  DonaldsonResampleParams resample{};
};

/// Reads a matrix: CSV with a line of column names such as "wavelength_nm,ex300,ex310,..." and one row a wavelength; or
/// a triple: columns S (reflectance), alpha (emission, dimensionless) and beta (excitation, 1/nm) over one wavelength
/// column, with D(λ, μ) = alpha(λ) beta(μ) Δμ for λ > μ. The column names tell which of the two it is.
/// @throws InvalidInput with file, line, column and value for a bad table; where the orientation is unknown or
///         contradicts the column names.
BispectralTable read_bispectral_table(const std::filesystem::path& path, std::optional<Orientation> orientation = {});

/// Reads a matrix or a triple and resamples it to the grid (donaldson_resample.h).
/// @returns the matrix and sentences on what the table lacks or what was changed in it
/// @throws as read_bispectral_table and resample.
DonaldsonReading read_donaldson(const std::filesystem::path& path, const WavelengthGrid& grid,
                                const DonaldsonFileParams& params = {});

/// A material without luminescence from a column of reflectances, by band means; the end values hold outside the table.
/// @param column  may be empty where the file has one column
/// @throws InvalidInput for a bad table or values outside [0, 1].
DonaldsonReading read_reflectance(const std::filesystem::path& path, std::string_view column,
                                  const WavelengthGrid& grid);

}  // namespace interglow::spectral
