// SPDX-License-Identifier: GPL-3.0-or-later
/// The text of a renderer's scene file, and what all of them share.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "exchange/renderer_export.h"
#include "scene/scene.h"

namespace interglow::exchange::detail {

/// A function that is linear between its nodes and 0 outside.
struct PolyLine {
  std::vector<double> wavelength_nm;
  std::vector<double> value;
};

/// One value a band: nodes at the centres and at the outer edges.
PolyLine poly_line(const spectral::WavelengthGrid& grid, const Eigen::VectorXd& bands);

/// Numbers as short as they can be read back exactly.
std::string joined(const std::vector<double>& numbers, const char* separator);
std::string text(const Eigen::Vector3d& point, const char* separator);

/// File of an object's mesh relative to the scene file: a number, and what can be in any file name of its name.
std::string mesh_file(const scene::Scene& scene, std::size_t object);

std::string mitsuba_scene(const scene::Scene& scene, Renderer renderer, const RendererExportParams& params);
std::string pbrt_scene(const scene::Scene& scene, const RendererExportParams& params);

}  // namespace interglow::exchange::detail
