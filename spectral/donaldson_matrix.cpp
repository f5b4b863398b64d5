// SPDX-License-Identifier: GPL-3.0-or-later
#include "spectral/donaldson_matrix.h"

#include <fmt/format.h>

#include <cmath>

namespace interglow::spectral {
namespace {

// Tables are written with four or more digits; an excess or a negative entry below this is their rounding.
constexpr double kRounding = 1e-4;

void require_sizes(const Material& material, const WavelengthGrid& grid) {
  const DonaldsonMatrix& D = material.donaldson;
  if (D.reflectance.size() != grid.size()) {
    throw InvalidInput(fmt::format(
        "material \"{}\": reflectance has {} bands, expected {} ({} to {} nm). Resample the table to the grid.",
        material.name, D.reflectance.size(), grid.size(), grid.size() > 0 ? grid.center_nm(0) : 0.0,
        grid.size() > 0 ? grid.center_nm(grid.size() - 1) : 0.0));
  }
  if (D.luminesces() && (D.luminescence.rows() != grid.size() || D.luminescence.cols() != grid.size())) {
    throw InvalidInput(
        fmt::format("material \"{}\": luminescence is {} x {}, expected {} x {} as the wavelength grid. Resample the "
                    "table to the grid.",
                    material.name, D.luminescence.rows(), D.luminescence.cols(), grid.size(), grid.size()));
  }
}

void require_usable_values(const Material& material, const WavelengthGrid& grid) {
  const DonaldsonMatrix& D = material.donaldson;
  for (Eigen::Index i = 0; i < grid.size(); ++i) {
    const double S = D.reflectance[i];
    if (!(S >= 0.0 && S <= 1.0)) {
      throw InvalidInput(fmt::format("material \"{}\": reflectance at {} nm is {}; expected 0 to 1. Correct the table.",
                                     material.name, grid.center_nm(i), S));
    }
  }
  if (!D.luminesces()) return;
  for (Eigen::Index j = 0; j < grid.size(); ++j) {
    for (Eigen::Index i = 0; i < grid.size(); ++i) {
      if (!std::isfinite(D.luminescence(i, j))) {
        throw InvalidInput(fmt::format(
            "material \"{}\": luminescence at emission {} nm, excitation {} nm is {}; expected a finite number.",
            material.name, grid.center_nm(i), grid.center_nm(j), D.luminescence(i, j)));
      }
    }
    if (D.luminescence(j, j) != 0.0) {
      throw InvalidInput(
          fmt::format("material \"{}\": luminescence has {} on its diagonal at {} nm; expected 0, for same-band "
                      "luminescence is part "
                      "of the reflectance. Add it there.",
                      material.name, D.luminescence(j, j), grid.center_nm(j)));
    }
  }
}

}  // namespace

Eigen::VectorXd emitted_over_received(const DonaldsonMatrix& donaldson, const WavelengthGrid& grid) {
  Eigen::VectorXd ratio = donaldson.reflectance;
  if (donaldson.luminesces()) {
    ratio.array() += (donaldson.luminescence.transpose() * grid.widths_nm()).array() / grid.widths_nm().array();
  }
  return ratio;
}

Warnings validate(const Material& material, const WavelengthGrid& grid) {
  require_sizes(material, grid);
  require_usable_values(material, grid);
  Warnings warnings;
  if (!material.donaldson.luminesces()) return warnings;
  const Eigen::VectorXd ratio = emitted_over_received(material.donaldson, grid);
  Eigen::Index worst = 0;
  if (grid.size() > 0 && ratio.maxCoeff(&worst) > 1.0 + kRounding) {
    warnings.push_back(
        fmt::format("material \"{}\": excitation column {} nm emits {:.2f} % more energy than it receives ({} of {} "
                    "columns emit too "
                    "much). The measurement is noisy there; an infinite solve may not converge.",
                    material.name, grid.center_nm(worst), 100.0 * (ratio[worst] - 1.0),
                    (ratio.array() > 1.0 + kRounding).count(), grid.size()));
  }
  Eigen::Index row = 0;
  Eigen::Index column = 0;
  if (grid.size() > 0 && material.donaldson.luminescence.minCoeff(&row, &column) < -kRounding) {
    warnings.push_back(
        fmt::format("material \"{}\": {} entries of the luminescence are negative, the lowest {:.3g} at emission {} "
                    "nm, excitation {} nm.",
                    material.name, (material.donaldson.luminescence.array() < -kRounding).count(),
                    material.donaldson.luminescence(row, column), grid.center_nm(row), grid.center_nm(column)));
  }
  return warnings;
}

}  // namespace interglow::spectral
