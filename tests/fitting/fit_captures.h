// SPDX-License-Identifier: GPL-3.0-or-later
/// Captures of test scenes by the renderer or the path tracer, on meshes of their own, with a camera's noise.
#pragma once

#include <cstdint>
#include <optional>

#include "fitting/capture.h"
#include "scene/scene.h"

namespace interglow::test {

struct CaptureOptions {
  double full_scale = 3500.0;     ///< counts of the brightest value
  std::optional<double> scale{};  ///< counts per unit of radiance; unset: such that the above holds
  double noise = 1.0;  ///< factor on the noise of a 12-bit camera: 1.5 counts read, 0.25 counts per count shot
  double blur_px = 0.0;
  double offset_share = 0.0;  ///< of the peak
  double veil_share = 0.0;    ///< of the light, spread evenly over the picture
  double gain_spread = 0.0;   ///< gains alternate by ± this from band to band
  double w = 1.0;             ///< factor on the indirect light
  std::optional<int> bounces{};
  unsigned seed = 1;
};

/// Objects whose pictures are taken; with `noise` 0 the noise is unknown to the fit.
fitting::Capture simulated_capture(const scene::Scene& scene, const CaptureOptions& options = {});

/// The same by the path tracer, which shares nothing with the fitted model: the faces themselves are the surface, so
/// that round bodies need fine ones. @param paths  of each pixel, at least 2
fitting::Capture traced_capture(const scene::Scene& scene, int paths, const CaptureOptions& options = {});

}  // namespace interglow::test
