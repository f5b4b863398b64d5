// SPDX-License-Identifier: GPL-3.0-or-later
/// Simulated structured-light scans of surfaces that are known exactly: examples, and tests of what remeshing recovers.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "mesh/triangle_mesh.h"

namespace interglow::mesh {

/// Two half cylinders that touch along a line; a half cylinder standing on a plane; two plane sheets that meet at an
/// angle; a ball.
enum class SimulatedScene { kHalfCylinders, kArchOnPlane, kVGroove, kSphere };

/// Settings of `simulate_scan`. Lengths in mm.
struct ScanSimulationParams {
  SimulatedScene scene = SimulatedScene::kHalfCylinders;
  double radius_mm = 20;         ///< of cylinders and ball; width of the sheets of a groove; > 0
  double length_mm = 50;         ///< along the cylinders or the groove; > 0
  double gap_mm = 0;             ///< between the half cylinders; >= 0
  double margin_mm = 30;         ///< by which the plane reaches beyond the arch; > 0
  double groove_angle_deg = 60;  ///< between the sheets; in (0, 180)
  double spacing_mm = 0.5;       ///< between neighbouring points; > 0
  double noise_sigma_mm = 0.02;  ///< normal deviations across the surface; >= 0
  double jitter = 0.3;           ///< largest shift of a point within the surface over the spacing; in [0, 0.45]
  double strip_mm = 0.5;         ///< not seen on either side of a contact line, along the surface; >= 0
  double ragged_mm = 0;          ///< borders are eaten into by up to this; >= 0
  int holes = 0;                 ///< elliptical holes an object
  double hole_mm = 1.2;          ///< mean half-axis of a hole; > 0
  double outlier_share = 0;      ///< of points moved off the surface; in [0, 0.5]
  double outlier_mm = 0.5;       ///< by up to this, to either side; >= 0
  std::uint64_t seed = 1;
};
void validate(const ScanSimulationParams& params);  ///< Throws InvalidParams, naming field, value and range.

struct SimulatedObject {
  std::string name;
  TriangleMesh scan;
  std::string truth_json;  ///< the true surface, one JSON object
};

/// The objects of the scene, one-sided with normals towards the scanner. The same bits for the same parameters on any
/// machine with the same libm.
/// @throws InvalidParams, also for a spacing that asks for more than 20 million points an object
/// Cost: linear in the number of points.
std::vector<SimulatedObject> simulate_scan(const ScanSimulationParams& params);

/// Writes each object to folder/name_object.extension ("ply": binary, or "obj") and the truth to folder/name.json.
/// @return the files written
/// @throws InvalidParams for another extension, InvalidInput if a file cannot be written
std::vector<std::filesystem::path> write_simulated_scan(const std::vector<SimulatedObject>& objects,
                                                        const ScanSimulationParams& params,
                                                        const std::filesystem::path& folder, const std::string& name,
                                                        const std::string& extension);

}  // namespace interglow::mesh
