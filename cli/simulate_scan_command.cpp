// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <map>
#include <memory>

#include "cli/commands.h"
#include "mesh/scan_simulator.h"

namespace interglow::cli {

void add_simulate_scan_command(CLI::App& app, Session& session, std::function<int()>& action) {
  struct Options {
    mesh::ScanSimulationParams params;
    std::string folder = ".", name = "scan", format = "ply";
  };
  const auto options = std::make_shared<Options>();
  mesh::ScanSimulationParams& params = options->params;
  CLI::App& command = *app.add_subcommand("simulate-scan", "Simulate noisy scans of surfaces that are known exactly");
  const std::map<std::string, mesh::SimulatedScene> scenes{{"half-cylinders", mesh::SimulatedScene::kHalfCylinders},
                                                           {"arch", mesh::SimulatedScene::kArchOnPlane},
                                                           {"v-groove", mesh::SimulatedScene::kVGroove},
                                                           {"sphere", mesh::SimulatedScene::kSphere}};
  command.add_option("scene", params.scene, "half-cylinders, arch (on a plane), v-groove or sphere")
      ->required()
      ->transform(CLI::CheckedTransformer(scenes));
  command.add_option("--out", options->folder, "Folder to write to")->capture_default_str();
  command.add_option("--name", options->name, "Files are NAME_OBJECT.ply and NAME.json")->capture_default_str();
  command.add_option("--format", options->format, "ply (binary) or obj")->capture_default_str();
  command.add_option("--radius", params.radius_mm, "Radius, or width of a groove's sheets [mm]")->capture_default_str();
  command.add_option("--length", params.length_mm, "Length along cylinders or groove [mm]")->capture_default_str();
  command.add_option("--gap", params.gap_mm, "Gap between the half cylinders [mm]")->capture_default_str();
  command.add_option("--margin", params.margin_mm, "Plane beyond the arch [mm]")->capture_default_str();
  command.add_option("--angle", params.groove_angle_deg, "Angle of the groove [degrees]")->capture_default_str();
  command.add_option("--spacing", params.spacing_mm, "Distance between points [mm]")->capture_default_str();
  command.add_option("--noise", params.noise_sigma_mm, "Standard deviation across the surface [mm]")
      ->capture_default_str();
  command.add_option("--jitter", params.jitter, "Irregularity of the points, over the spacing")->capture_default_str();
  command.add_option("--strip", params.strip_mm, "Strip not seen beside a contact [mm]")->capture_default_str();
  command.add_option("--ragged", params.ragged_mm, "Borders eaten into by up to this [mm]")->capture_default_str();
  command.add_option("--holes", params.holes, "Holes an object")->capture_default_str();
  command.add_option("--hole-size", params.hole_mm, "Mean half-axis of the holes [mm]")->capture_default_str();
  command.add_option("--outliers", params.outlier_share, "Share of points off the surface")->capture_default_str();
  command.add_option("--outlier-size", params.outlier_mm, "By up to this [mm]")->capture_default_str();
  command.add_option("--seed", params.seed, "Seed of the random numbers")->capture_default_str();
  add_session_options(command, session);
  command.callback([&session, &action, options] {
    action = [&session, options] {
      const auto objects = mesh::simulate_scan(options->params);
      for (const auto& path :
           mesh::write_simulated_scan(objects, options->params, options->folder, options->name, options->format))
        if (!session.quiet) fmt::print("{}\n", path.string());
      return static_cast<int>(kSuccess);
    };
  });
}

}  // namespace interglow::cli
