// SPDX-License-Identifier: GPL-3.0-or-later
// What is written is read back by other means (pugixml; a small reader of pbrt's words; the mesh reader) and taken
// through each renderer's own documented rules, which must lead to the rays, radiances and surfaces of the scene.
#include "exchange/renderer_export.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <numbers>
#include <pugixml.hpp>
#include <sstream>
#include <string>

#include "mesh/scan_file.h"
#include "scene/scene_builder.h"
#include "tests/exchange/renderer_files.h"
#include "tests/temporary_folder.h"

namespace interglow::exchange {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;
using std::numbers::pi;
using testing::ElementsAre;
using testing::HasSubstr;

/// A two-sided square of two sizes of faces, a lamp, a sheet of fluorescent paper; sun, sky; a wide picture.
scene::Scene example() {
  scene::Scene scene;
  scene.grid = spectral::WavelengthGrid::uniform(400, 700, 100);
  const auto material = [](const char* name, double first, double last) {
    return spectral::Material{name, {VectorXd::LinSpaced(4, first, last), Eigen::MatrixXd::Zero(4, 4)}};
  };
  scene.materials = {material("grey", 0.1, 0.7), material("glow", 1.0 / 3, 0.2)};
  scene.materials[1].donaldson.luminescence(2, 0) = 0.15;
  scene.materials[1].donaldson.luminescence(3, 0) = 0.05;
  scene::Object sheet{.name = "a sheet"};
  sheet.patches.points = {{0, 0, 0}, {3, 0, 0}, {3, 2, 0}, {0, 2, 0}, {5, 0, 1.0 / 3}};
  sheet.patches.faces = {{0, 1, 2, 3}, {1, 4, 2, -1}};
  sheet.sides = scene::Sides::kTwo;
  scene::Object lamp{.name = "lamp"};
  lamp.patches.points = {{0, 0, 9}, {0, 1, 9}, {1, 0, 9}};
  lamp.patches.faces = {{0, 1, 2, -1}};
  lamp.material = 1;
  lamp.exitance = VectorXd::LinSpaced(4, 1.0, 4.0);
  scene.objects = {sheet, lamp};
  scene.directional_lights = {{"sun", Vector3d(1, 2, -2) / 3.0, VectorXd::LinSpaced(4, 0.5, 2.0), 0.01}};
  scene.sky = scene::SkyLight{"sky", VectorXd::Constant(4, 0.25)};
  scene.camera.position = {10, -40, 30};
  scene.camera.target = {1, 1, 0};
  scene.camera.up = {0, 0, 1};
  scene.camera.horizontal_fov_deg = 50;
  scene.camera.width = 320;
  scene.camera.height = 200;
  scene.camera.first_band = 1;
  scene.camera.last_band = 3;
  return scene;
}

/// The rule of scene::Camera for the middle of a pixel, normalised.
Vector3d ray(const scene::Camera& camera, int row, int column) {
  const Vector3d forward = (camera.target - camera.position).normalized();
  const Vector3d right = forward.cross(camera.up).normalized();
  const Vector3d up = right.cross(forward);
  const double h = std::tan(camera.horizontal_fov_deg * pi / 360);
  return (forward + (2 * (column + 0.5) / camera.width - 1) * h * right +
          (1 - 2 * (row + 0.5) / camera.height) * h * camera.height / camera.width * up)
      .normalized();
}

class RendererExportTest : public testing::Test {
 protected:
  void expect_same_surfaces(const scene::Scene& scene, const RendererExport& written) const {
    ASSERT_EQ(written.files.size(), 1 + scene.objects.size());
    for (std::size_t o = 0; o < scene.objects.size(); ++o) {
      const mesh::TriangleMesh read = mesh::read_scan(written.files[o + 1]).mesh;
      std::size_t triangles = 0;
      Vector3d wanted = Vector3d::Zero();  // area times normal: size and orientation
      for (const mesh::Face& face : scene.objects[o].patches.faces) {
        triangles += mesh::corner_count(face) == 4 ? 2 : 1;
        wanted += mesh::vector_area(scene.objects[o].patches, face);
      }
      Vector3d found = Vector3d::Zero();
      double area = 0.0;
      for (const auto& [a, b, c] : read.triangles) {
        const auto at = [&](int p) { return read.points[static_cast<std::size_t>(p)]; };
        const Vector3d part = 0.5 * (at(b) - at(a)).cross(at(c) - at(a));
        found += part;
        area += part.norm();
      }
      EXPECT_EQ(read.triangles.size(), triangles);
      EXPECT_LT((found - wanted).norm(), 1e-14 * wanted.norm());
      EXPECT_NEAR(area, mesh::total_area(scene.objects[o].patches), 1e-14 * area);
    }
  }

