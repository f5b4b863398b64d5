// SPDX-License-Identifier: GPL-3.0-or-later
#include "spectral/wavelength_grid.h"

#include <fmt/format.h>

#include <cmath>

#include "diagnostics/error.h"

namespace interglow::spectral {

WavelengthGrid WavelengthGrid::uniform(double first_nm, double last_nm, double step_nm) {
  if (!(first_nm > 0.0) || !(last_nm >= first_nm) || !(step_nm > 0.0) || !std::isfinite(last_nm)) {
    throw InvalidParams(fmt::format(
        "wavelength grid: first {} nm, last {} nm, step {} nm; expected 0 < first <= last and a positive step.",
        first_nm, last_nm, step_nm));
  }
  const double intervals = (last_nm - first_nm) / step_nm;
  const double whole = std::round(intervals);
  if (std::abs(intervals - whole) > 1e-9 * std::max(1.0, whole) || whole > 100000.0) {
    throw InvalidParams(fmt::format(
        "wavelength grid: {} to {} nm is not a whole number of steps of {} nm (or more than 100000). Change the last "
        "wavelength or the step.",
        first_nm, last_nm, step_nm));
  }
  const auto bands = static_cast<Eigen::Index>(whole) + 1;
  Eigen::VectorXd centers(bands);
  for (Eigen::Index i = 0; i < bands; ++i) centers[i] = first_nm + step_nm * static_cast<double>(i);
  WavelengthGrid grid = from_centers(centers);
  if (bands == 1) {
    grid.edges_nm_ << first_nm - step_nm / 2, first_nm + step_nm / 2;
    grid.widths_nm_[0] = step_nm;
  }
  return grid;
}

WavelengthGrid WavelengthGrid::from_centers(const Eigen::VectorXd& centers_nm) {
  const Eigen::Index bands = centers_nm.size();
  if (bands == 0) throw InvalidParams("wavelength grid: no bands; expected at least one.");
  for (Eigen::Index i = 0; i < bands; ++i) {
    if (!std::isfinite(centers_nm[i]) || centers_nm[i] <= 0.0 || (i > 0 && centers_nm[i] <= centers_nm[i - 1])) {
      throw InvalidParams(
          fmt::format("wavelength grid: entry {} is {} nm; expected finite, positive, strictly increasing wavelengths.",
                      i + 1, centers_nm[i]));
    }
  }
  WavelengthGrid grid;
  grid.centers_nm_ = centers_nm;
  grid.edges_nm_.resize(bands + 1);
  for (Eigen::Index i = 1; i < bands; ++i) grid.edges_nm_[i] = 0.5 * (centers_nm[i - 1] + centers_nm[i]);
  // A single band without a known step is 1 nm wide.
  const double first_half = bands > 1 ? grid.edges_nm_[1] - centers_nm[0] : 0.5;
  const double last_half = bands > 1 ? centers_nm[bands - 1] - grid.edges_nm_[bands - 1] : 0.5;
  grid.edges_nm_[0] = centers_nm[0] - first_half;
  grid.edges_nm_[bands] = centers_nm[bands - 1] + last_half;
  grid.widths_nm_ = grid.edges_nm_.tail(bands) - grid.edges_nm_.head(bands);
  return grid;
}

}  // namespace interglow::spectral
