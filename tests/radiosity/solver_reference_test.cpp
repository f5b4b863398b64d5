// SPDX-License-Identifier: GPL-3.0-or-later
// Closed-form radiosity cases: given form factors, the solver meets exact rational solutions.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "diagnostics/error.h"
#include "radiosity/form_factor.h"
#include "radiosity/solution.h"
#include "tests/radiosity/reference_cases.h"

namespace interglow::radiosity {
namespace {

using nlohmann::json;
using test::reference_cases;

double rational(const std::string& text) {
  const auto slash = text.find('/');
  return slash == std::string::npos ? std::stod(text)
                                    : std::stod(text.substr(0, slash)) / std::stod(text.substr(slash + 1));
}

double value(const json& number) { return number.at("value").get<double>(); }

spectral::Material grey(double reflectance, Eigen::Index bands = 1) {
  return {"grey", {.reflectance = Eigen::VectorXd::Constant(bands, reflectance), .luminescence = {}}};
}

spectral::Material from_donaldson(const json& rows) {
  const auto bands = static_cast<Eigen::Index>(rows.size());
  spectral::Material material{"fluorescent", {Eigen::VectorXd(bands), Eigen::MatrixXd::Zero(bands, bands)}};
  for (Eigen::Index r = 0; r < bands; ++r) {
    for (Eigen::Index c = 0; c < bands; ++c) {
      const double entry =
          rational(rows.at(static_cast<std::size_t>(r)).at(static_cast<std::size_t>(c)).get<std::string>());
      (r == c ? material.donaldson.reflectance[r] : material.donaldson.luminescence(r, c)) = entry;
    }
  }
  return material;
}

RowMatrix whole_irradiance(const Solution& solution) {
  RowMatrix sum = solution.direct + solution.reflected;
  if (solution.luminescent.size() > 0) sum += solution.luminescent;
  return sum;
}

/// B = D H of all components.
RowMatrix radiosity(const Components& parts) { return parts.re + parts.rr + parts.le + parts.lr + parts.ll + parts.rl; }

void expect_rows(const RowMatrix& found, const json& expected, const std::string& what) {
  for (Eigen::Index i = 0; i < found.rows(); ++i) {
    for (Eigen::Index b = 0; b < found.cols(); ++b) {
      EXPECT_NEAR(found(i, b), value(expected.at(static_cast<std::size_t>(i)).at(static_cast<std::size_t>(b))), 1e-12)
          << what << ", surface " << i << ", band " << b;
    }
  }
}

struct TwoSurfaces {
  Transport transport;
  std::vector<spectral::Material> materials;
  std::vector<int> element_material{0, 1};
  RowMatrix direct;
};

TwoSurfaces two_surfaces(const json& entry) {
  const json& factors = entry.at("geometry").at("form_factors");
  Eigen::MatrixXd F(2, 2);
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 2; ++j) {
      F(i, j) = rational(factors.at(static_cast<std::size_t>(i)).at(static_cast<std::size_t>(j)).get<std::string>());
    }
  }
  const json& inputs = entry.at("inputs");
  // Reciprocity A1 F12 = A2 F21 gives the ratio of the areas.
  TwoSurfaces scene{.transport = Transport::from_form_factors(F, Eigen::Vector2d(F(1, 0), F(0, 1))),
                    .materials = {from_donaldson(inputs.at("D").at(0)), from_donaldson(inputs.at("D").at(1))},
                    .direct = {}};
  const json& light = inputs.at("E_direct_irradiance");
  scene.direct.resize(2, scene.materials[0].donaldson.bands());
  for (Eigen::Index i = 0; i < 2; ++i) {
    for (Eigen::Index b = 0; b < scene.direct.cols(); ++b) {
      scene.direct(i, b) =
          rational(light.at(static_cast<std::size_t>(i)).at(static_cast<std::size_t>(b)).get<std::string>());
    }
  }
  return scene;
}