  const test::TemporaryFolder folder_;
  const std::filesystem::path out_ = folder_ / "out";  ///< not yet there
};

// ---- Mitsuba

/// Linear between the centres of the bands, constant to the outer edges; every bit of the values is kept.
void expect_spectrum(const std::pair<std::vector<double>, std::vector<double>>& nodes, const VectorXd& bands,
                     double factor = 1.0) {
  EXPECT_THAT(nodes.first, ElementsAre(350, 400, 500, 600, 700, 750));
  EXPECT_THAT(nodes.second, ElementsAre(bands[0] * factor, bands[0] * factor, bands[1] * factor, bands[2] * factor,
                                        bands[3] * factor, bands[3] * factor));
}

struct MitsubaWords {
  Renderer renderer;
  const char *to_world, *fov_axis, *max_depth, *face_normals;
};

class MitsubaExport : public RendererExportTest, public testing::WithParamInterface<MitsubaWords> {};

TEST_P(MitsubaExport, SaysWhatTheSceneSays) {
  const scene::Scene scene = example();
  const RendererExport written = export_for_renderer(scene, GetParam().renderer, out_, {.bounces = 3});
  expect_same_surfaces(scene, written);
  pugi::xml_document document;
  ASSERT_TRUE(document.load_file(written.files[0].c_str()));
  const pugi::xml_node root = document.child("scene");
  const auto named = [](const pugi::xml_node& node, const char* name) {
    return node.find_child_by_attribute("name", name);
  };

  // Camera: a look-at frame with left = up × forward; sample position x grows to the right of the picture, where the
  // frame's x falls; the horizontal field of view.
  const pugi::xml_node sensor = root.child("sensor");
  const pugi::xml_node lookat = named(sensor, GetParam().to_world).child("lookat");
  const Vector3d origin = vector(lookat.attribute("origin").value());
  const Vector3d forward = (vector(lookat.attribute("target").value()) - origin).normalized();
  const Vector3d left = vector(lookat.attribute("up").value()).cross(forward).normalized();
  const Vector3d up = forward.cross(left);
  EXPECT_EQ(origin, scene.camera.position);
  EXPECT_STREQ(named(sensor, GetParam().fov_axis).attribute("value").value(), "x");
  const double h = std::tan(named(sensor, "fov").attribute("value").as_double() * pi / 360);
  const pugi::xml_node film = sensor.child("film");
  const int width = named(film, "width").attribute("value").as_int();
  const int height = named(film, "height").attribute("value").as_int();
  EXPECT_EQ(width, 320);
  EXPECT_EQ(height, 200);
  for (const auto& [row, column] : {std::pair{0, 0}, {13, 301}, {199, 40}}) {
    const double x = (1 - 2 * (column + 0.5) / width) * h;
    const double y = (1 - 2 * (row + 0.5) / height) * h * height / width;
    EXPECT_LT(((forward + x * left + y * up).normalized() - ray(scene.camera, row, column)).norm(), 1e-14);
  }

  // Depth 2 is direct light.
  EXPECT_EQ(named(root.child("integrator"), GetParam().max_depth).attribute("value").as_int(), 5);

  const pugi::xml_node sun = root.find_child_by_attribute("type", "directional");
  const pugi::xml_node direction = sun.child("vector");
  EXPECT_EQ(Vector3d(direction.attribute("x").as_double(), direction.attribute("y").as_double(),
                     direction.attribute("z").as_double()),
            scene.directional_lights[0].direction);
  expect_spectrum(mitsuba_nodes(sun.child("spectrum")), scene.directional_lights[0].normal_irradiance);
  expect_spectrum(mitsuba_nodes(root.find_child_by_attribute("type", "constant").child("spectrum")),
                  scene.sky->radiance);

  const pugi::xml_node sheet = root.child("shape");
  const pugi::xml_node lamp = sheet.next_sibling("shape");
  ASSERT_FALSE(lamp.next_sibling("shape"));
  EXPECT_EQ(out_ / named(sheet, "filename").attribute("value").value(), written.files[1]);
  EXPECT_TRUE(named(sheet, GetParam().face_normals).attribute("value").as_bool());
  EXPECT_STREQ(sheet.child("bsdf").attribute("type").value(), "twosided");
  expect_spectrum(mitsuba_nodes(sheet.child("bsdf").child("bsdf").child("spectrum")),
                  scene.materials[0].donaldson.reflectance);
  EXPECT_FALSE(sheet.child("emitter"));
  EXPECT_STREQ(lamp.child("bsdf").attribute("type").value(), "diffuse");
  expect_spectrum(mitsuba_nodes(lamp.child("bsdf").child("spectrum")), scene.materials[1].donaldson.reflectance);
  // Radiance of a diffuse emitter: exitance / π.
  const auto nodes = mitsuba_nodes(lamp.child("emitter").child("spectrum"));
  for (std::size_t i = 0; i < 4; ++i) EXPECT_DOUBLE_EQ(nodes.second[i + 1] * pi, scene.objects[1].exitance[i]);

  EXPECT_THAT(written.warnings, ElementsAre(testing::AllOf(HasSubstr("\"glow\" fluoresces"), HasSubstr("20 %")),
                                            HasSubstr("\"sun\""), HasSubstr("\"sky\"")));
}

TEST_P(MitsubaExport, FollowsAllBouncesUnlessTold) {
  const RendererExport written = export_for_renderer(example(), GetParam().renderer, out_);
  pugi::xml_document document;
  ASSERT_TRUE(document.load_file(written.files[0].c_str()));
  EXPECT_EQ(document.child("scene")
                .child("integrator")
                .find_child_by_attribute("name", GetParam().max_depth)
                .attribute("value")
                .as_int(),
            -1);
}

// Scene files that Mitsuba 0.6 has rendered (tests/data/mitsuba/*/path.xml), against what is exported from ours.
TEST_F(RendererExportTest, SaysWhatScenesMadeForMitsubaSay) {
  for (const char* name : {"half_cylinders", "v_groove_60", "cornell"}) {
    SCOPED_TRACE(name);
    const std::filesystem::path data = std::filesystem::path(INTERGLOW_TEST_DATA) / "mitsuba" / name;
    const scene::Scene scene = scene::build_scene(scene::read_scene_file(data / "scene.toml")).scene;
    const RendererExport written = export_for_renderer(scene, Renderer::kMitsuba06, out_ / name);
    pugi::xml_document their_document;
    pugi::xml_document our_document;
    ASSERT_TRUE(their_document.load_file((data / "path.xml").c_str()));
    ASSERT_TRUE(our_document.load_file(written.files[0].c_str()));
    const pugi::xml_node theirs = their_document.child("scene");
    const pugi::xml_node ours = our_document.child("scene");
    const auto fov = [](const pugi::xml_node& scene_node) {
      return scene_node.child("sensor").find_child_by_attribute("name", "fov").attribute("value").as_double();
    };
    EXPECT_NEAR(fov(ours), fov(theirs), 1e-7) << "seven decimals there";
    for (const char* key : {"origin", "target", "up"}) {
      const auto of = [&](const pugi::xml_node& scene_node) {
        const pugi::xml_node transform = scene_node.child("sensor").find_child_by_attribute("name", "toWorld");
        return vector(transform.child("lookat").attribute(key).value());
      };
      EXPECT_EQ(of(ours), of(theirs)) << key;
    }
    const pugi::xml_node beam = theirs.child("emitter");
    const pugi::xml_node our_beam = ours.child("emitter");
    ASSERT_EQ(beam.empty(), our_beam.empty());
    if (beam) {
      const auto direction = [](const pugi::xml_node& node) {
        const pugi::xml_node xyz = node.child("vector");
        return Vector3d(xyz.attribute("x").as_double(), xyz.attribute("y").as_double(), xyz.attribute("z").as_double())
            .normalized();
      };
      EXPECT_STREQ(beam.attribute("type").value(), our_beam.attribute("type").value());
      EXPECT_LT((direction(our_beam) - direction(beam)).norm(), 1e-15);
      EXPECT_EQ(mitsuba_nodes(our_beam.child("spectrum")).second[1],
                beam.child("spectrum").attribute("value").as_double());
    }
    std::size_t shapes = 0;
    for (const pugi::xml_node& shape : theirs.children("shape")) {
      const std::filesystem::path file = shape.find_child_by_attribute("name", "filename").attribute("value").value();
      SCOPED_TRACE(file.string());
      const auto is_it = [&](const pugi::xml_node& node) {
        const std::string ours_of = node.find_child_by_attribute("name", "filename").attribute("value").value();
        return ours_of.find("_" + file.stem().string() + ".ply") != std::string::npos;
      };
      const pugi::xml_node our_shape = ours.find_child(is_it);
      ASSERT_TRUE(our_shape);
      // Theirs are all two-sided: the reflectance is one level deeper.
      EXPECT_EQ(mitsuba_nodes(our_shape.child("bsdf").child("spectrum")).second[1],
                shape.child("bsdf").child("bsdf").child("spectrum").attribute("value").as_double());
      const pugi::xml_node emitter = shape.child("emitter");
      ASSERT_EQ(emitter.empty(), our_shape.child("emitter").empty());
      if (emitter) {
        EXPECT_NEAR(mitsuba_nodes(our_shape.child("emitter").child("spectrum")).second[1],
                    emitter.child("spectrum").attribute("value").as_double(), 1e-15);
      }
      ++shapes;
    }
    EXPECT_EQ(shapes, scene.objects.size());
  }
}

INSTANTIATE_TEST_SUITE_P(
    Versions, MitsubaExport,
    testing::Values(MitsubaWords{Renderer::kMitsuba3, "to_world", "fov_axis", "max_depth", "face_normals"},
                    MitsubaWords{Renderer::kMitsuba06, "toWorld", "fovAxis", "maxDepth", "faceNormals"}),
    [](const auto& instance) { return instance.param.renderer == Renderer::kMitsuba3 ? "Mitsuba3" : "Mitsuba06"; });

// ---- pbrt

const Statement& find(const std::vector<Statement>& statements, const std::string& name, const std::string& kind = "") {
  const auto is_it = [&](const Statement& s) { return s.name == name && (kind.empty() || s.kind == kind); };
  const auto found = std::find_if(statements.begin(), statements.end(), is_it);
  if (found == statements.end()) throw std::runtime_error("no " + name + " " + kind);
  return *found;
}

using PbrtExport = RendererExportTest;

TEST_F(PbrtExport, SaysWhatTheSceneSays) {
  const scene::Scene scene = example();
  const RendererExport written = export_for_renderer(scene, Renderer::kPbrt4, out_, {.bounces = 3});
  expect_same_surfaces(scene, written);
  const std::vector<Statement> statements = read_pbrt(written.files[0]);

  // Camera: camera from world = scale × look-at, whose rows are up × forward, forward × (up × forward), forward; x
  // grows to the right of the picture; the field of view is that of the narrower side.
  const std::vector<double>& scale = find(statements, "Scale").plain;
  const std::vector<double>& look = find(statements, "LookAt").plain;
  ASSERT_EQ(scale.size(), 3U);
  ASSERT_EQ(look.size(), 9U);
  const Vector3d origin(look[0], look[1], look[2]);
  const Vector3d forward = (Vector3d(look[3], look[4], look[5]) - origin).normalized();
  const Vector3d x_axis = Vector3d(look[6], look[7], look[8]).cross(forward).normalized();
  const Vector3d y_axis = forward.cross(x_axis);
  EXPECT_EQ(origin, scene.camera.position);
  const Statement& film = find(statements, "Film", "spectral");
  const int width = std::stoi(film.values.at("integer xresolution"));
  const int height = std::stoi(film.values.at("integer yresolution"));
  const double t = std::tan(std::stod(find(statements, "Camera").values.at("float fov")) * pi / 360);
  for (const auto& [row, column] : {std::pair{0, 0}, {13, 301}, {199, 40}}) {
    const double narrower = std::min(width, height);
    const double x = scale[0] * (2 * (column + 0.5) - width) / narrower * t;
    const double y = scale[1] * (height - 2 * (row + 0.5)) / narrower * t;
    const Vector3d found = (scale[2] * forward + x * x_axis + y * y_axis).normalized();
    EXPECT_LT((found - ray(scene.camera, row, column)).norm(), 1e-13);
  }
  // The camera's bands 500 to 700 nm.
  EXPECT_EQ(film.values.at("integer nbuckets"), "3");
  EXPECT_EQ(std::stod(film.values.at("float lambdamin")), 450);
  EXPECT_EQ(std::stod(film.values.at("float lambdamax")), 750);
  EXPECT_EQ(find(statements, "Integrator").values.at("integer maxdepth"), "4") << "1 is direct light";

  const Statement& sun = find(statements, "LightSource", "distant");
  const Vector3d travels = vector(sun.values.at("point3 to")) - vector(sun.values.at("point3 from"));
  EXPECT_LT((travels - scene.directional_lights[0].direction).norm(), 1e-15);
  expect_spectrum(pbrt_nodes(sun.values.at("spectrum L")), scene.directional_lights[0].normal_irradiance);
  expect_spectrum(pbrt_nodes(find(statements, "LightSource", "infinite").values.at("spectrum L")), scene.sky->radiance);
  expect_spectrum(pbrt_nodes(find(statements, "Material").values.at("spectrum reflectance")),
                  scene.materials[0].donaldson.reflectance);
  const auto glow = pbrt_nodes(find(statements, "AreaLightSource").values.at("spectrum L"));
  for (std::size_t i = 0; i < 4; ++i) EXPECT_DOUBLE_EQ(glow.second[i + 1] * pi, scene.objects[1].exitance[i]);

  EXPECT_THAT(written.warnings, ElementsAre(HasSubstr("\"glow\" fluoresces"), HasSubstr("\"sun\""),
                                            HasSubstr("\"sky\""), HasSubstr("\"lamp\" is a sheet")));
}

// pbrt divides a light's spectrum by Σ ȳ(λ) L(λ) over whole nanometres, 106.856895 for L = 1 from 360 to 830 nm (CIE
// 15:2004, table T.4; pbrt's CIE_Y_integral), and multiplies it by "scale".
TEST_F(PbrtExport, ScalesUndoTheDivisionByLuminance) {
  scene::Scene scene = example();
  scene.grid = spectral::WavelengthGrid::uniform(360, 840, 160);
  scene.sky->radiance = VectorXd::Constant(4, 1.0);
  const RendererExport written = export_for_renderer(scene, Renderer::kPbrt4, out_);
  const std::vector<Statement> statements = read_pbrt(written.files[0]);
  EXPECT_NEAR(std::stod(find(statements, "LightSource", "infinite").values.at("float scale")), 106.856895, 1e-3);
}

TEST_F(PbrtExport, RefusesParamsOutOfRange) {
  EXPECT_THROW(export_for_renderer(example(), Renderer::kPbrt4, out_, {.bounces = -1}), InvalidParams);
  EXPECT_THROW(export_for_renderer(example(), Renderer::kPbrt4, out_, {.samples_per_pixel = 0}), InvalidParams);
  EXPECT_FALSE(std::filesystem::exists(out_));
}

}  // namespace
}  // namespace interglow::exchange
