// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/capture_file.h"

#include <fmt/format.h>

#include <algorithm>

#include "image/mask_file.h"
#include "scene/key_reader.h"
#include "spectral/shipped_tables.h"
#include "spectral/spectrum_file.h"

namespace interglow::fitting {
namespace {

namespace fs = std::filesystem;
using scene::KeyReader;

constexpr const char* kDescription = "capture.toml";

fs::path existing(const KeyReader& keys, std::string_view key, const std::string& text, const fs::path& folder) {
  const fs::path path = (folder / text).lexically_normal();
  std::error_code failed;
  if (!fs::exists(path, failed)) {
    keys.fail(key, fmt::format("\"{}\" was not found ({}); expected a file or folder, named relative to the folder of "
                               "the description. Correct the path.",
                               text, path.string()));
  }
  return path;
}

/// One name or a list of names.
std::vector<fs::path> find_paths(KeyReader& keys, std::string_view key, const fs::path& folder) {
  const scene::TomlNode* node = keys.find(key);
  std::vector<fs::path> paths;
  if (node == nullptr) return paths;
  const auto add = [&](const scene::TomlNode& entry) {
    const auto* text = std::get_if<std::string>(&entry.value);
    if (text == nullptr) keys.fail_value(key, entry, "the name of a file or folder in quotes, or a list of such");
    paths.push_back(existing(keys, key, *text, folder));
  };
  if (const auto* list = std::get_if<std::vector<scene::TomlNode>>(&node->value)) {
    for (const scene::TomlNode& entry : *list) add(entry);
  } else {
    add(*node);
  }
  return paths;
}

Eigen::VectorXd as_vector(const std::vector<double>& values) {
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

/// A number for all bands, one a band, or the name of a table.
void read_white_reflectance(KeyReader& keys, const fs::path& folder, CaptureSource& source) {
  constexpr const char* kKey = "white_reflectance";
  constexpr scene::Range kRange{0.0, 1.2, true};
  const auto column = keys.find_text("white_reflectance_column");
  const scene::TomlNode* node = keys.find(kKey);
  if (node == nullptr) {
    if (!source.white.empty())
      keys.fail_missing(kKey, "the reflectance of the white target: a number, one a band, or the name of a table");
    return;
  }
  if (source.white.empty()) keys.fail(kKey, "there is no white frame. Add \"white\", or remove this key.");
  if (const auto* text = std::get_if<std::string>(&node->value)) {
    try {
      source.white_table = spectral::find_table(*text, folder);
    } catch (const InvalidInput& error) {
      keys.fail(kKey, error.what());
    }
    source.white_column = column.value_or("");
  } else if (std::holds_alternative<std::vector<scene::TomlNode>>(node->value)) {
    source.params.white_reflectance = as_vector(*keys.find_numbers(kKey, kRange));
  } else {
    source.params.white_reflectance = Eigen::VectorXd::Constant(1, *keys.find_number(kKey, kRange));
  }
}

CaptureSource read_description(const fs::path& file) {
  const scene::TomlNode root = scene::read_toml(file);
  KeyReader keys(file.string(), "", root);
  const fs::path folder = file.parent_path();
  CaptureSource source;
  const std::string object = keys.require("object", keys.find_text("object"), "the file or folder with the objects");
  source.object = existing(keys, "object", object, folder);
  source.dark = find_paths(keys, "dark", folder);
  source.white = find_paths(keys, "white", folder);
  if (const auto mask = keys.find_text("mask")) source.mask = existing(keys, "mask", *mask, folder);
  if (const auto list = keys.find_numbers("wavelengths_nm", {100.0, 20000.0}))
    source.hints.wavelength_nm = as_vector(*list);
  source.hints.mat.cube = keys.find_text("mat_variable").value_or("");
  source.hints.mat.wavelength = keys.find_text("mat_wavelengths").value_or("");
  source.linear = keys.find_bool("linear");
  CaptureParams& params = source.params;
  params.bits = keys.find_integer("bits", 1, 32);
  params.saturation = keys.find_number("saturation", scene::kPositive);
  params.saturation_margin_px = keys.find_integer("saturation_margin_px", 0, 100).value_or(params.saturation_margin_px);
  if (const auto level = keys.find_number("dark_level")) {
    params.dark_level = *level;
    if (!source.dark.empty()) keys.fail("dark_level", "there are dark frames as well. Remove one of the two.");
  }
  if (const auto exposure = keys.find_numbers("exposure", scene::kPositive)) params.exposure = as_vector(*exposure);
  read_white_reflectance(keys, folder, source);
  params.least_white = keys.find_number("least_white", {0.0, 1.0, false, true}).value_or(params.least_white);
  keys.find_text("note");
  if (auto noise = keys.find_table("noise")) {
    const auto number = [&](const char* key) { return noise->find_number(key, scene::kNotNegative); };
    source.noise = SensorNoise{.read_sigma = noise->require("read_sigma", number("read_sigma"), "counts"),
                               .shot_gain = noise->require("shot_gain", number("shot_gain"), "counts per electron"),
                               .relative_sigma = number("relative_sigma").value_or(0.0)};
    source.quantisation_step = number("quantisation_step");
    noise->finish();
  }
  keys.finish();
  return source;
}

/// Reads one frame and refuses what is not linear counts.
image::CubeFile read_frame(const fs::path& path, const CaptureSource& source) {
  image::CubeFile frame = image::read_cube(path, source.hints);
  const auto fail = [&](const std::string& sentence) { throw InvalidInput(path.string() + ": " + sentence); };
  if (source.linear == false)
    fail("declared as not linear; fits need values proportional to light. Convert the frames to linear ones first.");
  if (!source.linear && frame.gamma != 1.0) {
    fail(
        fmt::format("the file says that its values are encoded with a gamma of {:.2g}. Convert them to linear ones, or "
                    "write linear = true in a capture.toml if the file is wrong.",
                    frame.gamma));
  }
  if (!source.linear && frame.whole_bits == 8) {
    fail(
        "8-bit values, which are usually encoded for displays. Use 16-bit files, or write linear = true in a "
        "capture.toml if these are proportional to light.");
  }
  if (frame.whole_bits > 0) {
    const float largest = *std::max_element(frame.image.value.begin(), frame.image.value.end());
    if (!source.params.bits) {
      fail(
          fmt::format("whole numbers up to {} in {} bits; the camera's bit depth is needed to know what is saturated. "
                      "Write bits = 12 (or what it is) in a capture.toml.",
                      largest, frame.whole_bits));
    }
    if (*source.params.bits > frame.whole_bits)
      fail(fmt::format("values of {} bits; bits = {} is declared. Correct it.", frame.whole_bits, *source.params.bits));
  }
  return frame;
}

}  // namespace

CaptureSource read_capture_source(const fs::path& path) {
  std::error_code failed;
  if (!fs::exists(path, failed)) throw InvalidInput(path.string() + ": there is no such file or folder.");
  if (path.extension() == ".toml") return read_description(path);
  if (fs::is_directory(path, failed) && fs::exists(path / kDescription, failed))
    return read_description(path / kDescription);
  return {.object = path};
}

Capture load_capture(const CaptureSource& source) {
  const image::CubeFile object = read_frame(source.object, source);
  CaptureFrames frames{.object = object.image};
  const auto read_others = [&](const std::vector<fs::path>& paths, std::vector<image::SpectralImage>& to) {
    for (const fs::path& path : paths) {
      image::CubeFile frame = read_frame(path, source);
      if (frame.whole_bits != object.whole_bits) {
        const auto type = [](int bits) { return bits == 0 ? std::string("floats") : fmt::format("{} bits", bits); };
        throw InvalidInput(fmt::format("{}: {}, the object frame {} has {}. All frames must be counts of one camera.",
                                       path.string(), type(frame.whole_bits), source.object.string(),
                                       type(object.whole_bits)));
      }
      to.push_back(std::move(frame.image));
    }
  };
  read_others(source.dark, frames.dark);
  read_others(source.white, frames.white);
  frames.mask = image::read_mask(source.mask, frames.object.width, frames.object.height);
  CaptureParams params = source.params;
  const double step = source.quantisation_step.value_or(object.whole_bits > 0 ? 1.0 : 0.0);
  const bool can_estimate = frames.dark.size() > 1 && frames.white.size() > 1;
  params.noise = source.noise ? *source.noise : can_estimate ? estimate_noise(frames, step) : SensorNoise{};
  params.noise.quantisation_step = step;
  if (!source.white_table.empty()) {
    params.white_reflectance = spectral::band_means(spectral::read_spectrum(source.white_table, source.white_column),
                                                    spectral::WavelengthGrid::from_centers(frames.object.wavelength_nm),
                                                    spectral::Outside::kRefuse);
  }
  return correct_capture(frames, params);
}

Capture read_capture(const fs::path& path) { return load_capture(read_capture_source(path)); }

}  // namespace interglow::fitting
