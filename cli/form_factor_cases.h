// SPDX-License-Identifier: GPL-3.0-or-later
/// Form factors of the cases in a JSON file, one result a case.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>

namespace interglow::cli {

/// Reads `cases[]`, each with `id`, `kind` and `geometry` (the layout of tests/data/reference), and computes
///   ff_polygon_polygon (poly1, poly2), ff_polygon_polygon_occluded (and occluders), ff_point_polygon (point, normal,
///   poly2), ff_closed_polyhedron (polygons; the whole matrix F).
/// Polygons are planar outlines of three or more corners; non-convex ones are cut into triangles.
///
/// @param tolerance  wanted absolute error of every form factor; 0: round-off
/// @param timing     adds "seconds" to each result, which then differs from run to run
/// @return {"results": [{"id", "F12", "F21", "error_estimate", "method"} ...], "skipped": [ids of other kinds]}
/// @throws InvalidInput naming file, case and key; InvalidParams if the tolerance is negative
nlohmann::json evaluate_form_factor_cases(const std::filesystem::path& file, double tolerance, bool timing = false);

}  // namespace interglow::cli
