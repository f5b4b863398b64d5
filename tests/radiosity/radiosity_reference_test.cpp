// SPDX-License-Identifier: GPL-3.0-or-later
// Meshes against continuous solutions: V-grooves and touching half-cylinders as long strips, the cube.
// Piecewise constant sources integrated exactly make the irradiance gathered from them second order in the patch size.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>

#include "tests/radiosity/reference_solve.h"

namespace interglow::radiosity {
namespace {

using Eigen::Vector3d;
using nlohmann::json;
using std::numbers::pi;
using test::solved;
using test::Solved;
using test::value;

TEST(RadiosityReference, VGrooveFallsAtSecondOrder) {
  int checked = 0;
  for (const json& entry : test::reference_cases()) {
    if (entry.at("kind") != "radiosity_vgroove_2d") continue;
    const double half = 0.5 * pi / 180.0 * entry.at("geometry").at("opening_angle_deg").get<double>();
    const double rho = entry.at("inputs").at("rho").get<double>();
    std::vector<double> worst;
    for (const int strips : {40, 80}) {
      // Exitance 1 on the walls is irradiance 1 / ρ.
      const Solved groove =
          solved(test::v_groove(half, strips), {rho, rho}, [&](const Elements&, Eigen::Index) { return 1.0 / rho; });
      double error = 0.0;
      for (const json& at : entry.at("expected").at("B")) {
        const double x = at.at("x").get<double>();
        const Vector3d point(x * std::sin(half), 0.0, x * std::cos(half)), normal(-std::cos(half), 0.0, std::sin(half));
        const double B = 1.0 + rho * groove.gathered(point, normal);
        error = std::max(error, std::abs(B / value(at.at("B")) - 1.0));
      }
      worst.push_back(error);
    }
    EXPECT_NEAR(std::log2(worst[0] / worst[1]), 2.0, 0.15) << entry.at("id");
    // A kernel of width sin(2 half) x, strips of width 6 x / strips: second order with a constant near 1 / (1 - ρ).
    const double width = 6.0 / 80.0 / std::sin(2.0 * half);
    EXPECT_LE(worst[1], 0.1 * width * width / (1.0 - rho)) << entry.at("id");
    ++checked;
  }
  EXPECT_EQ(checked, 12);
}

TEST(RadiosityReference, TouchingHalfCylindersFallAtSecondOrderWhereTheKernelIsResolved) {
  int checked = 0;
  for (const json& entry : test::reference_cases()) {
    if (entry.at("kind") != "radiosity_half_cylinders_2d") continue;
    const json& in = entry.at("inputs");
    const json& bands = entry.at("expected").at("band_mean_radiosity");
    std::vector<std::vector<double>> error;  // per refinement: left and right of every band
    for (const int refinement : {8, 16}) {
      const std::vector<double> angle = test::half_cylinder_angles(refinement);
      const Solved cusp =
          solved(test::half_cylinders(angle), {in.at("rho_left").get<double>(), in.at("rho_right").get<double>()},
                 [](const Elements& elements, Eigen::Index e) { return std::max(0.0, elements.normal(e, 2)); });
      const auto count = static_cast<Eigen::Index>(angle.size()) - 1;
      error.emplace_back();
      for (const json& band : bands) {
        const double from = band.at("t_deg").at(0).get<double>(), to = band.at("t_deg").at(1).get<double>();
        double mean_left = 0.0, mean_right = 0.0;
        for (Eigen::Index k = 0; k < count; ++k) {
          const double a = angle[static_cast<std::size_t>(k)], b = angle[static_cast<std::size_t>(k) + 1];
          if (a < from - 1e-9 || b > to + 1e-9) continue;
          mean_left += cusp.radiosity(count - 1 - k) * (b - a) / (to - from);
          mean_right += cusp.radiosity(count + k) * (b - a) / (to - from);
        }
        error.back().push_back(std::abs(mean_left / value(band.at("left")) - 1.0));
        error.back().push_back(std::abs(mean_right / value(band.at("right")) - 1.0));
      }
    }
    for (std::size_t b = 0; b < bands.size(); ++b) {
      const double from = bands.at(b).at("t_deg").at(0).get<double>();
      for (std::size_t side = 0; side < 2; ++side) {
        const double coarse = error[0][2 * b + side], fine = error[1][2 * b + side];
        // The kernel at t is t² wide: patches of 1/16 of a band resolve it from 5° on. At 10-20° the errors of facets
        // and of sources have opposite signs and pass through 0: no order is seen there.
        if (from >= 5.0 && from != 10.0) {
          EXPECT_NEAR(std::log2(coarse / fine), 2.0, 0.15) << entry.at("id") << " from " << from;
        } else {
          EXPECT_LE(fine, 0.5 * coarse + 1e-5) << entry.at("id") << " from " << from;
        }
        EXPECT_LE(fine, from >= 20.0 ? 1e-4 : 1e-2) << entry.at("id") << " from " << from;
      }
    }
    ++checked;
  }
  EXPECT_EQ(checked, 2);
}

TEST(RadiosityReference, CubeMeansFallAtSecondOrderUpToTheEdges) {
  int checked = 0;
  for (const json& entry : test::reference_cases()) {
    if (entry.at("kind") != "radiosity_cube") continue;
    const json& rho = entry.at("inputs").at("rho");
    const json& E = entry.at("inputs").at("E");
    const char* names[6] = {"bottom", "top", "side", "side", "side", "side"};
    std::vector<double> reflectance, exitance;
    for (const char* name : names) {
      reflectance.push_back(rho.at(name).get<double>());
      exitance.push_back(E.at(name).get<double>());
    }
    std::vector<Eigen::Vector3d> error;
    for (const int n : {4, 8}) {
      const Solved cube = solved(test::cube(n), reflectance, [&](const Elements& elements, Eigen::Index e) {
        const auto face = static_cast<std::size_t>(elements.object[static_cast<std::size_t>(e)]);
        return exitance[face] / reflectance[face];
      });
      error.emplace_back();
      for (int face = 0; face < 3; ++face) {
        double mean = 0.0;
        for (int k = 0; k < n * n; ++k) mean += cube.radiosity(face * n * n + k) / (n * n);
        error.back()[face] = std::abs(mean - value(entry.at("expected").at(names[face]).at("mean_radiosity")));
      }
    }
    for (int face = 0; face < 3; ++face) {
      // h² log h: radiosity has infinite slope at the edges, so the order seen at 8 patches an edge is below 2.
      const double order = std::log2(error[0][face] / error[1][face]);
      EXPECT_GT(order, 1.45) << entry.at("id") << ' ' << names[face];
      EXPECT_LT(order, 2.1) << entry.at("id") << ' ' << names[face];
      EXPECT_LE(error[1][face], 2.5e-3) << entry.at("id") << ' ' << names[face];
    }
    ++checked;
  }
  EXPECT_EQ(checked, 3);
}

}  // namespace
}  // namespace interglow::radiosity
