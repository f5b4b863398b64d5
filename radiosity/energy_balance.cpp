// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>

#include "radiosity/solution.h"

namespace interglow::radiosity {
namespace {

/// Exitance of emitting surfaces, front elements only.
RowMatrix emitted(const scene::Scene& scene, const Elements& elements) {
  RowMatrix exitance = RowMatrix::Zero(elements.size(), scene.grid.size());
  for (Eigen::Index e = 0; e < elements.size(); ++e) {
    const auto i = static_cast<std::size_t>(e);
    const scene::Object& object = scene.objects[static_cast<std::size_t>(elements.object[i])];
    if (object.emits() && elements.back[i] == 0) exitance.row(e) = object.exitance.transpose();
  }
  return exitance;
}

}  // namespace

EnergyBalance energy_balance(const scene::Scene& scene, const Elements& elements, const Transport& transport,
                             const Solution& solution) {
  const Eigen::VectorXd area_m2 = 1e-6 * elements.area_mm2;
  const Eigen::VectorXd& width_nm = scene.grid.widths_nm();
  const Eigen::VectorXd& wavelength_nm = scene.grid.centers_nm();
  const auto flux = [&](const RowMatrix& density) { return area_m2.dot(density * width_nm); };

  RowMatrix irradiance = solution.direct + solution.reflected;
  if (solution.luminescent.size() > 0) irradiance += solution.luminescent;
  RowMatrix source = RowMatrix::Zero(irradiance.rows(), irradiance.cols());
  if (solution.reflected_source.size() > 0) source += solution.reflected_source;
  if (solution.luminescent_source.size() > 0) source += solution.luminescent_source;
  const RowMatrix exitance = emitted(scene, elements);
  const bool emitters = (exitance.array() != 0.0).any();

  EnergyBalance balance;
  balance.received = flux(solution.direct);
  if (emitters) balance.received += flux(exitance) - flux(transport.apply(exitance));

  const RowMatrix reflected = reflect(irradiance, scene.materials, elements.material);
  const RowMatrix luminescence = luminesce(irradiance, scene.materials, elements.material);
  // A quantum emitted at λ took one absorbed at μ, whose energy is λ/μ of its own; D_L H is summed with that weight
  // over μ: D_L(λ, μ) λ/μ H(μ) = λ D_L (H/μ).
  const RowMatrix quanta =
      luminesce(irradiance * wavelength_nm.cwiseInverse().asDiagonal(), scene.materials, elements.material) *
      wavelength_nm.asDiagonal();
  const double luminescent_flux = flux(luminescence);
  const double exciting_flux = flux(quanta);
  balance.stokes_loss = exciting_flux - luminescent_flux;
  balance.absorbed = flux(irradiance) - flux(reflected) - exciting_flux;

  const Eigen::VectorXd open_share = Eigen::VectorXd::Ones(transport.size()) - transport.row_sums();
  balance.escaped = area_m2.cwiseProduct(open_share).dot((source + exitance) * width_nm);
  if (solution.bounces) balance.last_bounce = flux(reflected) + luminescent_flux - flux(source);
  const double sum = balance.absorbed + balance.stokes_loss + balance.escaped + balance.last_bounce;
  balance.relative_error =
      balance.received != 0.0 ? std::abs(balance.received - sum) / std::abs(balance.received) : std::abs(sum);
  return balance;
}

}  // namespace interglow::radiosity
