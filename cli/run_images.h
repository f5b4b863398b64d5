// SPDX-License-Identifier: GPL-3.0-or-later
/// The pictures that `interglow run` writes.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "rendering/render.h"
#include "scene/scene_file.h"

namespace interglow::cli {

struct WrittenImages {
  std::vector<std::string> files;  ///< relative to the output folder, in the order of writing
  double exposure = 1.0;           ///< one for all pictures
  std::vector<std::pair<std::string, double>> clipped_share;  ///< of the lit pixels, by picture
};

/// image.{exr,png}, components/{re,rr,le,li,rl}.{exr,png} (with split_li also lr and ll), spectra.csv. Each file is
/// whole or absent. Components that the scene cannot have are written too, black, so that a folder always has the same
/// files.
WrittenImages write_images(const rendering::RenderedImages& images, const scene::OutputDescription& output,
                           const std::filesystem::path& folder, const std::string& command_line);

/// li = lr + ll.
image::SpectralImage indirect_luminescence(const rendering::RenderedImages& images);

}  // namespace interglow::cli
