// SPDX-License-Identifier: GPL-3.0-or-later
/// The main job: from a scene file to a solved and rendered scene, with everything that was measured on the way.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "diagnostics/progress.h"
#include "radiosity/elements.h"
#include "radiosity/solution.h"
#include "radiosity/transport.h"
#include "rendering/contact.h"
#include "rendering/render.h"
#include "scene/scene_builder.h"
#include "scene/scene_file.h"

namespace interglow::cli {

/// Seconds by stage, in the order of work.
class StageTimes {
 public:
  /// Runs `work` and adds its wall time to `stage`.
  template <typename Work>
  auto measure(const std::string& stage, const Work& work) {
    const Stopwatch watch(*this, stage);
    return work();
  }
  const std::vector<std::pair<std::string, double>>& seconds() const { return seconds_; }
  double total_s() const;

 private:
  struct Stopwatch {
    Stopwatch(StageTimes& times, std::string stage);
    ~Stopwatch();
    StageTimes& times;
    std::string stage;
    double start_s;
  };
  std::vector<std::pair<std::string, double>> seconds_;
};

struct RunOutcome {
  scene::BuiltScene built;
  radiosity::Elements elements;
  radiosity::TransportReport transport;
  radiosity::Solution solution;
  radiosity::EnergyBalance balance;
  rendering::RenderedImages images;
  std::optional<rendering::ContactRatio> contact;  ///< w'; empty where no two objects come close in the picture
  StageTimes times;
};

/// @throws InvalidInput, InvalidParams, NumericalFailure (also if the solve did not converge), Cancelled
RunOutcome run_scene(const scene::SceneDescription& description, const Progress& progress);

}  // namespace interglow::cli
