// SPDX-License-Identifier: GPL-3.0-or-later
/// A camera's pose from what the objects cover.
#pragma once

#include "diagnostics/progress.h"
#include "fitting/fit_data.h"
#include "fitting/forward_model.h"
#include "fitting/minimizer.h"

namespace interglow::fitting {

/// Moves the camera until what the objects cover is what is bright in the capture: least squares on pictures blurred
/// by 4 pixels, then by 1.5. Meant for pictures of some 32 pixels. Costs no light. Turns that a smooth outline leaves
/// open stay where they were.
FitStage align_silhouettes(const ForwardModel& model, const FitData& data, FitState& state,
                           const Progress& progress = {});

}  // namespace interglow::fitting
