// SPDX-License-Identifier: GPL-3.0-or-later
/// The form factors of a scene file, and what they say about its objects.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "diagnostics/progress.h"

namespace interglow::cli {

struct SceneFormFactors {
  std::filesystem::path scene;
  std::filesystem::path output;       ///< .mtx or .npz; empty: the matrix is not written
  std::optional<double> tolerance{};  ///< empty: the scene file's
  std::string comment;                ///< goes into the head of an .mtx
};

/// Builds the scene, computes all form factors and writes them. Returns the text to show: a table of the share of the
/// flux that leaves each object's side and reaches another directly, closure, counts of pairs and times.
/// @throws InvalidInput, InvalidParams as scene::build_scene and radiosity::Transport::build do
std::string evaluate_scene_form_factors(const SceneFormFactors& request, const Progress& progress);

}  // namespace interglow::cli
