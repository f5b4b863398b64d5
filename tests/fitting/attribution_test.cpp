// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/attribution.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <ostream>
#include <string>

#include "fit_scenes.h"

namespace interglow::fitting {
namespace {

constexpr int kSide = 24;
/// Captures are the model's own pictures: its patches need not be fine.
const ForwardParams kAsTheyAre{.mesh = {}};

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
  const ForwardModel all(cylinders(), kAsTheyAre);
  const ForwardParams one_bounce{.mesh = {}, .bounces = 1};
  ForwardModel model(cylinders(), one_bounce);
  const Attributed result = attributed(model, one_bounce, capture_of(all, truth_of(all)));
  EXPECT_GT(result.fit.state.w, 1.02);
  const Cause& bounces = cause(result.attribution, "missing bounces");
  EXPECT_GT(bounces.shift, 0.0);
  EXPECT_NEAR(bounces.amplitude, 1.0, 0.15) << result.attribution.sentence;
  EXPECT_NEAR(bounces.w_with, 1.0, 0.2 * (result.fit.state.w - 1.0)) << result.attribution.sentence;
}

/// A defect of a capture, of `amount` times the size that attribute_w tries, and what a fit without it may move.
struct Planted {
  std::string name;
  FitParams params;
  std::function<void(FitState&, double amount)> of_state{};
  std::function<void(scene::Scene&, double amount)> of_scene{};
  /// At which w moves in proportion. Light at a contact is not linear in the gap: its own size.
  double small = 0.1;
};

void PrintTo(const Planted& planted, std::ostream* to) { *to << planted.name; }

class PlantedCause : public testing::TestWithParam<Planted> {
 protected:
  PlantedCause() : model_(cylinders(), kAsTheyAre) {}

  void fit(const FitParams& params, double amount) {
    const Planted& planted = GetParam();
    scene::Scene scene = cylinders();
    if (planted.of_scene) planted.of_scene(scene, amount);
    FitState state = truth_of(model_);
    state.blur_px = 1.0;
    const FitState start = state;
    if (planted.of_state) planted.of_state(state, amount);
    const Capture capture = capture_of(ForwardModel(scene, kAsTheyAre), state);
    fit_ = fit_scene(model_, capture, start, params);
    uncertainty_ = examine(model_, fit_, params, {.profile = false});
    attribution_ = attribute_w(model_, kAsTheyAre, fit_, params, uncertainty_);
  }

  std::string table() const {
    std::string text =
        fmt::format("{}\nw {:.5f} ± {:.5f}\n", attribution_.sentence, fit_.state.w, uncertainty_.find(kW)->sd);
    for (const Cause& one : attribution_.causes) {
      text += fmt::format("{}: shift {:.5f}, amplitude {:.3f} ± {:.3f}, w with it {:.4f}{}{}\n", one.name, one.shift,
                          one.amplitude, one.amplitude_sd, one.w_with, one.absorbed ? ", absorbed" : "",
                          one.supported ? ", supported" : "");
    }
    return text;
  }

