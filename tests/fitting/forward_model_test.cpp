// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/forward_model.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <numeric>

#include "diagnostics/error.h"
#include "fit_scenes.h"
#include "radiosity/direct_light.h"
#include "rendering/render.h"

namespace interglow::fitting {
namespace {

using Eigen::Index;
using Eigen::VectorXd;
using radiosity::RowMatrix;

rendering::RenderedImages rendered(const scene::Scene& scene) {
  const radiosity::Elements elements = radiosity::make_elements(scene);
  const auto transport = radiosity::Transport::build(elements, {});
  const auto direct =
      radiosity::total(radiosity::direct_light(scene, elements, transport), elements.size(), scene.grid.size());
  const auto solution = radiosity::solve(transport, scene.materials, elements.material, direct, {});
  return rendering::render(scene, elements, solution, {.samples_per_side = 8, .gather_tolerance = 1e-4});
}

/// Pixels whose eight neighbours show the same object: no silhouette and no contact runs through them.
std::vector<char> inner_pixels(const std::vector<int>& object, int width, int height) {
  std::vector<char> inner(object.size(), 0);
  for (int row = 1; row + 1 < height; ++row) {
    for (int column = 1; column + 1 < width; ++column) {
      const int own = object[static_cast<std::size_t>(row * width + column)];
      bool same = own >= 0;
      for (int k = 0; k < 9; ++k)
        same = same && object[static_cast<std::size_t>((row + k / 3 - 1) * width + column + k % 3 - 1)] == own;
      inner[static_cast<std::size_t>(row * width + column)] = same ? 1 : 0;
    }
  }
  return inner;
}

struct Difference {
  double rms = 0.0;   ///< relative
  double mean = 0.0;  ///< relative difference of the sums
};

/// Over the pixels that count; empty: all.
Difference difference(const image::SpectralImage& a, const image::SpectralImage& b, const std::vector<char>& counts) {
  double sum_a = 0.0, sum_b = 0.0, square = 0.0, square_b = 0.0;
  for (std::size_t i = 0; i < a.value.size(); ++i) {
    if (!counts.empty() && !counts[i / static_cast<std::size_t>(a.bands())]) continue;
    const auto va = static_cast<double>(a.value[i]);
    const auto vb = static_cast<double>(b.value[i]);
    sum_a += va;
    sum_b += vb;
    square += (va - vb) * (va - vb);
    square_b += vb * vb;
  }
  return {std::sqrt(square / square_b), sum_a / sum_b - 1.0};
}

class ForwardModelOf : public testing::TestWithParam<const char*> {
 protected:
  static scene::Scene scene(int side_px, double half_angle_deg = 0.0, int around = 16) {
    const test::FitSceneParams params{.around = around, .along = around / 2, .side_px = side_px};
    scene::Scene result =
        std::string(GetParam()) == "arch" ? test::arch_on_plane(params) : test::half_cylinders(params);
    result.directional_lights[0].half_angle_rad = half_angle_deg * std::numbers::pi / 180.0;
    return result;
  }
};

TEST_P(ForwardModelOf, AgreesWithTheRendererOnTheSameMesh) {
  // Independent: rays instead of exact areas, adaptive gathers instead of fixed points, all bands instead of modes.
  // Edges of shadows err by 1/64 of the contrast in the renderer's 8 x 8 rays; silhouettes and contacts are left out.
  // The renderer needs faces that follow contacts, too; it sees flat ones.
  const ForwardModel model(fit_mesh(this->scene(48), {.most_turn_deg = 90.0, .contact_halvings = 1}),
                           {.mesh = std::nullopt});
  const FitState state = model.initial_state();
  const rendering::RenderedImages images = rendered(model.scene());
  const image::SpectralImage ours = picture(model, state, model.evaluate(state, {}));
  const Difference d = difference(ours, images.total, inner_pixels(images.object, 48, 48));
  EXPECT_LT(d.rms, 5e-3) << "mean " << d.mean;
  EXPECT_LT(std::abs(d.mean), 1e-3) << "rms " << d.rms;
}

/// Picture of the channels in all bands, one row: what residuals see.
VectorXd values(const ForwardModel& model, const RowMatrix& channels) {
  const RowMatrix bands = channels * model.palette();
  return Eigen::Map<const VectorXd>(bands.data(), bands.size());
}

void check_derivatives(const ForwardModel& model, const FitState& state, double least_cosine, double norm_error) {
  const int count = shared_count(model.scene());
  std::vector<int> wanted(static_cast<std::size_t>(count));
  std::iota(wanted.begin(), wanted.end(), 0);
  const Evaluation evaluation = model.evaluate(state, wanted);
  for (int k = 0; k < count; ++k) {
    // Steps that move the picture by a few hundredths of a pixel, a shadow likewise.
    const double unit = k <= kLightV       ? 2e-3
                        : k <= kTurnZ      ? 5e-4
                        : k <= kShiftZ     ? 2e-2
                        : k == kFocal      ? 5e-4
                        : k <= kPrincipalY ? 1e-2
                        : k == kDistortion ? 2e-2
                                           : 1e-2;
    const auto central = [&](double step) {
      VectorXd delta = VectorXd::Zero(count);
      delta[k] = step;
      const VectorXd ahead = values(model, model.evaluate(moved(state, delta), {}).channels);
      const VectorXd behind = values(model, model.evaluate(moved(state, -delta), {}).channels);
      return VectorXd((ahead - behind) / (2.0 * step));
    };
    const VectorXd truth = (4.0 * central(0.5 * unit) - central(unit)) / 3.0;  // Richardson
    const VectorXd ours = values(model, evaluation.derivative[static_cast<std::size_t>(k)]);
    const double cosine = ours.dot(truth) / (ours.norm() * truth.norm());
    EXPECT_GT(cosine, least_cosine) << parameter_name(model.scene(), state, k);
    EXPECT_NEAR(ours.norm() / truth.norm(), 1.0, norm_error) << parameter_name(model.scene(), state, k);
  }
}

TEST_P(ForwardModelOf, DerivativesMeetRichardsonDifferencesUnderAWideSource) {
  const ForwardModel model(this->scene(16, 2.0, 6), {.mesh = std::nullopt});
  FitState state = model.initial_state();
  state.blur_px = 0.8;
  state.w = 1.2;
  state.scale << 0.95, 1.03;
  state.raise << 0.03, -0.02;
  state.camera.distortion = 0.05;
  check_derivatives(model, state, 0.9999, 2e-3);
}

TEST_P(ForwardModelOf, DerivativesMeetRichardsonDifferencesWithSharpShadows) {
  const ForwardModel model(this->scene(24, 0.0, 12), {.mesh = std::nullopt});
  FitState state = model.initial_state();
  state.blur_px = 0.8;
  check_derivatives(model, state, 0.999, 1e-2);
}

INSTANTIATE_TEST_SUITE_P(Scenes, ForwardModelOf, testing::Values("half_cylinders", "arch"));

TEST(ForwardModel, CompactSpectraCarryTheWholeSolve) {
  // A bispectral solve in all bands against one on the modes: differences are what the modes leave out.
  const scene::Scene scene = test::half_cylinders({.around = 8, .along = 4, .side_px = 24});
  ForwardModel fine(scene, {.mesh = std::nullopt, .spectral_tolerance = 1e-9});
  ForwardModel coarse(scene, {.mesh = std::nullopt, .spectral_tolerance = 1e-5});
  const FitState state = fine.initial_state();
  const Difference d = difference(picture(coarse, state, coarse.evaluate(state, {})),
                                  picture(fine, state, fine.evaluate(state, {})), {});
  EXPECT_LT(coarse.spectra().modes(), fine.spectra().modes());
  EXPECT_LT(d.rms, 1e-5);
}

TEST(ForwardModel, IndirectLightGrowsWithTheFactorAlone) {
  const scene::Scene scene = test::half_cylinders({.around = 8, .along = 4, .side_px = 24});
  const ForwardModel model(scene, {.mesh = std::nullopt});
  FitState state = model.initial_state();
  const Evaluation one = model.evaluate(state, {});
  state.w = 1.5;
  const Evaluation more = model.evaluate(state, {});
  EXPECT_LT((more.channels - one.direct - 1.5 * (one.channels - one.direct)).cwiseAbs().maxCoeff(),
            1e-12 * one.channels.cwiseAbs().maxCoeff());
}

TEST(ForwardModel, CoverageSumsToTheAreaOfASquareInThePicture) {
  // A square of 60 mm seen straight on from 300 mm at 1 mm a pixel: 60² pixels, whatever its patches.
  scene::Scene scene = test::single_plane({.around = 7, .side_px = 100});
  scene.camera.position = {0.3, 0.2, 300.0};
  scene.camera.target = {0.3, 0.2, 0.0};
  scene.camera.horizontal_fov_deg = 2.0 * std::atan(50.0 / 300.0) * 180.0 / std::numbers::pi;
  const ForwardModel model(scene, {});
  const FitState state = model.initial_state();
  EXPECT_NEAR(model.evaluate(state, {}).coverage.sum(), 3600.0, 1e-6);
}

TEST(ForwardModel, ScenesWithOtherLightsAreRefused) {
  scene::Scene scene = test::single_plane({.around = 2, .side_px = 8});
  scene.directional_lights.push_back(scene.directional_lights[0]);
  try {
    const ForwardModel model(scene, {});
    FAIL() << "two lights were taken";
  } catch (const InvalidInput& error) {
    EXPECT_NE(std::string(error.what()).find("2 directional lights"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace interglow::fitting
