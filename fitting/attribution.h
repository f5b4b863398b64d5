// SPDX-License-Identifier: GPL-3.0-or-later
/// What a fitted w/w′ away from 1 may stand for.
#pragma once

#include <string>
#include <vector>

#include "diagnostics/progress.h"
#include "fitting/forward_model.h"
#include "fitting/scene_fit.h"
#include "fitting/uncertainty.h"

namespace interglow::fitting {

enum class AttributionVerdict { kNotNeeded, kExplained, kShared, kUndetermined };
const char* name(AttributionVerdict verdict);

/// Something that the model may lack, at a size that happens.
struct Cause {
  std::string name;
  std::string size;           ///< that was tried, in words
  double shift = 0.0;         ///< of the fitted w, if the capture has this and the model does not
  double angle_deg = 0.0;     ///< between what w and what the cause change, other parameters refitted; 90: unlike
  double amplitude = 0.0;     ///< that fits the residuals best, in sizes
  double amplitude_sd = 0.0;  ///< of it
  double w_with = 0.0;        ///< fitted w with the cause at that amplitude
  bool absorbed = false;      ///< free parameters imitate it wholly
  bool supported = false;     ///< amplitude above 3 standard deviations, at most 3 sizes, and w nearer to 1
};

struct Attribution {
  std::vector<Cause> causes;
  AttributionVerdict verdict = AttributionVerdict::kUndetermined;
  std::string sentence;
};

/// For each cause the change of the picture is computed and appended to the compressed residuals, where it costs no
/// fit: to first order, the shift of w that it makes, how unlike w it is, and how much of it the residuals hold.
/// Causes: bounces that the model leaves out or the capture lacks, a gap at the contact, light tilt, reflectance, veil,
/// offset, misregistration, blur. A gap needs form factors of its own.
///
/// @param model  its bounces are changed and restored
Attribution attribute_w(ForwardModel& model, const ForwardParams& forward, const SceneFit& fit, const FitParams& params,
                        const Uncertainty& uncertainty, const Progress& progress = {});

}  // namespace interglow::fitting
