// SPDX-License-Identifier: GPL-3.0-or-later
/// The same patches, camera, lights and spectra for someone else's renderer.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "diagnostics/error.h"
#include "scene/scene.h"

namespace interglow::exchange {

/// Mitsuba 3 (its spectral variants), Mitsuba 0.6 and pbrt-v4.
enum class Renderer { kMitsuba3, kMitsuba06, kPbrt4 };

struct RendererExportParams {
  /// Indirect bounces that the renderer's path tracer follows, at least 0; empty: all.
  std::optional<int> bounces{};
  /// Paths a pixel, at least 1.
  int samples_per_pixel = 256;
};

void validate(const RendererExportParams& params);  ///< Throws InvalidParams, naming field, value and range.

struct RendererExport {
  std::vector<std::filesystem::path> files;  ///< the scene first, then one mesh an object
  Warnings warnings;                         ///< what the renderer cannot show, each naming material, object or light
};

/// Writes scene.xml or scene.pbrt and meshes/*.ply (triangles in mm, flat). Spectra are linear between the centres of
/// the bands and constant to the outer edges; the pixel filter is a box, so that pixels are area averages. Pixels are
/// radiances: luminance (weighted by ȳ) from Mitsuba, all bands of the camera from pbrt.
///
/// What these renderers do not have is left out and named: luminescence (materials keep their reflectance), the disk of
/// a directional light, and the dark background before a sky; in pbrt also the black backs of one-sided sheets.
/// @throws InvalidInput if a file cannot be written, InvalidParams
RendererExport export_for_renderer(const scene::Scene& scene, Renderer renderer, const std::filesystem::path& folder,
                                   const RendererExportParams& params = {});

}  // namespace interglow::exchange