  ForwardModel model_;
  SceneFit fit_;
  Uncertainty uncertainty_;
  Attribution attribution_;
};

// Without a robust loss a small defect moves w by what is predicted to first order.
TEST_P(PlantedCause, MovesWByWhatIsPredicted) {
  FitParams params = GetParam().params;
  params.huber_sigmas = 1e9;
  fit(params, GetParam().small);
  const Cause& planted = cause(attribution_, GetParam().name);
  EXPECT_GT(std::abs(planted.shift), 1e-3) << table();
  EXPECT_NEAR((fit_.state.w - 1.0) / (GetParam().small * planted.shift), 1.0, 0.1) << table();
}

// At its full size the verdict never names another cause alone: the planted one explains w, or shares it, or nothing is
// said.
TEST_P(PlantedCause, IsNamedSharedOrLeftOpen) {
  fit(GetParam().params, 1.0);
  const Cause& planted = cause(attribution_, GetParam().name);
  switch (attribution_.verdict) {
    case AttributionVerdict::kExplained:
      EXPECT_NE(attribution_.sentence.find("explained by " + planted.name), std::string::npos) << table();
      break;
    case AttributionVerdict::kShared:
      EXPECT_TRUE(planted.supported) << table();
      break;
    case AttributionVerdict::kNotNeeded:
      EXPECT_LT(std::abs(fit_.state.w - 1.0), 2.0 * uncertainty_.find(kW)->sd) << table();
      break;
    case AttributionVerdict::kUndetermined:
      break;
  }
}

/// What is planted is held in the fit, as a free parameter would take it up.
constexpr FitParams kWAndPose{
    .light = false, .focal = false, .blur = false, .gain = false, .offset = false, .staged = false};
constexpr FitParams kWAndTheLight{
    .pose = false, .focal = false, .blur = false, .gain = false, .offset = false, .staged = false};

INSTANTIATE_TEST_SUITE_P(
    Attribution, PlantedCause,
    testing::Values(
        Planted{.name = "contact gap",
                .params = kWAndPose,
                .of_state = {},
                .of_scene =
                    [](scene::Scene& scene, double amount) {
                      // Half of the smallest extent of an object is 10 mm.
                      for (Eigen::Vector3d& p : scene.objects[1].patches.points) p.x() += amount * 0.02 * 10.0;
                    },
                .small = 1.0},
        Planted{.name = "light tilt",
                .params = kWAndPose,
                .of_state =
                    [](FitState& state, double amount) {
                      const double tilt = amount * std::numbers::pi / 180.0;
                      state.light_direction =
                          (state.light_direction + tilt * light_tangents(state.light_direction).col(0)).normalized();
                    }},
        Planted{.name = "reflectance of red",
                .params = kWAndTheLight,
                .of_state = [](FitState& state, double amount) { state.scale[0] += 0.02 * amount; }},
        Planted{.name = "misregistration",
                .params = kWAndTheLight,
                .of_state = [](FitState& state, double amount) { state.camera.principal_px.x() += 0.5 * amount; }},
        Planted{.name = "blur",
                .params = kWAndTheLight,
                .of_state =
                    [](FitState& state, double amount) {
                      // In quadrature, the picture changes with the square of the width.
                      state.blur_px = std::sqrt(state.blur_px * state.blur_px + amount * 0.25);
                    }}),
    [](const testing::TestParamInfo<Planted>& planted) {
      std::string name = planted.param.name;
      std::erase_if(name, [](char c) { return c == ' '; });
      return name;
    });

/// Stray light and a veil, in the colours that attribute_w takes for them: an offset a band.
TEST(Attribution, FindsStrayLightWhereOffsetsAreHeld) {
  const ForwardParams& forward = kAsTheyAre;
  ForwardModel model(cylinders(), forward);
  FitState state = truth_of(model);
  const Evaluation here = model.evaluate(state, {});
  const image::SpectralImage clean = picture(model, state, here);
  const Eigen::RowVectorXd mean =
      (here.channels.colwise().mean() * model.palette()).array() * state.gain.transpose().array();
  const double brightest = *std::max_element(clean.value.begin(), clean.value.end());
  state.offset = (0.005 * brightest / mean.maxCoeff() * mean).transpose();
  FitParams params = kWAndTheLight;
  params.huber_sigmas = 1e9;
  const SceneFit fit = fit_scene(model, capture_of(model, state), truth_of(model), params);
  const Uncertainty found = examine(model, fit, params, {.profile = false});
  const Attribution attribution = attribute_w(model, forward, fit, params, found);
  const Cause& offset = cause(attribution, "offset");
  EXPECT_NEAR(fit.state.w - 1.0, offset.shift * offset.amplitude, 0.1 * std::abs(fit.state.w - 1.0) + 1e-4)
      << attribution.sentence;
  EXPECT_NEAR(offset.amplitude, 1.0, 0.1) << attribution.sentence;
  EXPECT_NEAR(offset.w_with, 1.0, 0.1 * std::abs(fit.state.w - 1.0) + 1e-4) << attribution.sentence;
}

// A veil is a share of every band's picture and its mean: free gains and offsets imitate it wholly.
TEST(Attribution, FreeGainsAndOffsetsAbsorbAVeil) {
  const ForwardParams& forward = kAsTheyAre;
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
  const ForwardParams& forward = kAsTheyAre;
  ForwardModel model(cylinders(), forward);
  const Attributed result = attributed(model, forward, capture_of(model, truth_of(model)));
  EXPECT_NEAR(result.fit.state.w, 1.0, 1e-3);
  EXPECT_EQ(result.attribution.verdict, AttributionVerdict::kNotNeeded) << result.attribution.sentence;
}

}  // namespace
}  // namespace interglow::fitting
