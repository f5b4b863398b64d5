// SPDX-License-Identifier: GPL-3.0-or-later
/// result.json of `interglow run` (keys: docs/result-json.md), and the summary on the terminal.
#pragma once

#include <string>
#include <vector>

#include "cli/run_images.h"
#include "cli/run_pipeline.h"
#include "scene/scene_file.h"

namespace interglow::cli {

/// Mean radiance of one component over the pixels that show objects, integrated over the bands of the image.
struct ComponentMean {
  std::string name;
  double radiance = 0.0;  ///< [W m^-2 sr^-1]
  double share = 0.0;     ///< of the whole picture
};

/// The whole picture first, then re, rr, le, li = lr + ll, rl, lr, ll, and emission if there is any.
/// @param widths_nm  of the bands of the images
std::vector<ComponentMean> component_means(const rendering::RenderedImages& images, const Eigen::VectorXd& widths_nm);

std::string result_json(const scene::SceneDescription& description, const RunOutcome& outcome,
                        const WrittenImages& written, const std::string& command_line);

/// What was made, where, and the figures a reader checks.
std::string summary(const RunOutcome& outcome, const WrittenImages& written, const std::string& folder);

}  // namespace interglow::cli
