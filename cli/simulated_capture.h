// SPDX-License-Identifier: GPL-3.0-or-later
/// A scene as a camera would have captured it, in files.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>

#include "diagnostics/progress.h"
#include "fitting/simulated_sensor.h"

namespace interglow::cli {

struct SimulatedCaptureRequest {
  std::filesystem::path scene;
  std::filesystem::path out;
  std::string command_line;
  std::string format = "tif";              ///< tif, png, envi or mat
  std::optional<int> size{};               ///< pixels along the longer side; unset: the scene's
  std::optional<double> edge_length_mm{};  ///< of the patches, in place of the scene file's
  /// Paths a pixel of the path tracer; 0: radiosity. The path tracer sees flat faces.
  int paths = 0;
  /// Factor on all light that came from other objects: the w/w′ that an estimator should find. At least 0.
  double indirect_scale = 1.0;
  double white_reflectance = 0.99;
  /// The sensor's misalignment about the middle of the picture: ideal = scale · turn · (sensor - middle) + middle +
  /// shift
  Eigen::Vector2d shift_px = Eigen::Vector2d::Zero();
  double turn_deg = 0.0;
  double scale = 1.0;
  fitting::SensorParams sensor{};  ///< its map is set from these
};

/// Writes object, dark_i and white_i frames, mask.png (objects), ideal.exr (radiance before the camera), preview.png,
/// capture.toml, which `fitting::read_capture` takes, and truth.json. Returns the lines to show.
/// @throws InvalidParams, InvalidInput, NumericalFailure, Cancelled
std::string write_simulated_capture(SimulatedCaptureRequest request, const Progress& progress);

}  // namespace interglow::cli
