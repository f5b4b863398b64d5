// SPDX-License-Identifier: GPL-3.0-or-later
#include "cli/form_factor_cases.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "diagnostics/error.h"
#include "radiosity/form_factor.h"
#include "radiosity/occluded_form_factor.h"
#include "radiosity/polygon_parts.h"

namespace interglow::cli {
namespace {

using Eigen::Vector3d;
using nlohmann::json;
using radiosity::FormFactor;
using radiosity::FormFactorMethod;
using radiosity::Polygon;

using Outline = std::vector<Polygon>;  ///< the convex parts of one polygon

/// Where a case's values are read, for messages.
struct CaseReader {
  std::string file;
  std::string id;
  const json& geometry;

  [[noreturn]] void fail(const std::string& key, const std::string& what) const {
    throw InvalidInput(fmt::format("{}: case \"{}\": geometry.{}: {}", file, id, key, what));
  }
  const json& at(const std::string& key) const {
    if (!geometry.is_object() || !geometry.contains(key)) fail(key, "missing, expected by this kind of case.");
    return geometry.at(key);
  }
  Vector3d vector(const json& value, const std::string& key) const {
    if (!value.is_array() || value.size() != 3)
      fail(key, fmt::format("{}, expected three numbers [x, y, z].", value.dump()));
    for (const json& number : value)
      if (!number.is_number()) fail(key, fmt::format("{}, expected three numbers [x, y, z].", value.dump()));
    return {value[0].get<double>(), value[1].get<double>(), value[2].get<double>()};
  }
  Outline outline(const json& value, const std::string& key) const {
    if (!value.is_array()) fail(key, "expected a list of corners [x, y, z].");
    std::vector<Vector3d> corners;
    for (std::size_t i = 0; i < value.size(); ++i) corners.push_back(vector(value[i], fmt::format("{}[{}]", key, i)));
    try {
      return radiosity::convex_parts(corners);
    } catch (const InvalidParams& error) {
      fail(key, error.what());
    }
  }
  std::vector<Outline> outlines(const std::string& key) const {
    const json& value = at(key);
    if (!value.is_array()) fail(key, "expected a list of polygons.");
    std::vector<Outline> all;
    for (std::size_t i = 0; i < value.size(); ++i) all.push_back(outline(value[i], fmt::format("{}[{}]", key, i)));
    return all;
  }
};

double area(const Outline& outline) {
  double sum = 0;
  for (const Polygon& part : outline) {
    Vector3d twice = Vector3d::Zero();
    for (int i = 1; i + 1 < part.corners; ++i)
      twice += (part.corner[i] - part.corner[0]).cross(part.corner[i + 1] - part.corner[0]);
    sum += twice.stableNorm() / 2;
  }
  return sum;
}

FormFactor exchange(const Outline& a, const Outline& b, double tolerance) {
  FormFactor sum;
  const double share = tolerance / static_cast<double>(a.size() * b.size());
  for (const Polygon& from : a)
    for (const Polygon& to : b) {
      const FormFactor part = radiosity::exchange_area(from, to, share);
      sum.value += part.value;
      sum.error_estimate += part.error_estimate;
      sum.method = std::max(sum.method, part.method);  // the costliest one, or undefined
    }
  return sum;
}

/// F of an exchange area, bounded by what it can be; 0 for a patch without area.
double per_area(double value, double patch_area) { return patch_area > 0 ? std::min(value / patch_area, 1.0) : 0.0; }

json polygon_pair(const CaseReader& reader, double tolerance) {
  const Outline first = reader.outline(reader.at("poly1"), "poly1"),
                second = reader.outline(reader.at("poly2"), "poly2");
  const double first_area = area(first), second_area = area(second);
  const FormFactor found = exchange(first, second, tolerance * first_area);
  return {{"F12", per_area(found.value, first_area)},
          {"F21", per_area(found.value, second_area)},
          {"A1F12", found.value},
          {"error_estimate", per_area(found.error_estimate, first_area)},
          {"method", name(found.method)}};
}

/// The occluded kernel's tightest tolerance.
constexpr double kTightestOccluded = 1e-12;

json occluded_pair(const CaseReader& reader, double tolerance) {
  const Outline first = reader.outline(reader.at("poly1"), "poly1"),
                second = reader.outline(reader.at("poly2"), "poly2");
  std::vector<Polygon> occluders;
  for (const Outline& outline : reader.outlines("occluders"))
    occluders.insert(occluders.end(), outline.begin(), outline.end());
  const double share = std::max(tolerance / static_cast<double>(second.size()), kTightestOccluded);
  FormFactor sum;  // as an exchange area
  for (const Polygon& from : first)
    for (const Polygon& to : second) {
      const FormFactor part = radiosity::form_factor(from, to, occluders, share);
      sum.value += area({from}) * part.value;
      sum.error_estimate += area({from}) * part.error_estimate;
      sum.method = std::max(sum.method, part.method);
    }
  return {{"F12", per_area(sum.value, area(first))},
          {"F21", per_area(sum.value, area(second))},
          {"F12_unoccluded", per_area(exchange(first, second, tolerance * area(first)).value, area(first))},
          {"error_estimate", per_area(sum.error_estimate, area(first))},
          {"method", name(sum.method)}};
}

json point_polygon(const CaseReader& reader, double) {
  const Vector3d point = reader.vector(reader.at("point"), "point");
  Vector3d normal = reader.vector(reader.at("normal"), "normal");
  if (!(normal.norm() > 0)) reader.fail("normal", "has no direction, expected a vector that is not zero.");
  normal.normalize();
  double sum = 0;
  for (const Polygon& part : reader.outline(reader.at("poly2"), "poly2"))
    sum += radiosity::point_form_factor(point, normal, part);
  // Lambert's formula: some roundings of terms of at most 1.
  return {{"F12", sum}, {"F_dA_2", sum}, {"error_estimate", 4e-16}, {"method", name(FormFactorMethod::kClosedForm)}};
}

json closed_polyhedron(const CaseReader& reader, double tolerance) {
  const std::vector<Outline> faces = reader.outlines("polygons");
  json matrix = json::array(), row_sums = json::array();
  double estimate = 0, closure = 0;
  FormFactorMethod method = FormFactorMethod::kZero;
  for (const Outline& from : faces) {
    json row = json::array();
    double sum = 0;
    for (const Outline& to : faces) {
      const double from_area = area(from);
      const FormFactor found = exchange(from, to, tolerance * std::min(from_area, area(to)));
      const double value = &from == &to ? 0.0 : per_area(found.value, from_area);
      row.push_back(value);
      sum += value;
      estimate = std::max(estimate, per_area(found.error_estimate, from_area));
      method = std::max(method, found.method);
    }
    matrix.push_back(std::move(row));
    row_sums.push_back(sum);
    closure = std::max(closure, std::abs(sum - 1));
  }
  return {{"F", matrix},
          {"row_sums", row_sums},
          {"closure_max", closure},
          {"error_estimate", estimate},
          {"method", name(method)}};
}

using Evaluate = json (*)(const CaseReader& reader, double tolerance);

Evaluate evaluation_of(const std::string& kind) {
  if (kind == "ff_polygon_polygon") return polygon_pair;
  if (kind == "ff_polygon_polygon_occluded") return occluded_pair;
  if (kind == "ff_point_polygon") return point_polygon;
  if (kind == "ff_closed_polyhedron") return closed_polyhedron;
  return nullptr;
}

std::string text_of(const json& entry, const char* key, const std::string& file, std::size_t index) {
  if (!entry.is_object() || !entry.contains(key) || !entry.at(key).is_string())
    throw InvalidInput(fmt::format("{}: cases[{}].{}: missing, expected a text.", file, index, key));
  return entry.at(key).get<std::string>();
}

}  // namespace

json evaluate_form_factor_cases(const std::filesystem::path& file, double tolerance, bool timing) {
  if (!(tolerance >= 0) || !std::isfinite(tolerance))
    throw InvalidParams(
        fmt::format("tolerance: {}, expected a finite number of at least 0 (0: round-off).", tolerance));
  const std::string file_name = file.string();
  std::ifstream stream(file);
  if (!stream) throw InvalidInput(fmt::format("{}: cannot be opened. Check the path.", file_name));
  json document;
  try {
    document = json::parse(stream);
  } catch (const json::parse_error& error) {
    throw InvalidInput(fmt::format("{}: is not valid JSON: {}", file_name, error.what()));
  }
  if (!document.is_object() || !document.contains("cases") || !document.at("cases").is_array())
    throw InvalidInput(
        fmt::format("{}: cases: missing, expected a list of cases with id, kind and geometry.", file_name));

  json results = json::array(), skipped = json::array();
  const json& cases = document.at("cases");
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const std::string id = text_of(cases[i], "id", file_name, i);
    const Evaluate evaluate = evaluation_of(text_of(cases[i], "kind", file_name, i));
    if (evaluate == nullptr) {
      skipped.push_back(id);
      continue;
    }
    if (!cases[i].contains("geometry"))
      throw InvalidInput(
          fmt::format("{}: case \"{}\": geometry: missing, expected by this kind of case.", file_name, id));
    const auto start = std::chrono::steady_clock::now();
    json result = evaluate(CaseReader{file_name, id, cases[i].at("geometry")}, tolerance);
    if (timing) result["seconds"] = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    result["id"] = id;
    results.push_back(std::move(result));
  }
  return {{"results", results}, {"skipped", skipped}};
}

}  // namespace interglow::cli
