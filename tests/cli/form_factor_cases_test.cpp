// SPDX-License-Identifier: GPL-3.0-or-later
#include "cli/form_factor_cases.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "diagnostics/error.h"
#include "files/atomic_file.h"
#include "tests/temporary_folder.h"

namespace interglow::cli {
namespace {

using nlohmann::json;
using testing::AllOf;
using testing::HasSubstr;

json evaluated(const std::string& text) {
  const test::TemporaryFolder folder;
  files::write_text_atomically(folder / "cases.json", text);
  return evaluate_form_factor_cases(folder / "cases.json", 0.0);
}

std::string message_of(const std::string& text) {
  try {
    evaluated(text);
  } catch (const InvalidInput& error) {
    return error.what();
  }
  return "nothing was thrown";
}

TEST(FormFactorCases, EveryReferenceCaseOfAKnownKindIsAnswered) {
  const std::filesystem::path file = INTERGLOW_TEST_DATA "/reference/reference.json";
  const json found = evaluate_form_factor_cases(file, 0.0);
  std::map<std::string, json> expected;
  const json reference = json::parse(std::ifstream(file));
  for (const json& entry : reference.at("cases")) expected[entry.at("id")] = entry;
  const auto expect_close = [](double value, const json& number, const std::string& id) {
    EXPECT_NEAR(value, number.at("value").get<double>(), std::max(1e-12, number.at("abs_error_bound").get<double>()))
        << id;
  };
  std::map<std::string, int> answered;
  for (const json& result : found.at("results")) {
    const json& entry = expected.at(result.at("id"));
    const std::string kind = entry.at("kind");
    ++answered[kind];
    if (kind == "ff_polygon_polygon")
      for (const char* key : {"F12", "F21", "A1F12"})
        expect_close(result.at(key), entry.at("expected").at(key), entry.at("id"));
    if (kind == "ff_point_polygon") expect_close(result.at("F12"), entry.at("expected").at("F_dA_2"), entry.at("id"));
    if (kind == "ff_closed_polyhedron")
      for (std::size_t i = 0; i < result.at("F").size(); ++i)
        for (std::size_t j = 0; j < result.at("F").size(); ++j)
          expect_close(result.at("F")[i][j], entry.at("expected").at("F")[i][j], entry.at("id"));
  }
  EXPECT_EQ(answered["ff_polygon_polygon"], 39);
  EXPECT_EQ(answered["ff_point_polygon"], 6);
  EXPECT_EQ(answered["ff_closed_polyhedron"], 2);
  EXPECT_EQ(found.at("results").size() + found.at("skipped").size(), reference.at("cases").size());
}

TEST(FormFactorCases, OccludedReferenceCasesMeetTheirEstimate) {
  const std::filesystem::path file = INTERGLOW_TEST_DATA "/reference/reference.json";
  const json reference = json::parse(std::ifstream(file));
  std::map<std::string, double> expected;
  for (const json& entry : reference.at("cases"))
    if (entry.at("kind") == "ff_polygon_polygon_occluded")
      expected[entry.at("id")] = entry.at("expected").at("F12").at("value");
  ASSERT_EQ(expected.size(), 7u);
  int answered = 0;
  const json found = evaluate_form_factor_cases(file, 1e-4);
  for (const json& result : found.at("results")) {
    if (!expected.contains(result.at("id"))) continue;
    ++answered;
    const double error = std::abs(result.at("F12").get<double>() - expected.at(result.at("id")));
    EXPECT_LE(error, 1e-4) << result.at("id");
    EXPECT_LE(error, result.at("error_estimate").get<double>() + 1e-14) << result.at("id");  // 13 digits are trusted
  }
  EXPECT_EQ(answered, 7);
}

TEST(FormFactorCases, NonConvexPolygonIsTheSumOfItsParts) {
  // An L of three unit squares below a 2 x 2 square: additivity, each square by itself as a case.
  const json result = evaluated(R"({"cases": [
    {"id": "L", "kind": "ff_polygon_polygon", "geometry": {"poly1": [[0,0,0],[2,0,0],[2,1,0],[1,1,0],[1,2,0],[0,2,0]],
      "poly2": [[0,0,1],[0,2,1],[2,2,1],[2,0,1]]}},
    {"id": "a", "kind": "ff_polygon_polygon", "geometry": {"poly1": [[0,0,0],[1,0,0],[1,1,0],[0,1,0]],
      "poly2": [[0,0,1],[0,2,1],[2,2,1],[2,0,1]]}},
    {"id": "b", "kind": "ff_polygon_polygon", "geometry": {"poly1": [[1,0,0],[2,0,0],[2,1,0],[1,1,0]],
      "poly2": [[0,0,1],[0,2,1],[2,2,1],[2,0,1]]}},
    {"id": "c", "kind": "ff_polygon_polygon", "geometry": {"poly1": [[0,1,0],[1,1,0],[1,2,0],[0,2,0]],
      "poly2": [[0,0,1],[0,2,1],[2,2,1],[2,0,1]]}},
    {"id": "other", "kind": "radiosity_cube", "geometry": {}}]})");
  const json& r = result.at("results");
  EXPECT_NEAR(3 * r[0].at("F12").get<double>(),
              r[1].at("F12").get<double>() + r[2].at("F12").get<double>() + r[3].at("F12").get<double>(), 1e-14);
  EXPECT_EQ(result.at("skipped"), json::array({"other"}));
}

TEST(FormFactorCases, MessagesNameFileCaseAndKey) {
  EXPECT_THAT(message_of("{"), AllOf(HasSubstr("cases.json"), HasSubstr("not valid JSON")));
  EXPECT_THAT(message_of("{}"), AllOf(HasSubstr("cases.json"), HasSubstr("cases")));
  EXPECT_THAT(message_of(R"({"cases": [{"kind": "ff_polygon_polygon"}]})"), HasSubstr("cases[0].id"));
  EXPECT_THAT(message_of(R"({"cases": [{"id": "x", "kind": "ff_polygon_polygon"}]})"),
              AllOf(HasSubstr("\"x\""), HasSubstr("geometry")));
  EXPECT_THAT(
      message_of(
          R"({"cases": [{"id": "x", "kind": "ff_polygon_polygon", "geometry": {"poly1": [[0,0,0],[1,0,0],[0,1,0]]}}]})"),
      AllOf(HasSubstr("\"x\""), HasSubstr("geometry.poly2"), HasSubstr("missing")));
  EXPECT_THAT(
      message_of(
          R"({"cases": [{"id": "x", "kind": "ff_polygon_polygon", "geometry": {"poly1": [[0,0,0],[1,"a",0],[0,1,0]]}}]})"),
      AllOf(HasSubstr("poly1[1]"), HasSubstr("three numbers")));
  EXPECT_THAT(
      message_of(R"({"cases": [{"id": "x", "kind": "ff_polygon_polygon", "geometry": {"poly1": [[0,0,0],[1,0,0]]}}]})"),
      AllOf(HasSubstr("poly1"), HasSubstr("at least 3")));
  EXPECT_THAT(message_of(R"({"cases": [{"id": "x", "kind": "ff_polygon_polygon",
                          "geometry": {"poly1": [[0,0,0],[1,0,0],[1,1,0.5],[0,1,0]]}}]})"),
              AllOf(HasSubstr("poly1"), HasSubstr("off the plane")));
  EXPECT_THROW(evaluate_form_factor_cases("no such file.json", 0.0), InvalidInput);
  EXPECT_THROW(evaluate_form_factor_cases(INTERGLOW_TEST_DATA "/reference/reference.json", -1.0), InvalidParams);
}

}  // namespace
}  // namespace interglow::cli
