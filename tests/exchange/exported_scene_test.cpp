// SPDX-License-Identifier: GPL-3.0-or-later
// An exported scene is read back by each renderer's own rules into a scene of ours, and both are traced: the pictures
// must be the same within the path tracer's error. Blocks of the picture at most 5 standard errors apart (48 of them
// three times: chance 1e-4), with fixed seeds, and no wider than 1 %.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <numbers>

#include "cross_check/path_tracer.h"
#include "exchange/renderer_export.h"
#include "mesh/scan_file.h"
#include "spectral/observer.h"
#include "tests/exchange/renderer_files.h"
#include "tests/temporary_folder.h"

namespace interglow::exchange {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;
using std::numbers::pi;

constexpr int kBands = 4;

spectral::WavelengthGrid bands() { return spectral::WavelengthGrid::uniform(400, 700, 100); }

mesh::PatchMesh parallelogram(const Vector3d& corner, const Vector3d& u, const Vector3d& v) {
  mesh::PatchMesh mesh;
  mesh.points = {corner, corner + u, corner + u + v, corner + v};
  mesh.faces = {{0, 1, 2, 3}};
  return mesh;
}

/// A corner of two coloured sheets and a floor with a block, nothing of it symmetric, so that a turned or mirrored
/// picture is another one; a lamp, a sun and a sky. All sheets reflect on both sides, and the lamp on none, since pbrt
/// has no black backs.
scene::Scene corner() {
  scene::Scene scene;
  scene.grid = bands();
  const auto material = [](const char* name, double first, double last) {
    return spectral::Material{name, {VectorXd::LinSpaced(kBands, first, last), Eigen::MatrixXd::Zero(kBands, kBands)}};
  };
  scene.materials = {material("white", 0.8, 0.7), material("red", 0.1, 0.8), material("green", 0.5, 0.2),
                     material("black", 0.0, 0.0)};
  const auto add = [&](const char* name, int index, const Vector3d& at, const Vector3d& u, const Vector3d& v) {
    scene::Object object{.name = name};
    object.patches = parallelogram(at, u, v);
    object.material = index;
    object.sides = scene::Sides::kTwo;
    scene.objects.push_back(object);
  };
  add("floor", 0, {0, 0, 0}, {60, 0, 0}, {0, 50, 0});
  add("left", 1, {0, 0, 0}, {0, 50, 0}, {0, 0, 40});
  add("back", 2, {0, 50, 0}, {60, 0, 0}, {0, 0, 30});
  add("block", 0, {30, 20, 0}, {12, 6, 0}, {2, -1, 18});
  add("lamp", 3, {20, 10, 45}, {0, 12, 0}, {15, 0, 0});  // looks down
  scene.objects.back().sides = scene::Sides::kOne;
  scene.objects.back().exitance = VectorXd::LinSpaced(kBands, 4.0, 2.0);
  scene.directional_lights = {{"sun", Vector3d(-1, 2, -2) / 3.0, VectorXd::LinSpaced(kBands, 0.5, 1.0), 0.0}};
  scene.sky = scene::SkyLight{"sky", VectorXd::LinSpaced(kBands, 0.2, 0.05)};
  scene.camera.position = {70, -60, 50};
  scene.camera.target = {25, 25, 8};
  scene.camera.up = {0.1, 0, 1};
  scene.camera.horizontal_fov_deg = 42;
  scene.camera.width = 48;
  scene.camera.height = 32;
  return scene;
}

/// Values at the centres of the bands, linear between the nodes.
VectorXd at_bands(const SpectrumNodes& nodes, double factor = 1.0) {
  const spectral::WavelengthGrid grid = bands();
  VectorXd values(kBands);
  for (int band = 0; band < kBands; ++band) {
    const double wavelength = grid.center_nm(band);
    std::size_t i = 1;
    while (i + 1 < nodes.first.size() && nodes.first[i] < wavelength) ++i;
    const double t = (wavelength - nodes.first[i - 1]) / (nodes.first[i] - nodes.first[i - 1]);
    values[band] = factor * ((1.0 - t) * nodes.second[i - 1] + t * nodes.second[i]);
  }
  return values;
}

mesh::PatchMesh read_patches(const std::filesystem::path& file) {
  const mesh::TriangleMesh read = mesh::read_scan(file).mesh;
  mesh::PatchMesh patches;
  patches.points = read.points;
  for (const auto& [a, b, c] : read.triangles) patches.faces.push_back({a, b, c, -1});
  return patches;
}

void add_object(scene::Scene& scene, mesh::PatchMesh patches, const VectorXd& reflectance, bool two_sided,
                const VectorXd& exitance) {
  scene::Object object{.name = std::to_string(scene.objects.size())};
  object.patches = std::move(patches);
  object.material = static_cast<int>(scene.materials.size());
  object.sides = two_sided ? scene::Sides::kTwo : scene::Sides::kOne;
  object.exitance = exitance;
  scene.objects.push_back(object);
  scene.materials.push_back({object.name, {reflectance, Eigen::MatrixXd::Zero(kBands, kBands)}});
}

scene::Scene read_mitsuba(const std::filesystem::path& file) {
  pugi::xml_document document;
  if (!document.load_file(file.c_str())) throw std::runtime_error("not XML: " + file.string());
  const pugi::xml_node root = document.child("scene");
  const auto named = [](const pugi::xml_node& node, std::initializer_list<const char*> names) {
    for (const char* name : names) {
      if (const pugi::xml_node found = node.find_child_by_attribute("name", name)) return found;
    }
    throw std::runtime_error(std::string("no ") + *names.begin());
  };
  scene::Scene scene;
  scene.grid = bands();
  const pugi::xml_node sensor = root.child("sensor");
  const pugi::xml_node lookat = named(sensor, {"to_world", "toWorld"}).child("lookat");
  scene.camera.position = vector(lookat.attribute("origin").value());
  scene.camera.target = vector(lookat.attribute("target").value());
  scene.camera.up = vector(lookat.attribute("up").value());
  EXPECT_STREQ(named(sensor, {"fov_axis", "fovAxis"}).attribute("value").value(), "x");
  scene.camera.horizontal_fov_deg = named(sensor, {"fov"}).attribute("value").as_double();
  scene.camera.width = named(sensor.child("film"), {"width"}).attribute("value").as_int();
  scene.camera.height = named(sensor.child("film"), {"height"}).attribute("value").as_int();
  for (const pugi::xml_node& emitter : root.children("emitter")) {
    const VectorXd spectrum = at_bands(mitsuba_nodes(emitter.child("spectrum")));
    if (std::string(emitter.attribute("type").value()) == "constant") {
      scene.sky = scene::SkyLight{"sky", spectrum};
      continue;
    }
    const pugi::xml_node way = emitter.child("vector");
    const Vector3d direction(way.attribute("x").as_double(), way.attribute("y").as_double(),
                             way.attribute("z").as_double());
    scene.directional_lights.push_back({"beam", direction.normalized(), spectrum, 0.0});
  }
  for (const pugi::xml_node& shape : root.children("shape")) {
    pugi::xml_node bsdf = shape.child("bsdf");
    const bool two_sided = std::string(bsdf.attribute("type").value()) == "twosided";
    if (two_sided) bsdf = bsdf.child("bsdf");
    const pugi::xml_node emitter = shape.child("emitter");
    add_object(scene, read_patches(file.parent_path() / named(shape, {"filename"}).attribute("value").value()),
               at_bands(mitsuba_nodes(bsdf.child("spectrum"))), two_sided,
               emitter ? at_bands(mitsuba_nodes(emitter.child("spectrum")), pi) : VectorXd());
  }
  return scene;
}

/// pbrt divides a light's spectrum by the sum of ȳ L over whole nanometres and multiplies it by "scale".
VectorXd pbrt_light(const Statement& light) {
  const SpectrumNodes nodes = pbrt_nodes(light.values.at("spectrum L"));
  const auto fine = spectral::WavelengthGrid::uniform(360, 830, 1);
  const VectorXd y = spectral::cie1931_weights(fine).col(1);
  double luminance = 0.0;
  for (Eigen::Index i = 0; i < fine.size(); ++i) {
    const double wavelength = fine.center_nm(i);
    for (std::size_t k = 1; k < nodes.first.size(); ++k) {
      if (wavelength < nodes.first[k - 1] || wavelength > nodes.first[k]) continue;
      const double t = (wavelength - nodes.first[k - 1]) / (nodes.first[k] - nodes.first[k - 1]);
      luminance += y[i] * ((1.0 - t) * nodes.second[k - 1] + t * nodes.second[k]);
      break;
    }
  }
  return at_bands(nodes, std::stod(light.values.at("float scale")) / luminance);
}

scene::Scene read_pbrt_scene(const std::filesystem::path& file) {
  scene::Scene scene;
  scene.grid = bands();
  std::array<double, 3> scale{1, 1, 1};
  double fov_deg = 0.0;
  VectorXd reflectance, exitance;
  for (const Statement& one : read_pbrt(file)) {
    if (one.name == "Scale") std::copy_n(one.plain.begin(), 3, scale.begin());
    if (one.name == "LookAt") {
      scene.camera.position = {one.plain[0], one.plain[1], one.plain[2]};
      scene.camera.target = {one.plain[3], one.plain[4], one.plain[5]};
      scene.camera.up = {one.plain[6], one.plain[7], one.plain[8]};
    }
    if (one.name == "Camera") fov_deg = std::stod(one.values.at("float fov"));
    if (one.name == "Film") {
      scene.camera.width = std::stoi(one.values.at("integer xresolution"));
      scene.camera.height = std::stoi(one.values.at("integer yresolution"));
    }
    if (one.name == "LightSource" && one.kind == "infinite") scene.sky = scene::SkyLight{"sky", pbrt_light(one)};
    if (one.name == "LightSource" && one.kind == "distant") {
      const Vector3d way = vector(one.values.at("point3 to")) - vector(one.values.at("point3 from"));
      scene.directional_lights.push_back({"beam", way.normalized(), pbrt_light(one), 0.0});
    }
    if (one.name == "AttributeBegin") exitance = VectorXd();
    if (one.name == "AreaLightSource") exitance = pi * pbrt_light(one);
    if (one.name == "Material") reflectance = at_bands(pbrt_nodes(one.values.at("spectrum reflectance")));
    if (one.name == "Shape") {
      const std::string quoted = one.values.at("string filename");
      add_object(scene, read_patches(file.parent_path() / quoted.substr(1, quoted.size() - 2)), reflectance,
                 exitance.size() == 0, exitance);
    }
  }
  // A left-handed camera frame shows a right-handed world mirrored, unless x is turned round. Its field of view is that
  // of the narrower side.
  if (scale != std::array<double, 3>{-1, 1, 1}) throw std::runtime_error("the picture is mirrored");
  const double narrower = std::tan(fov_deg * pi / 360) / std::min(scene.camera.width, scene.camera.height);
  scene.camera.horizontal_fov_deg = std::atan(narrower * scene.camera.width) * 360 / pi;
  return scene;
}

class ExportedScene : public testing::TestWithParam<Renderer> {};

TEST_P(ExportedScene, MakesTheSamePicture) {
  const test::TemporaryFolder folder;
  const scene::Scene scene = corner();
  const RendererExport written = export_for_renderer(scene, GetParam(), folder / "out");
  const scene::Scene read =
      GetParam() == Renderer::kPbrt4 ? read_pbrt_scene(written.files[0]) : read_mitsuba(written.files[0]);
  scene::validate(read);
  const auto trace = [](const scene::Scene& one, std::uint64_t seed) {
    cross_check::PathTracer tracer(one, {.samples_per_batch = 16, .seed = seed, .components = false});
    tracer.add_batches(32);
    return tracer.estimate(cross_check::Channel::kTotal);
  };
  const cross_check::Estimate ours = trace(scene, 1);
  const cross_check::Estimate theirs = trace(read, 2);
  ASSERT_EQ(ours.mean.width, theirs.mean.width);
  ASSERT_EQ(ours.mean.height, theirs.mean.height);

  constexpr int kAcross = 4, kDown = 4;
  int lit = 0;
  for (int block = 0; block < kAcross * kDown; ++block) {
    for (int band = 0; band < kBands; ++band) {
      double a = 0.0, b = 0.0, variance = 0.0;
      for (int row = block / kAcross * 8; row < (block / kAcross + 1) * 8; ++row) {
        for (int column = block % kAcross * 12; column < (block % kAcross + 1) * 12; ++column) {
          a += static_cast<double>(ours.mean.pixel(row, column)[band]);
          b += static_cast<double>(theirs.mean.pixel(row, column)[band]);
          variance += std::pow(ours.standard_error.pixel(row, column)[band], 2) +
                      std::pow(theirs.standard_error.pixel(row, column)[band], 2);
        }
      }
      const double error = std::sqrt(variance);
      EXPECT_LE(std::abs(a - b), 5.0 * error) << "block " << block << " band " << band << ": " << a << " and " << b;
      if (a > 1.0) {
        ++lit;
        EXPECT_LT(error, 0.01 * a) << "block " << block << " band " << band << " says too little";
      }
    }
  }
  EXPECT_GE(lit, 40);
}

INSTANTIATE_TEST_SUITE_P(Renderers, ExportedScene,
                         testing::Values(Renderer::kMitsuba3, Renderer::kMitsuba06, Renderer::kPbrt4));

}  // namespace
}  // namespace interglow::exchange