TEST(SolverReference, FluorescentSurfacesBounceByBounceAndComponentByComponent) {
  int checked = 0;
  for (const json& entry : reference_cases()) {
    if (entry.at("kind") != "radiosity_fluorescent_two_surface") continue;
    const auto id = entry.at("id").get<std::string>();
    const json& expected = entry.at("expected");
    const TwoSurfaces scene = two_surfaces(entry);
    const auto solved = [&](std::optional<int> bounces) {
      return solve(scene.transport, scene.materials, scene.element_material, scene.direct, {.bounces = bounces});
    };
    const auto parts_of = [&](const Solution& solution) {
      return components(solution, scene.materials, scene.element_material);
    };
    const RowMatrix none = radiosity(parts_of(solved(0)));
    const Components one_parts = parts_of(solved(1));
    const RowMatrix one = radiosity(one_parts);
    const RowMatrix two = radiosity(parts_of(solved(2)));
    const Solution all = solved({});
    EXPECT_TRUE(all.converged) << id;
    expect_rows(none, expected.at("direct"), id + " direct");
    expect_rows(one, expected.at("cumulative_after_one_bounce"), id + " after one bounce");
    expect_rows(one - none, expected.at("one_bounce_term"), id + " one bounce");
    expect_rows(two - one, expected.at("two_bounce_term"), id + " two bounces");
    expect_rows(radiosity(parts_of(all)), expected.at("infinite"), id + " infinite");
    const auto component = [&](const RowMatrix& found, const char* key) {
      expect_rows(found,
                  json::array({expected.at("components_one_bounce").at(0).at(key),
                               expected.at("components_one_bounce").at(1).at(key)}),
                  id + " " + key);
    };
    component(one_parts.re, "re");
    component(one_parts.rr, "rr");
    component(one_parts.le, "le");
    component(one_parts.lr, "lr");
    component(one_parts.ll, "ll");
    component(one_parts.rl, "rl");
    ++checked;
  }
  EXPECT_EQ(checked, 3);
}

TEST(SolverReference, ParallelPlates) {
  int checked = 0;
  for (const json& entry : reference_cases()) {
    if (entry.at("kind") != "radiosity_parallel_plates") continue;
    const json& in = entry.at("inputs");
    const Transport transport = Transport::from_form_factors(Eigen::Matrix2d{{0, 1}, {1, 0}}, Eigen::Vector2d(1, 1));
    // The case gives exitance; the same exitance is reflected from irradiance E / ρ.
    const std::vector<spectral::Material> materials = {grey(in.at("rho1").get<double>()),
                                                       grey(in.at("rho2").get<double>())};
    RowMatrix direct(2, 1);
    direct << in.at("E1").get<double>() / in.at("rho1").get<double>(),
        in.at("E2").get<double>() / in.at("rho2").get<double>();
    for (const bool one_bounce : {true, false}) {
      const Solution solution =
          solve(transport, materials, {0, 1}, direct, {.bounces = one_bounce ? std::optional<int>(1) : std::nullopt});
      const RowMatrix B = reflect(whole_irradiance(solution), materials, {0, 1});
      const char* keys[2] = {one_bounce ? "B1_after_one_bounce" : "B1", one_bounce ? "B2_after_one_bounce" : "B2"};
      for (Eigen::Index i = 0; i < 2; ++i) {
        const double exact = value(entry.at("expected").at(keys[i]));
        EXPECT_NEAR(B(i, 0), exact, 1e-12 * std::max(1.0, exact)) << entry.at("id") << ' ' << keys[i];
      }
    }
    ++checked;
  }
  EXPECT_EQ(checked, 4);
}

/// The inside of a sphere in patches of given shares of its area; `open` of it is missing. Every point of a sphere sees
/// every share of it equally: F_ij = share_j.
Transport sphere(const Eigen::VectorXd& share) {
  return Transport::from_form_factors(Eigen::VectorXd::Ones(share.size()) * share.transpose(), share);
}

