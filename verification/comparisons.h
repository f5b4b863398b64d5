// SPDX-License-Identifier: GPL-3.0-or-later
/// What is compared with what: pictures of the radiosity solver against estimates of the path tracer, channel by
/// channel.
#pragma once

#include <vector>

#include "cross_check/agreement.h"
#include "cross_check/path_tracer.h"
#include "scene/scene.h"
#include "verification/radiosity_run.h"

namespace interglow::verification {

struct ComparisonParams {
  /// A component that carries a smaller share of the whole picture is measured by this share of it.
  double faint_component_share = 0.05;
};

/// The total (whole picture, tiles and bands), then each component that either side has (whole picture): re, rr, le,
/// li, rl. li = lr + ll,
/// whose standard error is at most the sum of both.
/// @param coarser  the picture from patches twice as large, for the discretisation error; may be null
/// @pre both of the same scene and camera; at least 2 batches
std::vector<cross_check::Comparison> compare_channels(const rendering::RenderedImages& images,
                                                      const rendering::RenderedImages* coarser,
                                                      const cross_check::PathTracer& tracer, const scene::Scene& scene,
                                                      const ComparisonParams& params);

/// Mean over all pixels of the band integral [W m^-2 sr^-1].
double mean_radiance(const image::SpectralImage& image, const Eigen::VectorXd& band_width_nm);

/// Root mean square of candidate - reference over the pixels' band integrals, without what the reference's noise
/// explains: an unbiased estimate of the candidate's own squared error, at 0 if negative; relative to the mean.
double rms_error(const image::SpectralImage& candidate, const cross_check::Estimate& reference,
                 const Eigen::VectorXd& band_width_nm);

/// Root mean square of the standard errors of the pixels' band integrals, relative to the mean.
double rms_noise(const cross_check::Estimate& estimate);

}  // namespace interglow::verification
