// SPDX-License-Identifier: GPL-3.0-or-later
// Every unoccluded polygon case of the reference set, computed there with 45 digits.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "radiosity/form_factor.h"
#include "tests/radiosity/reference_cases.h"

namespace interglow::radiosity {
namespace {

using test::allowance;
using test::polygon_of;
using test::reference_case;
using test::reference_cases;

TEST(FormFactorReference, PolygonPairsAreExactToTwelveDigits) {
  int checked = 0;
  for (const auto& entry : reference_cases()) {
    if (entry.at("kind") != "ff_polygon_polygon") continue;
    const Polygon a = polygon_of(entry.at("geometry").at("poly1")), b = polygon_of(entry.at("geometry").at("poly2"));
    const auto& expected = entry.at("expected");
    const auto check = [&](const FormFactor& found, const char* key) {
      const auto& number = expected.at(key);
      const double error = std::abs(found.value - number.at("value").get<double>());
      EXPECT_LE(error, allowance(number)) << entry.at("id") << ' ' << key << " found " << found.value;
      // The expected value itself is rounded to a double.
      EXPECT_LE(error, found.error_estimate + 1.2e-16 * found.value)
          << entry.at("id") << ' ' << key << ": estimate too small";
      EXPECT_LE(found.error_estimate, 1e-12) << entry.at("id") << ' ' << key;
    };
    check(form_factor(a, b), "F12");
    check(form_factor(b, a), "F21");
    check(exchange_area(a, b, 0.0), "A1F12");
    ++checked;
  }
  EXPECT_EQ(checked, 39);
}

TEST(FormFactorReference, EstimateCoversTheErrorAtEveryTolerance) {
  for (const auto& entry : reference_cases()) {
    if (entry.at("kind") != "ff_polygon_polygon") continue;
    const Polygon a = polygon_of(entry.at("geometry").at("poly1")), b = polygon_of(entry.at("geometry").at("poly2"));
    for (const double tolerance : {1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-12}) {
      const auto check = [&](const FormFactor& found, const char* key) {
        const double error = std::abs(found.value - entry.at("expected").at(key).at("value").get<double>());
        EXPECT_LE(found.error_estimate, tolerance) << entry.at("id") << ' ' << key;
        EXPECT_LE(error, found.error_estimate + 1.2e-16 * found.value)
            << entry.at("id") << ' ' << key << " at " << tolerance;
      };
      check(form_factor(a, b, tolerance), "F12");
      check(form_factor(b, a, tolerance), "F21");
    }
  }
}

TEST(FormFactorReference, PointToPolygonIsExactToTwelveDigits) {
  int checked = 0;
  for (const auto& entry : reference_cases()) {
    if (entry.at("kind") != "ff_point_polygon") continue;
    const auto& geometry = entry.at("geometry");
    const auto& number = entry.at("expected").at("F_dA_2");
    const double found = point_form_factor(test::vector_of(geometry.at("point")),
                                           test::vector_of(geometry.at("normal")), polygon_of(geometry.at("poly2")));
    EXPECT_NEAR(found, number.at("value").get<double>(), allowance(number)) << entry.at("id");
    ++checked;
  }
  EXPECT_EQ(checked, 6);
}

TEST(FormFactorReference, ClosedPolyhedraHaveTheirWholeMatrix) {
  int checked = 0;
  for (const auto& entry : reference_cases()) {
    if (entry.at("kind") != "ff_closed_polyhedron") continue;
    const auto& polygons = entry.at("geometry").at("polygons");
    for (std::size_t i = 0; i < polygons.size(); ++i) {
      double row_sum = 0;
      for (std::size_t j = 0; j < polygons.size(); ++j) {
        const double found = form_factor(polygon_of(polygons[i]), polygon_of(polygons[j])).value;
        const auto& number = entry.at("expected").at("F")[i][j];
        EXPECT_NEAR(found, number.at("value").get<double>(), allowance(number))
            << entry.at("id") << ' ' << i << ',' << j;
        row_sum += found;
      }
      EXPECT_NEAR(row_sum, 1.0, 1e-14) << entry.at("id");  // a handful of roundings
    }
    ++checked;
  }
  EXPECT_EQ(checked, 2);
}

TEST(FormFactorReference, CoplanarPatchesExchangeExactlyNothing) {
  for (const char* id : {"ill_coplanar_adjacent", "ill_coincident_same_orientation"}) {
    const auto& geometry = reference_case(id).at("geometry");
    const FormFactor found = form_factor(polygon_of(geometry.at("poly1")), polygon_of(geometry.at("poly2")));
    EXPECT_EQ(found.value, 0.0) << id;
    EXPECT_EQ(found.error_estimate, 0.0) << id;
    EXPECT_EQ(found.method, FormFactorMethod::kZero) << id;
  }
}

TEST(FormFactorReference, CoincidentOppositePatchesAreFlagged) {
  const auto& geometry = reference_case("ill_coincident_opposite").at("geometry");
  const FormFactor found = form_factor(polygon_of(geometry.at("poly1")), polygon_of(geometry.at("poly2")));
  EXPECT_EQ(found.method, FormFactorMethod::kUndefined);
  EXPECT_EQ(found.error_estimate, 1.0);  // the limits from the two sides are 0 and 1
}

TEST(FormFactorReference, PatchWithoutAreaExchangesNothing) {
  const auto& geometry = reference_case("ill_zero_area_triangle").at("geometry");
  const Polygon line = polygon_of(geometry.at("poly1")), square = polygon_of(geometry.at("poly2"));
  EXPECT_EQ(form_factor(line, square).value, 0.0);
  EXPECT_EQ(form_factor(square, line).value, 0.0);
}

TEST(FormFactorReference, RepeatedCornerChangesNothing) {
  const auto& entry = reference_case("ill_duplicate_vertex");
  const auto& geometry = entry.at("geometry");
  const auto& number = entry.at("expected").at("F12");
  EXPECT_NEAR(form_factor(polygon_of(geometry.at("poly1")), polygon_of(geometry.at("poly2"))).value,
              number.at("value").get<double>(), allowance(number));
}

TEST(FormFactorReference, FacingSquaresKeepTheirDigitsAsTheGapCloses) {
  const auto& entry = reference_case("ill_touching_gap_series");
  for (const auto& step : entry.at("expected").at("one_minus_F_over_d")) {
    const double d = std::stod(step.at("d").get<std::string>());
    Polygon lower{{Eigen::Vector3d{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, 4};
    Polygon upper{{Eigen::Vector3d{0, 0, d}, {0, 1, d}, {1, 1, d}, {1, 0, d}}, 4};
    const double expected = step.at("one_minus_F").at("value").get<double>();
    const FormFactor found = form_factor(lower, upper);
    // F is near 1, where doubles are 1.1e-16 apart.
    EXPECT_NEAR(1 - found.value, expected, 1e-15) << "d = " << d;
  }
}

}  // namespace
}  // namespace interglow::radiosity
