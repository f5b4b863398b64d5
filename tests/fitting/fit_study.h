// SPDX-License-Identifier: GPL-3.0-or-later
/// Many fits of two half cylinders to captures simulated on a finer mesh: do far starts arrive, do intervals cover?
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "fit_scenes.h"
#include "fitting/scene_fit.h"
#include "fitting/uncertainty.h"

namespace interglow::test {

struct StudyParams {
  FitSceneParams scene{.around = 10, .along = 3, .bands = 8, .side_px = 48, .fluorescent = true};
  /// How the fitted model makes its faces finer.
  fitting::FitMeshParams mesh{};
  /// Of the captured scene: this many faces around, made twice as fine as the fitted ones, no corner of which they
  /// share.
  int captured_around = 14;
  std::uint64_t seed = 1;
  /// Called after every fit with a line about it.
  std::function<void(const std::string&)> report{};
};

struct StartStudy {
  int tried = 0;
  int reached = 0;
};

/// Fits one capture from starts that are turned by `turn_deg` about a random axis, nearer or farther by
/// `distance_share`, and lit from `light_deg` off. A start arrives if Σ ρ is within 1 of the fit's that begins at the
/// truth, as for one that lies a standard deviation of a single parameter away.
StartStudy study_starts(const StudyParams& params, int starts, double turn_deg, double distance_share,
                        double light_deg);

/// How many 95 % intervals of one parameter hold the truth, of those captures in which it is called determined.
struct Covered {
  std::string name;
  int determined = 0;
  int covered = 0;
  double z_square = 0.0;  ///< Σ (error / standard deviation)²
};

/// Captures with light, pose, w, blur, gains and offsets at random; each is fitted from near its truth.
std::vector<Covered> study_intervals(const StudyParams& params, int captures);

}  // namespace interglow::test
