// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/attribution.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "fit_scenes.h"

namespace interglow::fitting {
namespace {

constexpr int kSide = 24;

scene::Scene cylinders() {
  return test::half_cylinders({.around = 8, .along = 4, .bands = 3, .side_px = kSide, .fluorescent = false});
}

FitState truth_of(const ForwardModel& model) {
  FitState truth = model.initial_state();
  truth.gain.setConstant(8000.0);
  return truth;
}

/// A model's own picture, without noise but with the noise that a camera would state.
Capture capture_of(const ForwardModel& model, const FitState& state) {
  Capture capture;
  capture.image = picture(model, state, model.evaluate(state, {}));
  capture.use.assign(kSide * kSide, 1);
  capture.value_per_count.assign(static_cast<std::size_t>(capture.image.bands()), 1.0F);
  capture.noise = {1.5, 0.25, 1.0, 0.0};
  return capture;
}

/// Fits only the light and w, as every planted cause would be taken up by something else otherwise.
constexpr FitParams kLightAndW{.focal = false, .blur = false, .gain = false, .staged = false};

const Cause& cause(const Attribution& attribution, const std::string& what) {
  return *std::find_if(attribution.causes.begin(), attribution.causes.end(),
                       [&](const Cause& c) { return c.name == what; });
}

struct Attributed {
  SceneFit fit;
  Attribution attribution;
};

Attributed attributed(ForwardModel& model, const ForwardParams& forward, const Capture& capture) {
  Attributed result;
  result.fit = fit_scene(model, capture, truth_of(model), kLightAndW);
  const Uncertainty found = examine(model, result.fit, kLightAndW, {.profile = false});
  result.attribution = attribute_w(model, forward, result.fit, kLightAndW, found);
  return result;
}

// The capture holds all bounces, the model one. The picture lacks exactly once what "missing bounces" adds, and w = 1
// with it.
TEST(Attribution, FindsTheBouncesThatTheModelLeavesOut) {
  const ForwardModel all(cylinders(), {});
  const ForwardParams one_bounce{.bounces = 1};
  ForwardModel model(cylinders(), one_bounce);
  const Attributed result = attributed(model, one_bounce, capture_of(all, truth_of(all)));
  EXPECT_GT(result.fit.state.w, 1.02);
  const Cause& bounces = cause(result.attribution, "missing bounces");
  EXPECT_GT(bounces.shift, 0.0);
  EXPECT_NEAR(bounces.amplitude, 1.0, 0.15) << result.attribution.sentence;
  EXPECT_NEAR(bounces.w_with, 1.0, 0.2 * (result.fit.state.w - 1.0)) << result.attribution.sentence;
}

// A veil is a share of every band's picture and its mean: free gains and offsets imitate it wholly.
TEST(Attribution, FreeGainsAndOffsetsAbsorbAVeil) {
  const ForwardParams forward{};
  ForwardModel model(cylinders(), forward);
  const FitParams params{.focal = false, .blur = false, .gain = true, .offset = true, .staged = false};
  const SceneFit fit = fit_scene(model, capture_of(model, truth_of(model)), truth_of(model), params);
  const Attribution attribution =
      attribute_w(model, forward, fit, params, examine(model, fit, params, {.profile = false}));
  EXPECT_TRUE(cause(attribution, "veil").absorbed) << cause(attribution, "veil").amplitude;
  EXPECT_FALSE(cause(attribution, "missing bounces").absorbed);
}

// The model's own picture needs no cause.
TEST(Attribution, BlamesNothingWhereWIsOne) {
  const ForwardParams forward{};
  ForwardModel model(cylinders(), forward);
  const Attributed result = attributed(model, forward, capture_of(model, truth_of(model)));
  EXPECT_NEAR(result.fit.state.w, 1.0, 1e-3);
  EXPECT_EQ(result.attribution.verdict, AttributionVerdict::kNotNeeded) << result.attribution.sentence;
}

}  // namespace
}  // namespace interglow::fitting
