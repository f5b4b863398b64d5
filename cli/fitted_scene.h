// SPDX-License-Identifier: GPL-3.0-or-later
/// A scene file with the values that a fit found.
#pragma once

#include <filesystem>
#include <string>

#include "fitting/forward_model.h"
#include "scene/scene_file.h"

namespace interglow::cli {

/// The text of the scene file with camera, light direction and (where fitted) material scales replaced, and paths
/// written relative to `folder`, so that it runs from there. Comments and all other keys stay. What a scene file cannot
/// say (gain, offset, blur, w/w′, principal point, distortion) is a comment at its head.
/// @throws InvalidInput if the result would not read back (tables written on one line)
std::string fitted_scene_text(const scene::SceneDescription& description, const fitting::ForwardModel& model,
                              const fitting::FitState& state, const std::filesystem::path& folder);

/// NAME.csv for every material with a fitted reflectance offset, which the scene file cannot say: its spectrum, or its
/// Donaldson matrix, in the scene's bands. The text above names them, and is
/// made after them.
void write_fitted_materials(const fitting::ForwardModel& model, const fitting::FitState& state,
                            const std::filesystem::path& folder);

}  // namespace interglow::cli
