// SPDX-License-Identifier: GPL-3.0-or-later
/// Many fits to captures simulated on a finer mesh or path-traced: do far starts arrive, do intervals cover?
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "fit_scenes.h"
#include "fitting/scene_fit.h"
#include "fitting/uncertainty.h"

namespace interglow::test {

struct StudyParams {
  bool arch = false;  ///< the arch on the plane; otherwise the two half cylinders
  FitSceneParams scene{.around = 10, .along = 3, .bands = 8, .side_px = 48, .fluorescent = true};
  /// How the fitted model makes its faces finer.
  fitting::FitMeshParams mesh{};
  /// Of the captured scene: this many faces around, made twice as fine as the fitted ones, no corner of which they
  /// share.
  int captured_around = 14;
  /// Captures of intervals are path-traced on `traced_around` faces around, half as many along, with this many paths of
  /// each pixel; 0: simulated by the same kind of model.
  int paths = 0;
  int traced_around = 256;
  std::optional<std::filesystem::path> keep{};  ///< folder for traced pictures; those there already are taken
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
  double error_sum = 0.0;  ///< Σ (estimate - truth)
  double sd_sum = 0.0;     ///< Σ standard deviation
  double z_sum = 0.0;      ///< Σ error / standard deviation
  double z_square = 0.0;   ///< Σ (error / standard deviation)²
};

struct IntervalStudy {
  std::vector<Covered> parameters;
  /// Variance of the tracer over that of the captures, in which it is contained: mean, and the share of values where it
  /// is larger, so that they are noisier than they say.
  double tracer_share = 0.0;
  double too_noisy = 0.0;
};

/// Captures `first` to `first` + `captures` - 1, with light, pose, w, blur, gains and offsets at random, each from
/// seeds of its own; each is fitted from near its truth.
///
/// Of a path-traced capture light, pose and focal length are traced, w, blur, gains and offsets are applied to what
/// was. The sensor's noise is drawn with the variance of a 12-bit camera less that of the tracer, which is known from
/// independent parts of each picture, so that both together are the camera's.
IntervalStudy study_intervals(const StudyParams& params, int first, int captures);

}  // namespace interglow::test
