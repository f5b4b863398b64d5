// SPDX-License-Identifier: GPL-3.0-or-later
/// The maps of a comparison as files.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "image/channel_file.h"
#include "image/image_metrics.h"

namespace interglow::image {

/// A map that was written as a picture: colours run from black at 0 to white at `highest`.
struct WrittenMap {
  std::filesystem::path file;
  std::string quantity;  ///< name and unit
  double highest = 0.0;
};

/// Writes spectral_angle.png, delta_srgb.png, ciede2000.png and relative_rmse.png (false colours, each scaled to the 1,
/// 2 or 5 times a power of ten that 99 % of its pixels do not exceed) and maps.exr with the four as numbers.
std::vector<WrittenMap> write_comparison_maps(const std::filesystem::path& folder, const ImageComparison& comparison,
                                              const Attributes& attributes = {});

}  // namespace interglow::image
