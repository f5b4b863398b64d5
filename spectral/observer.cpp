// SPDX-License-Identifier: GPL-3.0-or-later
#include "spectral/observer.h"

#include <fmt/format.h>

#include <array>
#include <cmath>

#include "diagnostics/error.h"
#include "spectral/shipped_tables.h"
#include "spectral/spectrum.h"
#include "spectral/table_file.h"

namespace interglow::spectral {

TristimulusWeights cie1931_weights(const WavelengthGrid& grid) {
  const NumericTable table = read_csv_table(find_table("interglow:observers/cie1931_2deg_1nm"));
  if (table.column.size() != 3) {
    throw InvalidInput(fmt::format("{}: {} columns; expected xbar, ybar and zbar. Install the tables again.",
                                   table.path, table.column.size()));
  }
  TristimulusWeights weights(grid.size(), 3);
  for (Eigen::Index i = 0; i < 3; ++i) {
    const Spectrum function{table.wavelength_nm, table.value.col(i), table.path};
    weights.col(i) = band_means(function, grid, Outside::kZero).cwiseProduct(grid.widths_nm());
  }
  return weights;
}

double reference_white_scale(const TristimulusWeights& weights, const Eigen::VectorXd& irradiance) {
  const double luminance = weights.col(1).dot(irradiance);
  if (!(luminance > 0.0) || !std::isfinite(luminance)) {
    throw InvalidParams(
        fmt::format("reference white: the light's luminance is {}; expected a positive number. Choose a light that is "
                    "visible in the "
                    "image's bands.",
                    luminance));
  }
  return 1.0 / luminance;
}

}  // namespace interglow::spectral
