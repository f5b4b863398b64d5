// SPDX-License-Identifier: GPL-3.0-or-later
// Where the flux goes, against closed forms of two plates that see only one another.
#include <gtest/gtest.h>

#include <cmath>

#include "radiosity/solution.h"
#include "tests/radiosity/test_scenes.h"

namespace interglow::radiosity {
namespace {

using Eigen::Vector3d;
using Vector = Eigen::VectorXd;

/// Two plates of 2 m² with given view factor between their fronts; bands at 400 and 500 nm, 100 nm wide.
struct Plates {
  scene::Scene scene;
  Elements elements;
  Transport transport;

  Plates(const spectral::DonaldsonMatrix& material, double view_factor)
      : scene(make(material)), elements(make_elements(scene)), transport(between(elements, view_factor)) {}

  static scene::Scene make(const spectral::DonaldsonMatrix& material) {
    scene::Scene scene =
        test::one_band_scene({test::grid({0, 0, 0}, 2000 * Vector3d::UnitX(), 1000 * Vector3d::UnitY()),
                              test::grid({0, 0, 1}, 2000 * Vector3d::UnitY(), 1000 * Vector3d::UnitX())},
                             {0.5, 0.5});
    scene.grid = spectral::WavelengthGrid::from_centers(Eigen::Vector2d(400, 500));
    scene.materials = {{"m", material}, {"m", material}};
    return scene;
  }
  static Transport between(const Elements& elements, double view_factor) {
    Eigen::MatrixXd F = Eigen::MatrixXd::Zero(elements.size(), elements.size());
    F(0, 1) = F(1, 0) = view_factor;
    return Transport::from_form_factors(F, elements.area_mm2);
  }
  EnergyBalance balance(const RowMatrix& direct, std::optional<int> bounces) const {
    return energy_balance(
        scene, elements, transport,
        solve(transport, scene.materials, elements.material, direct, {.bounces = bounces, .tolerance = 1e-14}));
  }
};

spectral::DonaldsonMatrix grey(double reflectance) { return {Vector::Constant(2, reflectance), Eigen::MatrixXd()}; }

RowMatrix light_on_first(double at_400, double at_500) {
  RowMatrix direct = RowMatrix::Zero(4, 2);
  direct.row(0) << at_400, at_500;
  return direct;
}

TEST(EnergyBalance, GreyPlates) {
  const double rho = 0.6, F = 0.8;
  const Plates plates(grey(rho), F);
  const double received = 2.0 * 100.0 * (3.0 + 1.0);  // m² × nm × W m^-2 nm^-1
  const EnergyBalance all = plates.balance(light_on_first(3, 1), {});
  EXPECT_NEAR(all.received, received, 1e-10);
  EXPECT_NEAR(all.absorbed, received * (1.0 - rho) / (1.0 - rho * F), 1e-10);
  EXPECT_NEAR(all.escaped, received * rho * (1.0 - F) / (1.0 - rho * F), 1e-10);
  EXPECT_NEAR(all.stokes_loss, 0.0, 1e-10);
  EXPECT_EQ(all.last_bounce, 0.0);
  EXPECT_LE(all.relative_error, 1e-13);
  for (int n = 0; n <= 3; ++n) {
    const EnergyBalance some = plates.balance(light_on_first(3, 1), n);
    EXPECT_NEAR(some.last_bounce, received * rho * std::pow(rho * F, n), 1e-10) << n;
    EXPECT_LE(some.relative_error, 1e-13) << n;
  }
}

TEST(EnergyBalance, StokesLossIsTheEnergyThatQuantaGiveUp) {
  // Half of the power at 400 nm comes out at 500 nm: 0.5 × 500 / 400 = 0.625 of the quanta are re-emitted and lose
  // 0.125 of the power; 0.375 turns to heat.
  spectral::DonaldsonMatrix material{Vector::Zero(2), Eigen::MatrixXd::Zero(2, 2)};
  material.luminescence(1, 0) = 0.5;
  const EnergyBalance balance = Plates(material, 0.0).balance(light_on_first(1, 0), {});
  EXPECT_NEAR(balance.received, 200.0, 1e-12);
  EXPECT_NEAR(balance.stokes_loss, 0.125 * 200.0, 1e-12);
  EXPECT_NEAR(balance.absorbed, 0.375 * 200.0, 1e-12);
  EXPECT_NEAR(balance.escaped, 0.5 * 200.0, 1e-12);
  EXPECT_LE(balance.relative_error, 1e-14);
}

TEST(EnergyBalance, EmittedLightThatEscapesCounts) {
  // Plate 0 emits 1; of it F reaches plate 1. Backs are black and see nothing.
  const double rho = 0.5, F = 0.3;
  Plates plates(grey(rho), F);
  plates.scene.objects[0].exitance = Vector::Ones(2);
  RowMatrix direct = RowMatrix::Zero(4, 2);
  direct.row(1).setConstant(F);
  const EnergyBalance balance = plates.balance(direct, {});
  const double emitted = 2.0 * 200.0;
  EXPECT_NEAR(balance.received, emitted, 1e-10);
  // Series of flights: flux F^k ρ^(k-1) arrives at flight k.
  EXPECT_NEAR(balance.absorbed, emitted * F * (1.0 - rho) / (1.0 - rho * F), 1e-10);
  EXPECT_NEAR(balance.escaped, emitted * (1.0 - F) / (1.0 - rho * F), 1e-10);
  EXPECT_LE(balance.relative_error, 1e-13);
}

}  // namespace
}  // namespace interglow::radiosity
