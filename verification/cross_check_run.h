// SPDX-License-Identifier: GPL-3.0-or-later
/// The check of a scene from beginning to verdict: radiosity on its patches and on patches halved (or with its error
/// estimated, where that would take too long), the path tracer (or
/// a picture from elsewhere) until the statistics decide or time is up.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "cross_check/agreement.h"
#include "cross_check/path_tracer.h"
#include "cross_check/pixel_diagnosis.h"
#include "diagnostics/progress.h"
#include "verification/comparisons.h"
#include "verification/radiosity_run.h"
#include "verification/reference_image.h"

namespace interglow::verification {

/// Which of our methods is checked against a picture from elsewhere.
enum class Method { kRadiosity, kPathTracer };

struct CrossCheckParams {
  cross_check::AgreementParams agreement;
  ComparisonParams comparison;
  RadiosityParams radiosity;
  /// Wall time of the whole check; the first `first_batches` and one radiosity run are made in any case.
  double time_limit_s = 300.0;
  /// Batches before the first judgement, at least 32, and paths a batch.
  int first_batches = 32;
  int samples_per_batch = 16;
  std::uint64_t seed = 1;
  /// Patches are halved up to this number of halved ones; beyond it the discretisation error is estimated.
  std::size_t most_halved_patches = 60000;
};

void validate(const CrossCheckParams& params);

/// Noise of the path tracer after some time.
struct NoisePoint {
  double seconds = 0.0;
  double paths_per_pixel = 0.0;
  double relative_error = 0.0;  ///< root mean square over the pixels, relative to the mean
};

struct CrossCheck {
  scene::Scene scene;                                ///< flat, with the camera of the check
  std::optional<RadiosityRun> fine;                  ///< patches halved; the candidate where it is present
  std::optional<RadiosityRun> coarse;                ///< the scene's own patches
  std::string discretisation_note;                   ///< why patches were not halved; empty if they were
  bool reference_limits = false;                     ///< sampling ended because the reference's own noise decides
  std::vector<cross_check::Comparison> comparisons;  ///< the total first
  cross_check::Agreement agreement;
  cross_check::PixelDiagnosis diagnosis;  ///< of the total
  cross_check::Verdict verdict = cross_check::Verdict::kUndecided;
  std::string candidate_name, reference_name;
  bool reference_has_error = true;  ///< false: differences only, no verdict
  std::vector<NoisePoint> noise;
  int batches = 0;
  int looks = 1;  ///< at the samples, the last of which judged
  std::int64_t paths = 0;
  double largest_sample = 0.0;
  double seconds_path_tracer = 0.0;
  double seconds = 0.0;
  bool out_of_time = false;

  const RadiosityRun* candidate_run() const { return fine ? &*fine : coarse ? &*coarse : nullptr; }
  const RadiosityRun* coarser_run() const { return fine && coarse ? &*coarse : nullptr; }
  /// What the candidate's discretisation error is taken from: the coarser run, or the estimate.
  const rendering::RenderedImages* coarser_images() const {
    return coarser_run() != nullptr ? &coarse->images : coarse && coarse->estimate ? &*coarse->estimate : nullptr;
  }
};

/// Radiosity against the path tracer.
/// @param scene  as made by `check_scene`
/// @throws what its steps throw
CrossCheck cross_check_scene(const scene::Scene& scene, const CrossCheckParams& params, const Progress& progress = {});

/// One of the methods against a picture from elsewhere; the camera takes the picture's size. Without a standard error
/// the verdict is undecided. The path tracer's own error counts beside the picture's.
CrossCheck cross_check_reference(const scene::Scene& scene, const ReferenceImage& reference, Method method,
                                 const CrossCheckParams& params, const Progress& progress = {});

}  // namespace interglow::verification
