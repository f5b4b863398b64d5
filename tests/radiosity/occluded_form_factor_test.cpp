// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/occluded_form_factor.h"

#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <vector>

namespace interglow::radiosity {
namespace {

using Eigen::Vector3d;

Polygon polygon(const nlohmann::json& corners, double scale) {
  Polygon result;
  for (const auto& corner : corners) {
    result.corner[static_cast<std::size_t>(result.corners++)] =
        scale * Vector3d(corner[0].get<double>(), corner[1].get<double>(), corner[2].get<double>());
  }
  return result;
}

Polygon quad(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d) { return {{a, b, c, d}, 4}; }

/// The unit square at height z, front upwards or downwards.
Polygon unit_square(double z, bool upwards) {
  return upwards ? quad({0, 0, z}, {1, 0, z}, {1, 1, z}, {0, 1, z}) : quad({0, 1, z}, {1, 1, z}, {1, 0, z}, {0, 0, z});
}

class OccludedReference : public testing::TestWithParam<double> {};

TEST_P(OccludedReference, IsMetToTheToleranceAtAnyScaleAndTheErrorEstimateHolds) {
  const double tolerance = GetParam();
  std::ifstream file(INTERGLOW_TEST_DATA "/reference/reference.json");
  ASSERT_TRUE(file) << "tests/data/reference/reference.json is missing";
  const nlohmann::json reference = nlohmann::json::parse(file);
  int cases = 0;
  for (const auto& entry : reference["cases"]) {
    if (entry["kind"] != "ff_polygon_polygon_occluded") continue;
    ++cases;
    for (double scale : {1.0, 1e-6, 1e6}) {
      SCOPED_TRACE(entry["id"].get<std::string>() + " scaled by " + std::to_string(scale));
      const Polygon from = polygon(entry["geometry"]["poly1"], scale);
      const Polygon to = polygon(entry["geometry"]["poly2"], scale);
      std::vector<Polygon> occluders;
      for (const auto& occluder : entry["geometry"]["occluders"]) occluders.push_back(polygon(occluder, scale));
      const double expected = entry["expected"]["F12"]["value"];
      const double trusted = entry["expected"]["F12"]["abs_error_bound"];
      const FormFactor found = form_factor(from, to, occluders, tolerance);
      const double error = std::abs(found.value - expected);
      EXPECT_LE(error, std::max(tolerance, trusted)) << found.value;
      EXPECT_LE(error, found.error_estimate + trusted) << found.value << " found, " << expected << " expected";
      EXPECT_LE(found.error_estimate, tolerance);
      EXPECT_LE(found.value, form_factor(from, to).value);
      if (expected == 0.0) {
        EXPECT_EQ(found.value, 0.0);
        EXPECT_EQ(found.method, FormFactorMethod::kBlocked);
      }
    }
  }
  EXPECT_EQ(cases, 7);
}

INSTANTIATE_TEST_SUITE_P(Tolerances, OccludedReference, testing::Values(1e-3, 1e-4, 1e-6, 1e-9));

TEST(OccludedFormFactor, OverlappingOccludersAreAUnion) {
  const Polygon floor = unit_square(0, true);
  const Polygon ceiling = unit_square(1, false);
  const auto bar = [](double x0, double x1) {
    return quad({x0, 0.2, 0.5}, {x1, 0.2, 0.5}, {x1, 0.8, 0.5}, {x0, 0.8, 0.5});
  };
  const std::vector<Polygon> one = {bar(0.2, 0.7)};
  const std::vector<Polygon> overlapping = {bar(0.2, 0.5), bar(0.35, 0.7), bar(0.4, 0.45)};
  const double whole = form_factor(floor, ceiling, one, 1e-9).value;
  EXPECT_NEAR(form_factor(floor, ceiling, overlapping, 1e-9).value, whole, 2e-9);
  EXPECT_LT(whole, form_factor(floor, ceiling).value);
}

TEST(OccludedFormFactor, ManyOccludersThatCoverTogetherLeaveNothing) {
  std::vector<Polygon> tiles;
  for (int x = 0; x < 3; ++x) {
    for (int y = 0; y < 3; ++y) {
      tiles.push_back(quad({x / 3.0, y / 3.0, 0.5}, {(x + 1) / 3.0, y / 3.0, 0.5}, {(x + 1) / 3.0, (y + 1) / 3.0, 0.5},
                           {x / 3.0, (y + 1) / 3.0, 0.5}));
    }
  }
  EXPECT_NEAR(form_factor(unit_square(0, true), unit_square(1, false), tiles, 1e-6).value, 0.0, 1e-15);
}

TEST(OccludedFormFactor, OccludersThatOnlyTouchThePatchesHideNothing) {
  const Polygon floor = unit_square(0, true);
  const Polygon ceiling = unit_square(1, false);
  const std::vector<Polygon> neighbours = {
      quad({0, 0, 0}, {0, 1, 0}, {0, 1, 1}, {0, 0, 1}),   // a wall on a shared edge
      quad({1, 1, 0}, {2, 1, 0}, {2, 2, 0}, {1, 2, 0}),   // coplanar, at a corner
      quad({0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1})};  // the back of the ceiling
  EXPECT_EQ(form_factor(floor, ceiling, neighbours, 1e-6).value, form_factor(floor, ceiling, 1e-7).value);
}

TEST(OccludedFormFactor, OccludersThatStandInThePatchesPlaneMayHideNothing) {
  // Both planes cross the patches, so that both are asked; an edge of one and a corner of the other span the floor.
  const std::vector<Polygon> walls = {quad({0.5, 3, 0}, {0.5, 4, 0}, {0.5, 4, 0.5}, {0.5, 3, 0.5}),
                                      quad({3, 0.4, 0}, {4, 0.4, 0}, {4, 0.4, 0.5}, {3, 0.4, 0.5})};
  const double expected = form_factor(unit_square(0, true), unit_square(1, false)).value;
  EXPECT_NEAR(form_factor(unit_square(0, true), unit_square(1, false), walls, 1e-6).value, expected, 1e-6);
}

TEST(OccludedFormFactor, AnOccluderThatCrossesThePatchesSplitsThem) {
  // A wall at x = 1/2 from floor to ceiling leaves two halves that see only their own side.
  const std::vector<Polygon> wall = {quad({0.5, -1, -1}, {0.5, 2, -1}, {0.5, 2, 2}, {0.5, -1, 2})};
  const Polygon half_floor = quad({0, 0, 0}, {0.5, 0, 0}, {0.5, 1, 0}, {0, 1, 0});
  const Polygon half_ceiling = quad({0, 1, 1}, {0.5, 1, 1}, {0.5, 0, 1}, {0, 0, 1});
  const double expected = form_factor(half_floor, half_ceiling).value;
  EXPECT_NEAR(form_factor(unit_square(0, true), unit_square(1, false), wall, 1e-10).value, expected, 1e-10);
}

}  // namespace
}  // namespace interglow::radiosity
