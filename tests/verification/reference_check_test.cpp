// SPDX-License-Identifier: GPL-3.0-or-later
// Both methods against a picture of another renderer (tests/data/mitsuba/README.md), through the same steps as
// `interglow cross-check --reference`.
#include <gtest/gtest.h>

#include <filesystem>
#include <optional>

#include "../rendering/mitsuba_scene.h"
#include "scene/scene_builder.h"
#include "verification/check_scene.h"
#include "verification/cross_check_run.h"
#include "verification/reference_image.h"

namespace interglow::verification {
namespace {

using cross_check::RegionResult;
using cross_check::Verdict;

const std::filesystem::path kGroove = std::filesystem::path(INTERGLOW_TEST_DATA) / "mitsuba" / "v_groove_60";
constexpr int kSide_px = 64;

scene::Scene groove() {
  scene::SceneDescription description = scene::read_scene_file(kGroove / "scene.toml");
  for (scene::ObjectDescription& object : description.objects) object.subdivide_mm = 5.0;
  return check_scene(scene::build_scene(description).scene, kSide_px);
}

ReferenceImage reference(int side_px) {
  return read_reference(kGroove / "ref_path.exr", kGroove / "ref_path_stderr.exr", side_px);
}

CrossCheckParams params_with(int tiles_per_side) {
  CrossCheckParams params;
  params.agreement.tiles_per_side = tiles_per_side;
  params.radiosity.transport = {.tolerance = 1e-4, .occlusion = false};
  params.radiosity.render.samples_per_side = 16;
  params.time_limit_s = 1e6;  // samples are added until all is decided
  return params;
}

std::string listed(const CrossCheck& check) {
  std::string text;
  for (const RegionResult& region : check.agreement.regions) {
    text += region.region + ": " + std::to_string(region.relative_difference) + " +- " +
            std::to_string(region.standard_error) + ", " + name(region.verdict) + "\n";
  }
  return text;
}

TEST(ReferenceCheck, RadiosityAgreesByTile) {
  const CrossCheck check = cross_check_reference(groove(), reference(kSide_px), Method::kRadiosity, params_with(4));
  EXPECT_EQ(check.verdict, Verdict::kAgrees) << listed(check);
  EXPECT_EQ(check.agreement.regions.size(), 17U);
  EXPECT_TRUE(check.discretisation_note.empty()) << check.discretisation_note;
}

// z of a pixel has Student's distribution; over 2,000 pixels and more its root mean square is within 8 % of its
// expected value except with probability 1e-6 (normal: 1 ± 4.9 / sqrt(2 n) = 1 ± 0.077).
TEST(ReferenceCheck, PathTracerAgreesAndDiffersByNoiseAlone) {
  const CrossCheck check = cross_check_reference(groove(), reference(kSide_px), Method::kPathTracer, params_with(2));
  EXPECT_EQ(check.verdict, Verdict::kAgrees) << listed(check);
  EXPECT_FALSE(check.agreement.difference_detected) << listed(check);
  EXPECT_GT(check.diagnosis.judged_pixels, 2000);
  EXPECT_NEAR(check.diagnosis.z_rms, 1.0, 0.08);
}

// The groove's standard errors come from eight seeds, and few paths meet the other side from its upper edges. Where the
// picture has no error of its own, z scatters as by chance (1.02 with the standard error of a pixel averaged with those
// around it); 0.9 to 1.2 leaves room for an own error of half the reference's noise.
void expect_z_by_chance(const CrossCheck& check, int pixels) {
  EXPECT_EQ(check.verdict, Verdict::kAgrees) << listed(check);
  EXPECT_GT(check.diagnosis.judged_pixels, pixels);
  EXPECT_GT(check.diagnosis.z_rms, 0.9);
  EXPECT_LT(check.diagnosis.z_rms, 1.2);
  EXPECT_LT(check.diagnosis.significant_pixels, pixels / 1000);
}

class PicturesDifferByNoiseAlone : public testing::TestWithParam<Method> {};

TEST_P(PicturesDifferByNoiseAlone, Groove) {
  CrossCheckParams params = params_with(1);
  params.samples_per_batch = 4;
  expect_z_by_chance(cross_check_reference(groove(), reference(256), GetParam(), params), 40000);
}

// Direct light is almost without noise in the reference, so that a pixel's facets must have their shares to 1e-4.
TEST_P(PicturesDifferByNoiseAlone, HalfCylinders) {
  const std::filesystem::path shared = std::filesystem::path(INTERGLOW_SHARED_DATA) / "mitsuba/half_cylinders";
  if (!std::filesystem::exists(shared / "ref_path_stderr.exr")) GTEST_SKIP() << shared << " is not there";
  const std::filesystem::path here = std::filesystem::path(INTERGLOW_TEST_DATA) / "mitsuba/half_cylinders";
  const ReferenceImage image = read_reference(shared / "ref_path.exr", shared / "ref_path_stderr.exr", std::nullopt);
  CrossCheckParams params = params_with(1);
  params.radiosity.transport.tolerance = 1e-3;
  params.most_halved_patches = 0;
  params.radiosity.render.samples_per_side = 10;
  params.samples_per_batch = 1;
  scene::Scene strips = test::half_cylinder_strips(here, 1, 2, true);
  for (scene::Object& object : strips.objects) object.sides = scene::Sides::kOne;
  expect_z_by_chance(cross_check_reference(strips, image, GetParam(), params), 75000);
}

INSTANTIATE_TEST_SUITE_P(ReferenceCheck, PicturesDifferByNoiseAlone,
                         testing::Values(Method::kRadiosity, Method::kPathTracer), [](const auto& instance) {
                           return instance.param == Method::kRadiosity ? "Radiosity" : "PathTracer";
                         });

// Interreflection amplifies 1 % of reflectance, so the whole picture differs by more than the margin, whatever the
// patches.
TEST(ReferenceCheck, AReflectanceOffByOnePercentIsFound) {
  scene::Scene scene = groove();
  for (spectral::Material& material : scene.materials) material.donaldson.reflectance *= 0.99;
  CrossCheckParams params = params_with(1);
  params.most_halved_patches = 0;
  const CrossCheck check = cross_check_reference(scene, reference(kSide_px), Method::kRadiosity, params);
  EXPECT_EQ(check.verdict, Verdict::kDisagrees) << listed(check);
}

// The reference's standard error is made so large that no number of our paths decides: 32 batches, and no more.
TEST(ReferenceCheck, SamplingEndsWhereTheReferenceIsTooNoisy) {
  ReferenceImage noisy = reference(32);
  for (float& error : noisy.standard_error->value) error *= 100.0F;
  const CrossCheck check = cross_check_reference(check_scene(groove(), 32), noisy, Method::kPathTracer, params_with(2));
  EXPECT_EQ(check.verdict, Verdict::kUndecided);
  EXPECT_TRUE(check.reference_limits);
  EXPECT_EQ(check.batches, 32);
}

// Where halving would take too long the error is estimated: of the same size as what halving changes. The groove's
// coarse patches change by a few parts in 10,000; the estimate is made twice over.
TEST(ReferenceCheck, DiscretisationIsEstimatedWhereItIsNotMeasured) {
  CrossCheckParams params = params_with(1);
  const CrossCheck measured = cross_check_reference(groove(), reference(kSide_px), Method::kRadiosity, params);
  params.most_halved_patches = 0;
  const CrossCheck estimated = cross_check_reference(groove(), reference(kSide_px), Method::kRadiosity, params);
  EXPECT_EQ(estimated.coarser_run(), nullptr);
  ASSERT_NE(estimated.coarser_images(), nullptr);
  const double halving = measured.agreement.regions.at(0).discretisation;
  const double estimate = estimated.agreement.regions.at(0).discretisation;
  EXPECT_GT(estimate, 0.25 * halving) << halving;
  EXPECT_LT(estimate, 10.0 * halving) << halving;
  EXPECT_EQ(estimated.verdict, Verdict::kAgrees) << listed(estimated);
}

TEST(ReferenceCheck, NoVerdictWithoutTheReferencesError) {
  ReferenceImage without_error = reference(32);
  without_error.standard_error.reset();
  const CrossCheck check =
      cross_check_reference(check_scene(groove(), 32), without_error, Method::kPathTracer, params_with(1));
  EXPECT_EQ(check.verdict, Verdict::kUndecided);
}

}  // namespace
}  // namespace interglow::verification
