// SPDX-License-Identifier: GPL-3.0-or-later
// Twenty faults are planted into the deterministic side, one at a time; the check must detect each (family-wise
// confidence 99 %), and must call the scene without a fault equal within 1 %. The path tracer runs once, with a fixed
// seed.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include "cross_check/agreement.h"
#include "cross_check/path_tracer.h"
#include "mesh/subdivide.h"
#include "verification/check_scene.h"
#include "verification/comparisons.h"
#include "verification/radiosity_run.h"

namespace interglow::verification {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;
using image::SpectralImage;
using rendering::RenderedImages;
using std::numbers::pi;

constexpr int kBands = 6;
constexpr int kSide_px = 48;
constexpr double kAgreementMargin = 0.01;
/// A fault counts as detected if it is shown to change a region by more than this, discretisation and the family of all
/// regions allowed for.
constexpr double kDetectionMargin = 0.001;

mesh::PatchMesh sheet(const Vector3d& corner, const Vector3d& u, const Vector3d& v, double edge) {
  mesh::PatchMesh mesh;
  mesh.points = {corner, corner + u, corner + u + v, corner + v};
  mesh.faces = {{0, 1, 2, 3}};
  return mesh::subdivide(mesh, edge);
}

spectral::Material paper(const char* name, double first, double last, double emission) {
  spectral::Material material{name, {VectorXd::LinSpaced(kBands, first, last), Eigen::MatrixXd::Zero(kBands, kBands)}};
  for (int excitation = 0; excitation < 2; ++excitation) {
    for (int band = excitation + 2; band < kBands; ++band) material.donaldson.luminescence(band, excitation) = emission;
  }
  return material;
}

/// A groove of two fluorescent papers, a lamp beside it, and a sheet that shows its black back.
scene::Scene groove() {
  scene::Scene scene;
  scene.grid = spectral::WavelengthGrid::uniform(400, 650, 50);
  scene.materials = {paper("green", 0.35, 0.75, 0.06), paper("red", 0.8, 0.45, 0.09)};
  const Vector3d along(0, 40, 0);
  const Vector3d left(-20, 0, 24);
  const Vector3d right(20, 0, 24);
  scene.objects.push_back({.name = "left", .patches = sheet({0, -20, 0}, along, left, 4.0), .material = 0});
  scene.objects.push_back({.name = "right", .patches = sheet({0, -20, 0}, right, along, 4.0), .material = 1});
  scene.objects.push_back(
      {.name = "back", .patches = sheet({-22, -12, 25}, {0, 24, 0}, {6, 0, 8}, 4.0), .material = 1});
  for (mesh::Face& face : scene.objects[2].patches.faces) std::swap(face[1], face[3]);
  scene.objects.push_back({.name = "lamp", .patches = sheet({24, -6, 26}, {6, 0, 10}, {0, 12, 0}, 4.0), .material = 0});
  scene.objects[3].exitance = VectorXd::LinSpaced(kBands, 2.0, 1.0);
  scene.directional_lights = {{"sun", Vector3d(0.25, 0.2, -1).normalized(), VectorXd::LinSpaced(kBands, 1.0, 1.6)}};
  scene.sky = scene::SkyLight{"sky", VectorXd::LinSpaced(kBands, 0.12, 0.08)};
  scene.camera.position = {0, -60, 240};
  scene.camera.target = {0, 0, 14};
  scene.camera.horizontal_fov_deg = 14;
  scene.camera.width = scene.camera.height = kSide_px;
  return scene;
}

const RadiosityParams kParams = {.transport = {.tolerance = 1e-4},
                                 .solve = {.tolerance = 1e-8},
                                 .render = {.samples_per_side = 16, .gather_tolerance = 2e-3}};

struct Fault {
  std::string name;
  std::function<void(scene::Scene&, RadiosityParams&)> in_scene;
  std::function<void(RenderedImages&)> in_images;
};

void for_each_value(SpectralImage& image, const std::function<float(float)>& change) {
  for (float& value : image.value) value = change(value);
}

void scale(SpectralImage& image, float factor) {
  for_each_value(image, [factor](float value) { return factor * value; });
}

/// total += (factor - 1) × component; component × factor.
void scale_component(RenderedImages& images, SpectralImage RenderedImages::*component, float factor) {
  SpectralImage& part = images.*component;
  for (std::size_t i = 0; i < part.value.size(); ++i) images.total.value[i] += (factor - 1.0F) * part.value[i];
  scale(part, factor);
}

void change_pixels(SpectralImage& image,
                   const std::function<const float*(int row, int column, const SpectralImage&)>& from) {
  const SpectralImage before = image;
  static const std::vector<float> black(kBands, 0.0F);
  for (int row = 0; row < image.height; ++row) {
    for (int column = 0; column < image.width; ++column) {
      const float* source = from(row, column, before);
      std::copy_n(source != nullptr ? source : black.data(), kBands, image.pixel(row, column));
    }
  }
}

std::vector<Fault> faults() {
  const auto scene_fault = [](std::string name, std::function<void(scene::Scene&)> change) {
    return Fault{std::move(name), [change](scene::Scene& scene, RadiosityParams&) { change(scene); }, nullptr};
  };
  const auto image_fault = [](std::string name, std::function<void(RenderedImages&)> change) {
    return Fault{std::move(name), nullptr, std::move(change)};
  };
  return {
      scene_fault("a reflectance off by 1 %", [](scene::Scene& s) { s.materials[0].donaldson.reflectance *= 1.01; }),
      scene_fault("a light turned by 0.5 degrees",
                  [](scene::Scene& s) {
                    Vector3d& direction = s.directional_lights[0].direction;
                    direction = Eigen::AngleAxisd(0.5 * pi / 180.0, Vector3d::UnitY()) * direction;
                  }),
      {"bounces beyond the second missing", [](scene::Scene&, RadiosityParams& p) { p.solve.bounces = 2; }, nullptr},
      image_fault("a component dropped", [](RenderedImages& i) { scale_component(i, &RenderedImages::rl, 0.0F); }),
      image_fault("bands shifted by one",
                  [](RenderedImages& i) {
                    for (std::size_t k = i.total.value.size() - 1; k > 0; --k) i.total.value[k] = i.total.value[k - 1];
                  }),
      scene_fault("one patch's normal flipped",
                  [](scene::Scene& s) {
                    mesh::Face& face = s.objects[0].patches.faces[s.objects[0].patches.faces.size() / 2];
                    std::swap(face[1], face[3]);
                  }),
      image_fault("self-shadowing at the contact",
                  [](RenderedImages& i) {
                    for (int row = 0; row < kSide_px; ++row) {
                      for (int column = kSide_px / 2 - 1; column <= kSide_px / 2; ++column) {
                        for (int b = 0; b < kBands; ++b) i.total.pixel(row, column)[b] -= i.re.pixel(row, column)[b];
                      }
                    }
                  }),
      image_fault("a global bias of 0.5 %", [](RenderedImages& i) { scale(i.total, 1.005F); }),
      scene_fault("swapped materials",
                  [](scene::Scene& s) { std::swap(s.objects[0].material, s.objects[1].material); }),
      image_fault("missing luminescence in the indirect light",
                  [](RenderedImages& i) {
                    scale_component(i, &RenderedImages::lr, 0.0F);
                    scale_component(i, &RenderedImages::ll, 0.0F);
                  }),
      image_fault("mirrored image",
                  [](RenderedImages& i) {
                    change_pixels(i.total, [](int row, int column, const SpectralImage& before) {
                      return before.pixel(row, kSide_px - 1 - column);
                    });
                  }),
      scene_fault("shift by half a pixel",
                  [](scene::Scene& s) {
                    const double pixel = 2.0 * std::tan(s.camera.horizontal_fov_deg * pi / 360.0) *
                                         (s.camera.target - s.camera.position).norm() / kSide_px;
                    s.camera.position.x() += 0.5 * pixel;
                    s.camera.target.x() += 0.5 * pixel;
                  }),
      image_fault("unit wrong by a factor of pi", [](RenderedImages& i) { scale(i.total, static_cast<float>(pi)); }),
      scene_fault("sky missing", [](scene::Scene& s) { s.sky.reset(); }),
      scene_fault("back face lit", [](scene::Scene& s) { s.objects[2].sides = scene::Sides::kTwo; }),
      image_fault("one tile black",
                  [](RenderedImages& i) {
                    change_pixels(i.total, [](int row, int column, const SpectralImage& before) -> const float* {
                      return row / 12 == 2 && column / 12 == 1 ? nullptr : before.pixel(row, column);
                    });
                  }),
      scene_fault("field of view off by 0.5 %", [](scene::Scene& s) { s.camera.horizontal_fov_deg *= 1.005; }),
      scene_fault("an emitter counted twice", [](scene::Scene& s) { s.objects[3].exitance *= 2.0; }),
      image_fault(
          "rows of form factors 0.5 % too large",
          [](RenderedImages& i) {
            for (auto component : {&RenderedImages::rr, &RenderedImages::lr, &RenderedImages::ll, &RenderedImages::rl})
              scale_component(i, component, 1.005F);
          }),
      image_fault("gamma of 0.99",
                  [](RenderedImages& i) {
                    const float white = *std::max_element(i.total.value.begin(), i.total.value.end());
                    for_each_value(i.total, [white](float v) { return white * std::pow(v / white, 0.99F); });
                  }),
  };
}

struct Runs {
  RadiosityRun coarse, fine;
};

Runs run(const scene::Scene& scene, const RadiosityParams& params) {
  return {run_radiosity(scene, params), run_radiosity(halved(scene), params)};
}

Runs planted(const Fault& fault, const scene::Scene& truth, const Runs& sound) {
  if (fault.in_images) {
    Runs runs = sound;
    fault.in_images(runs.coarse.images);
    fault.in_images(runs.fine.images);
    return runs;
  }
  scene::Scene scene = truth;
  RadiosityParams params = kParams;
  fault.in_scene(scene, params);
  return run(scene, params);
}

cross_check::Agreement judged(const Runs& runs, const cross_check::PathTracer& tracer, const scene::Scene& truth,
                              double margin) {
  auto comparisons = compare_channels(runs.fine.images, &runs.coarse.images, tracer, truth, {});
  // Ten times the samples would be needed for the bound; what it is good for is tested with the statistics.
  comparisons.front().largest_possible_sample.reset();
  return cross_check::judge(comparisons, {.margin = margin, .tiles_per_side = 4});
}

std::string listed(const cross_check::RegionResult& region) {
  return fmt::format("{}, {}: {:.3f} % ± {:.3f} %, discretisation {:.3f} %", region.channel, region.region,
                     100 * region.relative_difference, 100 * region.half_width, 100 * region.discretisation);
}

TEST(PlantedFaults, EachIsDetectedAndTheSoundSceneAgrees) {
  const scene::Scene truth = groove();
  cross_check::PathTracer tracer(truth, {.samples_per_batch = 64, .seed = 4});
  tracer.add_batches(48);
  const Runs sound = run(truth, kParams);
  for (const cross_check::RegionResult& region : judged(sound, tracer, truth, kAgreementMargin).regions) {
    EXPECT_EQ(region.verdict, cross_check::Verdict::kAgrees) << listed(region);
  }
  for (const cross_check::RegionResult& region : judged(sound, tracer, truth, kDetectionMargin).regions) {
    EXPECT_NE(region.verdict, cross_check::Verdict::kDisagrees) << listed(region);
  }
  ASSERT_EQ(faults().size(), 20U);
  for (const Fault& fault : faults()) {
    const auto found = judged(planted(fault, truth, sound), tracer, truth, kDetectionMargin);
    EXPECT_EQ(found.verdict, cross_check::Verdict::kDisagrees) << fault.name;
  }
}

}  // namespace
}  // namespace interglow::verification
