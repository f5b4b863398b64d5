// SPDX-License-Identifier: GPL-3.0-or-later
/// Captures in files: frames in any of the image formats, and the description that says what they are.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "fitting/capture.h"
#include "image/cube_file.h"

namespace interglow::fitting {

/// Which files make a capture, and what they do not say themselves. Keys of capture.toml: docs/captures.md.
struct CaptureSource {
  std::filesystem::path object;
  std::vector<std::filesystem::path> dark{};
  std::vector<std::filesystem::path> white{};
  std::filesystem::path mask{};
  image::CubeHints hints{};  ///< for all frames
  /// Declared: values are proportional to light. Must be given for 8-bit files and files that name a gamma.
  std::optional<bool> linear{};
  /// Declared noise; unset: estimated from two or more dark and white frames, otherwise unknown.
  std::optional<SensorNoise> noise{};
  /// Of the noise; unset: 1 for files of whole numbers, 0 for floats [counts].
  std::optional<double> quantisation_step{};
  /// Table of the white target's reflectance over wavelength, in place of `params.white_reflectance`.
  std::filesystem::path white_table{};
  std::string white_column{};
  /// The rest; its `noise` is not used.
  CaptureParams params{};
};

/// A description (.toml, or a folder that holds capture.toml), or a bare file or folder of bands.
/// @throws InvalidInput with file, line, key and value: unknown keys, wrong types and ranges, files that are not there
CaptureSource read_capture_source(const std::filesystem::path& path);

/// Reads the frames and corrects them.
/// @throws InvalidInput additionally to `image::read_cube` and `correct_capture`: whole numbers without a bit depth,
///         8-bit values or a gamma without `linear = true`, `linear = false`, frames stored in different types, fewer
///         bits in the file than declared, a white table that does not cover the bands
Capture load_capture(const CaptureSource& source);

/// `load_capture` of `read_capture_source`.
Capture read_capture(const std::filesystem::path& path);

}  // namespace interglow::fitting
