// SPDX-License-Identifier: GPL-3.0-or-later
#include "cli/spectral_input.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <filesystem>

#include "fitting/capture_file.h"
#include "image/mask_file.h"

namespace interglow::cli {
namespace {

bool is_capture(const std::filesystem::path& path) {
  std::error_code failed;
  return path.extension() == ".toml" || std::filesystem::exists(path / "capture.toml", failed);
}

}  // namespace

SpectralInput read_spectral_input(const std::string& path) {
  if (is_capture(path)) {
    fitting::Capture capture = fitting::read_capture(path);
    for (const std::string& warning : capture.warnings) fmt::print(stderr, "warning: {}: {}\n", path, warning);
    return {std::move(capture.image), std::move(capture.use)};
  }
  SpectralInput input{image::read_cube(path).image, {}};
  const auto bands = static_cast<std::size_t>(input.image.bands());
  input.use.assign(input.image.value.size() / bands, 1);
  for (std::size_t v = 0; v < input.image.value.size(); ++v) {
    if (std::isfinite(input.image.value[v])) continue;
    input.image.value[v] = 0.0F;
    input.use[v / bands] = 0;
  }
  return input;
}

void apply_mask(SpectralInput& input, const std::string& mask) {
  const std::vector<std::uint8_t> flags = image::read_mask(mask, input.image.width, input.image.height);
  for (std::size_t p = 0; p < flags.size(); ++p) {
    if (flags[p] == 0) input.use[p] = 0;
  }
}

}  // namespace interglow::cli
