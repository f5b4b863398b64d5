// SPDX-License-Identifier: GPL-3.0-or-later
/// Agreement with another renderer, pixel by pixel (tests/data/mitsuba/README.md tells how its images were made and how
/// noisy they are).
#include <gtest/gtest.h>

#include <filesystem>

#include "image/spectral_exr.h"
#include "mesh/subdivide.h"
#include "mitsuba_scene.h"
#include "radiosity/direct_light.h"
#include "radiosity/solution.h"
#include "radiosity/transport.h"
#include "rendering/render.h"

namespace interglow::rendering {
namespace {

const std::filesystem::path kData = std::filesystem::path(INTERGLOW_TEST_DATA) / "mitsuba";

RenderedImages solve_and_render(const scene::Scene& scene, std::optional<int> bounces,
                                const radiosity::TransportParams& transport_params) {
  const radiosity::Elements elements = radiosity::make_elements(scene);
  const radiosity::Transport transport = radiosity::Transport::build(elements, transport_params);
  const radiosity::RowMatrix direct =
      radiosity::total(radiosity::direct_light(scene, elements, transport), elements.size(), scene.grid.size());
  const radiosity::Solution solution =
      solve(transport, scene.materials, elements.material, direct, {.bounces = bounces, .tolerance = 1e-6});
  return render(scene, elements, solution, {.gather_tolerance = 3e-3});
}

class HalfCylinders : public testing::TestWithParam<std::pair<const char*, std::optional<int>>> {};

TEST_P(HalfCylinders, AgreeWithTheOtherRenderer) {
  const auto [file, bounces] = GetParam();
  // Four quads along the axis instead of 64 triangles, on the same facets. Convex bodies do not hide each other's
  // facing sides.
  const scene::Scene scene = test::half_cylinder_strips(kData / "half_cylinders", 1, 8, true);
  const RenderedImages images = solve_and_render(scene, bounces, {.tolerance = 1e-3, .occlusion = false});
  const image::SpectralImage reference = image::read_spectral_exr(kData / "half_cylinders" / file).image;
  const test::Difference difference =
      test::compare(images.total, reference, test::inside_silhouettes(images.object, 512, 512));
  RecordProperty("rms_percent", std::to_string(100 * difference.rms));
  EXPECT_GT(difference.count, 100000U);
  EXPECT_LE(difference.rms, 0.005) << "bias " << difference.bias;
}

// The files' own standard error is 0.29 %, 0.03 % and 0.45 % of the mean; the mission asks for 0.5 %.
INSTANTIATE_TEST_SUITE_P(Mitsuba, HalfCylinders,
                         testing::Values(std::pair<const char*, std::optional<int>>{"ref_path.exr", std::nullopt},
                                         std::pair<const char*, std::optional<int>>{"ref_direct.exr", 0},
                                         std::pair<const char*, std::optional<int>>{"ref_direct_plus_1bounce.exr", 1}),
                         [](const auto& instance) {
                           const std::filesystem::path name = instance.param.first;
                           return name.stem().string();
                         });

TEST(Mitsuba, VGrooveAgrees) {
  scene::Scene scene = test::mitsuba_scene(kData / "v_groove_60", 1);
  for (scene::Object& object : scene.objects) {
    test::join_triangle_pairs(object.patches);
    object.patches = mesh::subdivide(object.patches, 2.5);
  }
  const RenderedImages images = solve_and_render(scene, std::nullopt, {.tolerance = 1e-3, .occlusion = false});
  const image::SpectralImage reference = image::read_spectral_exr(kData / "v_groove_60" / "ref_path.exr").image;
  const std::vector<char> keep = test::inside_silhouettes(images.object, 256, 256);
  // Noise of the file: 0.74 % a pixel, hence 0.74 % / 4 in blocks of 4 x 4; pixels are compared within the noise.
  const test::Difference blocks = test::compare(images.total, reference, keep, 4);
  EXPECT_LE(blocks.rms, 0.005) << "bias " << blocks.bias;
  const test::Difference pixels = test::compare(images.total, reference, keep);
  EXPECT_LE(pixels.rms, std::hypot(0.0074, 0.0025)) << "bias " << pixels.bias;
}

TEST(Mitsuba, CornellBoxAgreesInBlocks) {
  scene::Scene scene = test::mitsuba_scene(kData / "cornell", 1);
  for (scene::Object& object : scene.objects) {
    test::join_triangle_pairs(object.patches);
    // Patches that reach under the boxes mix light with darkness: the floor needs smaller ones.
    object.patches = mesh::subdivide(object.patches, object.name == "floor" ? 20.0 : 55.0);
  }
  const RenderedImages images = solve_and_render(scene, std::nullopt, {.tolerance = 1e-2});
  const image::SpectralImage reference = image::read_spectral_exr(kData / "cornell" / "ref_path.exr").image;
  std::vector<char> keep = test::inside_silhouettes(images.object, 256, 256);
  for (std::size_t p = 0; p < keep.size(); ++p) {
    // The lamp itself outshines the rest and has no noise.
    if (images.object[p] >= 0 && scene.objects[static_cast<std::size_t>(images.object[p])].emits()) keep[p] = 0;
  }
  const test::Difference blocks = test::compare(images.total, reference, keep, 8);
  EXPECT_GT(blocks.count, 700U);
  EXPECT_LE(blocks.rms, 0.01) << "bias " << blocks.bias;
}

}  // namespace
}  // namespace interglow::rendering
