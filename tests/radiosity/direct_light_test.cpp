// SPDX-License-Identifier: GPL-3.0-or-later
// Shadows of a beam against closed forms and the conservation of its flux.
#include "radiosity/direct_light.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "diagnostics/error.h"
#include "tests/radiosity/reference_cases.h"
#include "tests/radiosity/test_scenes.h"

namespace interglow::radiosity {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using std::numbers::pi;
using test::beam;
using test::grid;
using test::one_band_scene;

const Vector3d kX = Vector3d::UnitX(), kY = Vector3d::UnitY(), kZ = Vector3d::UnitZ();

Eigen::VectorXd factors(const std::vector<mesh::PatchMesh>& meshes, const Vector3d& direction,
                        double half_angle_rad = 0.0) {
  const scene::Scene scene = one_band_scene(meshes, std::vector<double>(meshes.size(), 0.5));
  return directional_term(beam(direction, half_angle_rad), make_elements(scene)).geometric_factor;
}

TEST(DirectLight, SquareShadowsTheOverlapOfItsShadow) {
  // The unit square at height h throws a shadow moved by h (dx, dy) / |dz|: what overlaps the floor's unit square is
  // dark.
  for (const Vector3d& direction :
       {Vector3d(0.3, 0.2, -1.0), Vector3d(-1.5, 0.1, -2.0), Vector3d(0.0, 0.0, -1.0), Vector3d(0.9, -0.9, -0.5)}) {
    for (const double height : {1e-6, 0.01, 0.5, 2.0}) {
      const Eigen::VectorXd found = factors({grid(Vector3d::Zero(), kX, kY), grid(height * kZ, kX, kY)}, direction);
      const Vector3d d = direction.normalized();
      const double x = std::abs(height * d.x() / d.z()), y = std::abs(height * d.y() / d.z());
      const double lit = 1.0 - std::max(0.0, 1.0 - x) * std::max(0.0, 1.0 - y);
      EXPECT_NEAR(found[0], -d.z() * lit, 1e-14) << direction.transpose() << " height " << height;
      EXPECT_NEAR(found[1], -d.z(), 1e-14);
      EXPECT_EQ(found[2], 0.0) << "the floor's back";
      EXPECT_EQ(found[3], 0.0);
    }
  }
}

TEST(DirectLight, ConvexSurfaceNeverShadowsItself) {
  // Half-cylinder of 180 facets under beams that graze every one of them, near and far from the origin.
  std::vector<Vector2d> profile;
  for (int k = 0; k <= 180; ++k)
    profile.emplace_back(1000.0 - 20.0 * std::cos(pi * k / 180), 20.0 * std::sin(pi * k / 180));
  for (int tilt = -89; tilt <= 89; tilt += 1) {
    const Vector3d direction(std::sin(pi * tilt / 180), 0.3, -std::cos(pi * tilt / 180));
    const scene::Scene scene = one_band_scene({test::strips(profile, 30.0)}, {0.5});
    const Elements elements = make_elements(scene);
    const Eigen::VectorXd found = directional_term(beam(direction), elements).geometric_factor;
    for (Eigen::Index e = 0; e < 180; ++e) {
      const double cosine = -elements.normal.row(e).dot(direction.normalized());
      // 1e-12: coordinates of 1000 mm hold facets of 0.35 mm to 3e-13 of their size.
      EXPECT_NEAR(found[e], std::max(0.0, cosine), 1e-12) << "tilt " << tilt << " facet " << e;
    }
  }
}

TEST(DirectLight, TiltedBeamLightsTheGrooveFromTheShadowEdgeOn) {
  int checked = 0;
  for (const auto& entry : test::reference_cases()) {
    if (entry.at("kind") != "radiosity_vgroove_2d_tilted") continue;
    const auto& geometry = entry.at("geometry");
    const auto wall_direction = [&](const char* key) {
      return Vector2d(geometry.at(key).at(0).get<double>(), geometry.at(key).at(1).get<double>());
    };
    const int strips = 7;  // a number that no shadow edge falls on
    std::vector<Vector2d> wall1, wall2;
    for (int k = 0; k <= strips; ++k) {
      wall1.push_back(wall_direction("wall1_dir") * (double(k) / strips));
      wall2.push_back(wall_direction("wall2_dir") * (double(strips - k) / strips));
    }
    const auto& in = entry.at("inputs").at("beam_direction");
    const Eigen::VectorXd found = factors({test::strips(wall1, 5.0), test::strips(wall2, 5.0)},
                                          {in.at(0).get<double>(), 0.0, in.at(1).get<double>()});
    const auto& expected = entry.at("expected");
    for (int wall = 1; wall <= 2; ++wall) {
      const auto number = [&](const std::string& key) {
        return expected.at(key + std::to_string(wall)).at("value").get<double>();
      };
      const double from = number("lit_from_x_wall"), irradiance = number("direct_irradiance_wall");
      for (int k = 0; k < strips; ++k) {
        const double low = double(k) / strips, high = double(k + 1) / strips;
        const double lit = std::clamp((high - std::max(low, from)) / (high - low), 0.0, 1.0);
        const Eigen::Index e = wall == 1 ? k : 2 * strips - 1 - k;
        EXPECT_NEAR(found[e], irradiance * lit, 1e-13) << entry.at("id") << " wall " << wall << " strip " << k;
      }
    }
    ++checked;
  }
  EXPECT_EQ(checked, 2);
}

TEST(DirectLight, EveryRayIsReceivedOnceHoweverFacesIntersect) {
  // Random triangles, passing through one another, over a floor that reaches beyond their shadows: what the beam brings
  // to the floor's outline is what all faces receive.
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  for (int trial = 0; trial < 5; ++trial) {
    mesh::PatchMesh soup;
    for (int t = 0; t < 40; ++t) {
      const Vector3d center(uniform(random), uniform(random), 1.5 + uniform(random));
      const int first = static_cast<int>(soup.points.size());
      for (int k = 0; k < 3; ++k)
        soup.points.push_back(center + 0.4 * Vector3d(uniform(random), uniform(random), uniform(random)));
      soup.faces.push_back({first, first + 1, first + 2, -1});
    }
    const Vector3d direction = Vector3d(0.5 * uniform(random), 0.5 * uniform(random), -1.0).normalized();
    const scene::Scene scene = one_band_scene({grid({-6, -6, 0}, 12 * kX, 12 * kY, 6, 6), soup}, {0.5, 0.5});
    const Elements elements = make_elements(scene);
    const Eigen::VectorXd found = directional_term(beam(direction), elements).geometric_factor;
    EXPECT_NEAR(found.dot(elements.area_mm2), 144.0 * -direction.z(), 1e-11) << "trial " << trial;
    EXPECT_LT(found.head(36).dot(elements.area_mm2.head(36)), 143.5 * -direction.z()) << "nothing was shadowed";
  }
}

TEST(DirectLight, DuplicateFaceInTheSamePlaneHidesNothing) {
  const Eigen::VectorXd found =
      factors({grid(Vector3d::Zero(), kX, kY), grid(Vector3d::Zero(), kX, kY, 3, 3)}, {0.2, 0.1, -1.0});
  for (Eigen::Index e = 0; e < 10; ++e) EXPECT_NEAR(found[e], 1.0 / std::sqrt(1.05), 1e-15) << e;
}

TEST(DirectLight, DiskSourceLightsPlanesByTheCosineOfItsAxis) {
  // ∫ n·l dω over a disk wholly above the horizon is that of its axis.
  for (const double half_angle : {0.005, 0.1, 0.4}) {
    const Vector3d direction(0.4, 0.3, -1.0);
    const Eigen::VectorXd found = factors({grid(Vector3d::Zero(), kX, kY)}, direction, half_angle);
    EXPECT_NEAR(found[0], 1.0 / direction.norm(), 1e-14);
  }
}

TEST(DirectLight, PenumbraOfAHalfPlane) {
  // Edge at height 1 over x = 0: a floor point at x sees the part of the disk (radius tan a in the plane across) beyond
  // the edge, a circular segment. Strips of an eighth of the penumbra; a thirty-second is the resolution stated.
  const double half_angle = 0.05;
  const double width = 2.0 * std::tan(half_angle);
  const int strips = 8;
  const Eigen::VectorXd found = factors(
      {grid({-0.5 * width, -0.5, 0}, width * kX, kY, strips, 1), grid({-9, -9, 1}, 9 * kX, 18 * kY)}, -kZ, half_angle);
  double sum = 0.0;
  for (int k = 0; k < strips; ++k) {
    double mean = 0.0;  // of the visible share 1/2 + (asin t + t √(1-t²)) / π, by the midpoint rule
    const int steps = 1000;
    for (int q = 0; q < steps; ++q) {
      const double t = -1.0 + 2.0 * (k + (q + 0.5) / steps) / strips;
      mean += (0.5 + (std::asin(t) + t * std::sqrt(1.0 - t * t)) / pi) / steps;
    }
    EXPECT_NEAR(found[k], mean, 1.0 / 32.0) << "strip " << k;
    sum += found[k];
  }
  EXPECT_NEAR(sum / strips, 0.5, 1e-13);  // symmetric
}

TEST(DirectLight, SkyAndEmittersComeFromFormFactors) {
  // Two parallel unit squares at distance 1: F = 0.1998248957 (form-factor catalogue C-11).
  scene::Scene scene = one_band_scene({grid(Vector3d::Zero(), kX, kY), grid(kZ, kY, kX)}, {0.5, 0.5});
  scene.objects[1].exitance = Eigen::VectorXd::Constant(1, 3.0);
  scene.sky = scene::SkyLight{"sky", Eigen::VectorXd::Constant(1, 2.0)};
  const Elements elements = make_elements(scene);
  Eigen::Matrix4d F = Eigen::Matrix4d::Zero();
  F(0, 1) = F(1, 0) = 0.19982489569838738;
  const auto terms = direct_light(scene, elements, Transport::from_form_factors(F, elements.area_mm2));
  ASSERT_EQ(terms.size(), 2u);
  const RowMatrix E = total(terms, 4, 1);
  EXPECT_NEAR(E(0, 0), (1.0 - F(0, 1)) * pi * 2.0 + F(0, 1) * 3.0, 1e-14);
  EXPECT_NEAR(E(1, 0), (1.0 - F(0, 1)) * pi * 2.0, 1e-14);
  EXPECT_NEAR(E(2, 0), pi * 2.0, 1e-14);
}

TEST(DirectLight, RefusesADirectionThatIsNoUnitVector) {
  const scene::Scene scene = one_band_scene({grid(Vector3d::Zero(), kX, kY)}, {0.5});
  scene::DirectionalLight light = beam(-kZ);
  light.direction = {0, 0, -2};
  try {
    directional_term(light, make_elements(scene));
    FAIL();
  } catch (const InvalidParams& error) {
    EXPECT_NE(std::string(error.what()).find("length 2"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace interglow::radiosity
