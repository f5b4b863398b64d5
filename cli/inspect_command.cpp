// SPDX-License-Identifier: GPL-3.0-or-later
// interglow inspect MESH...: what a scan holds, what repair changes, and what remains.
#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "cli/commands.h"
#include "diagnostics/error.h"
#include "mesh/mesh_writer.h"
#include "mesh/repair.h"
#include "mesh/scan_file.h"

namespace interglow::cli {
namespace {

using nlohmann::ordered_json;

struct InspectOptions {
  std::vector<std::string> files;
  std::string out;
  bool json = false;
  int fill_holes = 0;
  mesh::ReadParams read;
  mesh::RepairParams repair;
};

ordered_json borders_json(const mesh::RepairReport& report) {
  ordered_json borders = ordered_json::array();
  for (const mesh::BorderLoop& border : report.borders) {
    borders.push_back({{"edges", border.edges}, {"length_mm", border.length_mm}, {"area_mm2", border.area_mm2}});
  }
  return borders;
}

/// The figures of a file, in the order in which they are printed.
ordered_json figures(const mesh::ScanFile& scan, const mesh::Repaired& repaired) {
  const mesh::ReadReport& read = scan.report;
  const mesh::RepairReport& report = repaired.report;
  Eigen::Vector3d low = repaired.mesh.points.front();
  Eigen::Vector3d high = low;
  for (const Eigen::Vector3d& point : repaired.mesh.points) {
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  ordered_json result;
  result["read"] = {{"format", read.format},
                    {"points_in_file", read.points_in_file},
                    {"faces_in_file", read.faces_in_file},
                    {"polygons_triangulated", read.polygons_triangulated},
                    {"points_welded", read.points_welded},
                    {"unusable_points", read.unusable_points},
                    {"faces_of_unusable_points", read.faces_of_unusable_points},
                    {"faces_with_bad_index", read.faces_with_bad_index},
                    {"incomplete_faces", read.incomplete_faces},
                    {"points", scan.mesh.points.size()},
                    {"triangles", scan.mesh.triangles.size()}};
  result["repair"] = {{"points_merged", report.points_merged},
                      {"unused_points_removed", report.unused_points_removed},
                      {"faces_with_repeated_corner_removed", report.faces_with_repeated_corner_removed},
                      {"duplicate_faces_removed", report.duplicate_faces_removed},
                      {"flat_faces_removed", report.flat_faces_removed},
                      {"flat_faces_flipped", report.flat_faces_flipped},
                      {"edges_split", report.edges_split},
                      {"points_split", report.points_split},
                      {"faces_turned", report.faces_turned},
                      {"unorientable_edges_cut", report.unorientable_edges_cut},
                      {"faces_detached", report.faces_detached},
                      {"components_turned_outward", report.components_turned_outward},
                      {"components_removed", report.components_removed},
                      {"faces_of_removed_components", report.faces_of_removed_components},
                      {"holes_filled", report.holes_filled},
                      {"faces_added", report.faces_added}};
  result["result"] = {{"points", repaired.mesh.points.size()},
                      {"triangles", repaired.mesh.triangles.size()},
                      {"components", report.components},
                      {"closed", report.closed},
                      {"area_mm2", report.area_mm2},
                      {"size_mm", {high.x() - low.x(), high.y() - low.y(), high.z() - low.z()}},
                      {"borders", borders_json(report)}};
  if (report.self_intersections) result["result"]["self_intersections"] = *report.self_intersections;
  result["warnings"] = read.warnings;
  for (const std::string& warning : report.warnings) result["warnings"].push_back(warning);
  return result;
}

void print_table(const std::string& file, const ordered_json& figures) {
  constexpr std::size_t kMostBorders = 10;
  fmt::print("{}\n", file);
  for (const char* section : {"read", "repair", "result"}) {
    fmt::print("  {}\n", section);
    for (const auto& [key, value] : figures[section].items()) {
      // Every repair that was not needed would only hide those that were.
      if (value == 0 && std::string(section) != "result") continue;
      if (key == "borders") continue;
      fmt::print("    {:<36} {}\n", key, value.is_string() ? value.get<std::string>() : value.dump());
    }
  }
  const ordered_json& borders = figures["result"]["borders"];
  fmt::print("    {:<36} {}\n", "borders", borders.size());
  for (std::size_t i = 0; i < std::min(borders.size(), kMostBorders); ++i) {
    fmt::print("      {:>6} edges {:>12.4g} mm {:>12.4g} mm2\n", borders[i]["edges"].get<int>(),
               borders[i]["length_mm"].get<double>(), borders[i]["area_mm2"].get<double>());
  }
  if (borders.size() > kMostBorders)
    fmt::print("      and {} shorter ones (all with --json)\n", borders.size() - kMostBorders);
  for (const auto& warning : figures["warnings"]) fmt::print("  warning: {}\n", warning.get<std::string>());
}

int inspect(const InspectOptions& options) {
  if (!options.out.empty() && options.files.size() != 1) {
    throw InvalidParams(
        fmt::format("--out takes one mesh, but {} were given. Repair them one by one.", options.files.size()));
  }
  mesh::RepairParams repair_params = options.repair;
  if (options.fill_holes != 0) repair_params.fill_holes_up_to_edges = options.fill_holes;
  mesh::validate(options.read);
  mesh::validate(repair_params);
  int status = kSuccess;
  ordered_json all = ordered_json::array();
  for (const std::string& file : options.files) {
    ordered_json report;
    try {
      const mesh::ScanFile scan = mesh::read_scan(file, options.read);
      mesh::Repaired repaired;
      try {
        repaired = mesh::repair(scan.mesh, repair_params);
      } catch (const InvalidInput& error) {
        throw InvalidInput(fmt::format("{}: {}", file, error.what()));
      }
      report = figures(scan, repaired);
      if (!options.out.empty()) mesh::write_mesh(options.out, repaired.mesh, "interglow inspect " + file);
      if (!options.json) print_table(file, report);
    } catch (const InvalidInput& error) {
      // The other files are still looked at.
      status = kBadInput;
      fmt::print(stderr, "{}\n", error.what());
      report["refused"] = error.what();
    }
    report["file"] = file;
    all.push_back(std::move(report));
  }
  if (options.json) fmt::print("{}\n", all.dump(2, ' ', false, ordered_json::error_handler_t::replace));
  return status;
}

}  // namespace

void add_inspect_command(CLI::App& app, Session& session, std::function<int()>& action) {
  auto options = std::make_shared<InspectOptions>();
  CLI::App* command =
      app.add_subcommand("inspect", "Read and repair meshes and report what they hold and what was changed.");
  add_session_options(*command, session);
  command->add_option("MESH", options->files, "OBJ, PLY, STL or OFF files")->required();
  command->add_option("--mm-per-unit", options->read.mm_per_unit, "millimetres per unit of the file (metres: 1000)")
      ->capture_default_str();
  command->add_flag("--strict", options->read.strict, "refuse damaged files instead of dropping what is damaged");
  command
      ->add_option("--smallest-share", options->repair.smallest_component_share,
                   "remove pieces with less than this share of the area")
      ->capture_default_str();
  command->add_option("--fill-holes", options->fill_holes, "fill holes of at most this many edges (3 to 5000; 0: none)")
      ->capture_default_str();
  command->add_flag("--crossings", options->repair.count_self_intersections, "count triangles that cross one another");
  command->add_flag("--json", options->json, "print one JSON array, with every border");
  command->add_option("--out", options->out, "write the repaired mesh (.ply or .obj, mm); one MESH only");
  command->callback([options, &action] { action = [options] { return inspect(*options); }; });
}

}  // namespace interglow::cli
