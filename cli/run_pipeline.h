// SPDX-License-Identifier: GPL-3.0-or-later
/// The main job: from a scene file to a solved and rendered scene, with everything that was measured on the way.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "diagnostics/progress.h"
#include "radiosity/elements.h"
#include "radiosity/error_estimate.h"
#include "radiosity/solution.h"
#include "radiosity/transport.h"
#include "rendering/contact.h"
#include "rendering/render.h"
#include "scene/scene_builder.h"
#include "scene/scene_file.h"

namespace interglow::cli {

/// Time by stage, in the order of work.
class StageTimes {
 public:
  struct Stage {
    std::string name;
    double wall_s;
    double processor_s;  ///< of all threads: what stays comparable on a machine that does other work as well
  };

  /// Runs `work` and adds its times as `stage`.
  template <typename Work>
  auto measure(const std::string& stage, const Work& work) {
    const Stopwatch watch(*this, stage);
    return work();
  }
  const std::vector<Stage>& stages() const { return stages_; }
  double total_wall_s() const;
  double total_processor_s() const;

 private:
  struct Stopwatch {
    Stopwatch(StageTimes& times, std::string stage);
    ~Stopwatch();
    StageTimes& times;
    std::string stage;
    double wall_start_s;
    double processor_start_s;
  };
  std::vector<Stage> stages_;
};

struct RunOutcome {
  scene::BuiltScene built;
  radiosity::Elements elements;
  radiosity::TransportReport transport;
  radiosity::Solution solution;
  radiosity::EnergyBalance balance;
  radiosity::ErrorEstimate error;
  rendering::RenderedImages images;
  std::optional<rendering::ContactRatio> contact;  ///< w'; empty where no two objects come close in the picture
  StageTimes times;
};

/// @throws InvalidInput, InvalidParams, NumericalFailure (also if the solve did not converge), Cancelled
RunOutcome run_scene(const scene::SceneDescription& description, const Progress& progress);

}  // namespace interglow::cli