TEST(SolverReference, SphereWithAndWithoutAperture) {
  int checked = 0;
  for (const json& entry : reference_cases()) {
    if (entry.at("kind") != "radiosity_sphere" && entry.at("kind") != "radiosity_sphere_aperture") continue;
    const json& in = entry.at("inputs");
    const json& geometry = entry.at("geometry");
    const double open = geometry.contains("aperture_area_fraction_of_sphere")
                            ? geometry.at("aperture_area_fraction_of_sphere").get<double>()
                            : 0.0;
    const double rho = in.at("rho").get<double>();
    const double lit = in.at("f").get<double>();
    Eigen::VectorXd share(12);  // the first two patches are lit; unequal areas
    share << 0.25 * lit, 0.75 * lit, Eigen::VectorXd::LinSpaced(10, 1.0, 10.0) * (1.0 - lit - open) / 55.0;
    const Transport transport = sphere(share);
    const std::vector<spectral::Material> materials = {grey(rho)};
    const std::vector<int> element_material(12, 0);
    RowMatrix direct = RowMatrix::Zero(12, 1);
    direct.topRows(2).setOnes();
    const auto irradiance = [&](std::optional<int> bounces) {
      return solve(transport, materials, element_material, direct, {.bounces = bounces, .tolerance = 1e-14}).reflected;
    };
    const json& expected = entry.at("expected");
    const double exact = value(expected.at(open > 0 ? "indirect_irradiance" : "indirect_irradiance_everywhere"));
    const RowMatrix all = irradiance({});
    const RowMatrix one = irradiance(1);
    for (Eigen::Index i = 0; i < 12; ++i) {
      EXPECT_NEAR(all(i, 0), exact, 1e-12 * exact / (1.0 - rho)) << entry.at("id") << " patch " << i;
      EXPECT_NEAR(one(i, 0), value(expected.at("one_bounce_indirect_irradiance")), 1e-14) << entry.at("id");
    }
    if (expected.contains("two_bounce_indirect_irradiance")) {
      const RowMatrix second = irradiance(2) - one;
      EXPECT_NEAR(second(5, 0), value(expected.at("two_bounce_indirect_irradiance")), 1e-14) << entry.at("id");
    }
    ++checked;
  }
  EXPECT_EQ(checked, 7);
}

/// The inside of the unit cube, one patch a face (bottom, top, four sides), as `form_factor` gives it.
Transport cube() {
  using Vector = Eigen::Vector3d;
  const auto square = [](const Vector& corner, const Vector& u, const Vector& v) {
    return Polygon{{corner, corner + u, corner + u + v, corner + v}, 4};
  };
  const Vector x = Vector::UnitX(), y = Vector::UnitY(), z = Vector::UnitZ(), o = Vector::Zero();
  const std::vector<Polygon> faces = {square(o, x, y), square(z, y, x), square(o, z, x),
                                      square(y, x, z), square(o, y, z), square(x, z, y)};
  Eigen::MatrixXd F(6, 6);
  for (Eigen::Index i = 0; i < 6; ++i) {
    for (Eigen::Index j = 0; j < 6; ++j) {
      F(i, j) =
          i == j ? 0.0 : form_factor(faces[static_cast<std::size_t>(i)], faces[static_cast<std::size_t>(j)]).value;
    }
  }
  return Transport::from_form_factors(F, Eigen::VectorXd::Ones(6));
}

/// Irradiance that stands for an exitance: the lumped system is linear in it.
Eigen::VectorXd lumped(const Transport& transport, const std::vector<double>& rho,
                       const std::vector<double>& exitance) {
  std::vector<spectral::Material> materials;
  std::vector<int> element_material;
  RowMatrix direct(6, 1);
  for (std::size_t i = 0; i < 6; ++i) {
    materials.push_back(grey(rho[i]));
    element_material.push_back(static_cast<int>(i));
    direct(static_cast<Eigen::Index>(i), 0) = exitance[i] / rho[i];
  }
  const Solution solution = solve(transport, materials, element_material, direct, {.tolerance = 1e-14});
  EXPECT_TRUE(solution.converged);
  return reflect(whole_irradiance(solution), materials, element_material).col(0);
}

