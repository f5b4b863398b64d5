// SPDX-License-Identifier: GPL-3.0-or-later
/// The high-precision cases of tests/data/reference (see the README there), as polygons.
#pragma once

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>

#include "radiosity/polygon.h"

namespace interglow::radiosity::test {

inline const nlohmann::json& reference_cases() {
  static const nlohmann::json cases = [] {
    std::ifstream file(INTERGLOW_TEST_DATA "/reference/reference.json");
    if (!file) throw std::runtime_error("tests/data/reference/reference.json is missing");
    return nlohmann::json::parse(file).at("cases");
  }();
  return cases;
}

inline const nlohmann::json& reference_case(const std::string& id) {
  for (const nlohmann::json& entry : reference_cases())
    if (entry.at("id") == id) return entry;
  throw std::runtime_error("no reference case " + id);
}

inline Eigen::Vector3d vector_of(const nlohmann::json& xyz) {
  return {xyz.at(0).get<double>(), xyz.at(1).get<double>(), xyz.at(2).get<double>()};
}

inline Polygon polygon_of(const nlohmann::json& corners) {
  Polygon polygon;
  if (corners.size() > 4) throw std::runtime_error("a reference polygon has more than four corners");
  for (const nlohmann::json& corner : corners) polygon.corner[polygon.corners++] = vector_of(corner);
  return polygon;
}

/// 1e-12 or the digits the reference trusts, whichever is coarser.
inline double allowance(const nlohmann::json& number, double wanted = 1e-12) {
  return std::max(wanted, number.at("abs_error_bound").get<double>());
}

}  // namespace interglow::radiosity::test
