// SPDX-License-Identifier: GPL-3.0-or-later
#include "cli/shading_files.h"

#include <nlohmann/json.hpp>

#include "image/channel_file.h"

namespace interglow::cli {

void write_shading(const std::filesystem::path& path, const fitting::Decomposition& found) {
  image::ChannelImage channels{.width = found.width,
                               .height = found.height,
                               .channel = found.name,
                               .value = {},
                               .attributes = {{"Software", "interglow " INTERGLOW_VERSION}},
                               .numbers = {}};
  channels.channel.push_back("relative_residual");
  for (std::size_t p = 0; p < found.relative_residual.value.size(); ++p) {
    for (const image::ScalarMap& map : found.shading) channels.value.push_back(map.value[p]);
    channels.value.push_back(found.relative_residual.value[p]);
  }
  image::write_exr_channels(path, channels);
}

nlohmann::json decomposition_json(const fitting::Decomposition& found) {
  nlohmann::json objects = nlohmann::json::array();
  for (const fitting::BasisQuality& quality : found.quality) {
    objects.push_back(
        {{"condition_number", quality.condition_number},
         {"singular_values", std::vector<double>(quality.singular_value.begin(), quality.singular_value.end())},
         {"sine_to_span_of_others", std::vector<double>(quality.sine.begin(), quality.sine.end())},
         {"sentence", quality.sentence}});
  }
  return {{"components", found.name},
          {"pixels", found.pixels},
          {"not_finite_pixels", found.not_finite},
          {"bounded_pixels", found.bounded},
          {"relative_residual", found.total_relative_residual},
          {"objects", objects}};
}

}  // namespace interglow::cli