TEST(SolverReference, CubeWithOnePatchAFace) {
  int checked = 0;
  for (const json& entry : reference_cases()) {
    if (entry.at("kind") != "radiosity_cube") continue;
    const json& rho = entry.at("inputs").at("rho");
    const json& E = entry.at("inputs").at("E");
    const auto faces = [](const json& of) {
      const auto side = of.at("side").get<double>();
      return std::vector<double>{of.at("bottom").get<double>(), of.at("top").get<double>(), side, side, side, side};
    };
    const Eigen::VectorXd B = lumped(cube(), faces(rho), faces(E));
    const char* names[3] = {"bottom", "top", "side"};
    for (Eigen::Index i = 0; i < 6; ++i) {
      const char* name = names[std::min<Eigen::Index>(i, 2)];
      EXPECT_NEAR(B[i], value(entry.at("expected").at(name).at("lumped_radiosity")), 1e-12)
          << entry.at("id") << ' ' << name;
    }
    ++checked;
  }
  EXPECT_EQ(checked, 3);
}

TEST(SolverReference, NearlyClosedEnclosuresKeepTheDigitsThatRoundingLeaves) {
  int checked = 0;
  for (const json& entry : reference_cases()) {
    if (entry.at("kind") != "ill_conditioned" || !entry.at("inputs").contains("rho")) continue;
    const double rho = entry.at("inputs").at("rho").get<double>();
    const Eigen::VectorXd B = lumped(cube(), std::vector<double>(6, rho), {0, 1, 0, 0, 0, 0});
    const double exact = value(entry.at("expected").at("area_mean_B"));
    // Row sums off by a rounding δ change the mean by ρ δ / (1 - ρ), relatively; δ is a few 1e-16.
    EXPECT_NEAR(B.mean(), exact, 4e-16 / (1.0 - rho) * exact + 1e-14) << entry.at("id");
    ++checked;
  }
  EXPECT_EQ(checked, 4);
}

TEST(SolverReference, ClosedSceneThatAbsorbsNothingIsRefused) {
  try {
    lumped(cube(), std::vector<double>(6, 1.0), {0, 1, 0, 0, 0, 0});
    FAIL() << "a number came out of a singular system";
  } catch (const NumericalFailure& failure) {
    EXPECT_NE(std::string(failure.what()).find("singular"), std::string::npos) << failure.what();
  }
}

TEST(SolverReference, ClosedRoomHasTheMeanOfTheGeometricSeries) {
  int checked = 0;
  for (const json& entry : reference_cases()) {
    if (entry.at("kind") != "radiosity_closed_room_mean") continue;
    const double rho = entry.at("inputs").at("rho").get<double>();
    const std::vector<spectral::Material> materials = {grey(rho)};
    const std::vector<int> element_material(6, 0);
    const json& expected = entry.at("expected");
    const double mean = value(expected.at("mean_direct_illuminance"));
    RowMatrix direct(6, 1);
    direct << 0.5, 2.0, 0.25, 1.25, 0.75, 1.25;  // any distribution with mean 1
    direct *= mean;
    const Transport room = cube();
    const Solution all = solve(room, materials, element_material, direct, {.tolerance = 1e-14});
    const Solution one = solve(room, materials, element_material, direct, {.bounces = 1});
    EXPECT_NEAR(all.reflected.mean(), value(expected.at("mean_indirect_illuminance")), 1e-12 * mean / (1.0 - rho))
        << entry.at("id");
    EXPECT_NEAR(one.reflected.mean(), value(expected.at("mean_indirect_after_1_bounce")), 1e-12 * mean)
        << entry.at("id");
    ++checked;
  }
  EXPECT_EQ(checked, 4);
}

}  // namespace
}  // namespace interglow::radiosity
