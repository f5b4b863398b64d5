// SPDX-License-Identifier: GPL-3.0-or-later
/// Agreement with another renderer, pixel by pixel (tests/data/mitsuba/README.md tells how its images were made and how
/// noisy they are).
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <random>
#include <vector>

#include "image/spectral_exr.h"
#include "mesh/subdivide.h"
#include "mitsuba_scene.h"
#include "radiosity/direct_light.h"
#include "radiosity/solution.h"
#include "radiosity/transport.h"
#include "rendering/render.h"
#include "scene/scene_builder.h"

namespace interglow::rendering {
namespace {

using Eigen::Vector2d;

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

/// The scene files beside the images say what camera.json says (which mitsuba_scene reads by itself).
TEST(Mitsuba, SceneFilesSayTheSame) {
  for (const char* name : {"half_cylinders", "v_groove_60", "cornell"}) {
    SCOPED_TRACE(name);
    const scene::Scene wanted = test::mitsuba_scene(kData / name, 1);
    const scene::Scene built = scene::build_scene(scene::read_scene_file(kData / name / "scene.toml")).scene;
    EXPECT_EQ(built.camera.position, wanted.camera.position);
    EXPECT_EQ(built.camera.target, wanted.camera.target);
    EXPECT_EQ(built.camera.up, wanted.camera.up);
    EXPECT_DOUBLE_EQ(built.camera.horizontal_fov_deg, wanted.camera.horizontal_fov_deg);
    EXPECT_EQ(built.camera.width, wanted.camera.width);
    EXPECT_EQ(built.camera.height, wanted.camera.height);
    ASSERT_EQ(built.directional_lights.size(), wanted.directional_lights.size());
    for (std::size_t l = 0; l < wanted.directional_lights.size(); ++l) {
      EXPECT_LT((built.directional_lights[l].direction - wanted.directional_lights[l].direction).norm(), 1e-12);
      EXPECT_EQ(built.directional_lights[l].normal_irradiance, wanted.directional_lights[l].normal_irradiance);
    }
    ASSERT_EQ(built.objects.size(), wanted.objects.size());
    for (const scene::Object& object : built.objects) {
      SCOPED_TRACE(object.name);
      const auto is_it = [&](const scene::Object& other) { return other.name == object.name; };
      const auto other = std::find_if(wanted.objects.begin(), wanted.objects.end(), is_it);
      ASSERT_NE(other, wanted.objects.end());
      EXPECT_EQ(built.materials[static_cast<std::size_t>(object.material)].donaldson.reflectance,
                wanted.materials[static_cast<std::size_t>(other->material)].donaldson.reflectance);
      ASSERT_EQ(object.emits(), other->emits());
      if (object.emits()) {
        EXPECT_NEAR(object.exitance[0], other->exitance[0], 1e-12);
      }
      // The floor of the file lacks what lies under the boxes.
      const auto hidden_mm2 = [](const std::vector<Vector2d>& quad) {
        return 0.5 * std::abs((quad[2] - quad[0]).x() * (quad[3] - quad[1]).y() -
                              (quad[2] - quad[0]).y() * (quad[3] - quad[1]).x());
      };
      const bool around_boxes = object.name == "floor";
      const double under_boxes = around_boxes ? hidden_mm2({{290, 114}, {240, 272}, {82, 225}, {130, 65}}) +
                                                    hidden_mm2({{423, 247}, {472, 406}, {314, 456}, {265, 296}})
                                              : 0.0;
      const double area = mesh::total_area(other->patches);
      EXPECT_NEAR(mesh::total_area(object.patches), area - under_boxes, 1e-9 * area);
    }
  }
}

class HalfCylinders : public testing::TestWithParam<std::pair<const char*, std::optional<int>>> {};

TEST_P(HalfCylinders, AgreeWithTheOtherRenderer) {
  const auto [file, bounces] = GetParam();
  // The files' own triangles, joined in pairs to quads, with end caps that neither camera nor light sees.
  const scene::Scene scene = test::half_cylinder_strips(kData / "half_cylinders", 1, 1, true);
  const RenderedImages images = solve_and_render(scene, bounces, {.tolerance = 1e-3});
  const image::SpectralImage reference = image::read_spectral_exr(kData / "half_cylinders" / file).image;
  const test::Difference difference =
      test::compare(images.total, reference, test::inside_silhouettes(images.object, 512, 512));
  RecordProperty("rms_percent", std::to_string(100 * difference.rms));
  EXPECT_GT(difference.count, 100000U);
  EXPECT_LE(difference.rms, 0.005) << "bias " << difference.bias;
}

// The files' own standard error is 0.29 %, 0.03 % and 0.45 % of the mean; 0.5 % is wanted.
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
  const RenderedImages images = solve_and_render(scene, std::nullopt, {.tolerance = 1e-3});
  const image::SpectralImage reference = image::read_spectral_exr(kData / "v_groove_60" / "ref_path.exr").image;
  const std::vector<char> keep = test::inside_silhouettes(images.object, 256, 256);
  const test::Difference difference = test::compare(images.total, reference, keep);
  EXPECT_GT(difference.count, 30000U);
  // The file's own standard error is 0.735 % of the mean: 0.5 % is asked of what remains beyond it. Pixels are
  // independent, so that this is known to a few hundredths of a percent; a sound picture fails with less than 1 %.
  const image::SpectralImage standard_error =
      image::read_spectral_exr(kData / "v_groove_60" / "ref_path_stderr.exr").image;
  const test::OwnDifference own = test::own_difference(images.total, reference, standard_error, keep);
  RecordProperty("rms_percent", std::to_string(100 * difference.rms));
  RecordProperty("own_rms_bound_percent", std::to_string(100 * own.bound));
  EXPECT_LE(own.bound, 0.005) << "own RMS " << own.rms << ", raw RMS " << difference.rms << ", bias "
                              << difference.bias;
  // Noise shrinks to a quarter in blocks of 4 x 4 pixels, where the raw difference says the same.
  const test::Difference blocks = test::compare(images.total, reference, keep, 4);
  EXPECT_LE(blocks.rms, 0.005) << "bias " << blocks.bias;
}

/// A deviation of 0.5 % between neighbours, hidden in noise of 0.74 %, is found and measured.
TEST(Mitsuba, OwnDifferenceSeesThroughTheNoise) {
  const int side = 256;
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  image::SpectralImage picture{.width = side,
                               .height = side,
                               .wavelength_nm = Eigen::VectorXd::Constant(1, 500.0),
                               .value = std::vector<float>(static_cast<std::size_t>(side * side))};
  image::SpectralImage reference = picture;
  image::SpectralImage standard_error = picture;
  for (int row = 0; row < side; ++row) {
    for (int column = 0; column < side; ++column) {
      picture.pixel(row, column)[0] = static_cast<float>((row + column) % 2 == 0 ? 1.005 : 0.995);
      reference.pixel(row, column)[0] = static_cast<float>(1.0 + 0.0074 * normal(random));
      standard_error.pixel(row, column)[0] = 0.0074F;
    }
  }
  const test::OwnDifference own = test::own_difference(picture, reference, standard_error,
                                                       std::vector<char>(static_cast<std::size_t>(side * side), 1));
  EXPECT_NEAR(own.rms, 0.005, 0.0003);
  EXPECT_GT(own.bound, own.rms);
  EXPECT_LT(own.bound, 0.0056);
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
