// SPDX-License-Identifier: GPL-3.0-or-later
#include "scene/scene_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <numbers>
#include <string>

#include "diagnostics/error.h"
#include "tests/temporary_folder.h"

namespace interglow::scene {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

constexpr const char* kFull = R"(# every table and key
[wavelengths]
first_nm = 350
last_nm = 700
step_nm = 5

[material.white]
reflectance = 0.8
scale = 0.9

[material.red]
reflectance = "red.csv"
reflectance_column = "second"

[material.glowing]
donaldson = "matrix.csv"
donaldson_rows = "excitation"
keep_anti_stokes = true
keep_noise = true

[object.left]
mesh = "left.obj"
unit_mm = 1000
material = "red"
sides = "two"
shading = "flat"
reverse = true
scale = 2
rotate_axis = [0, 0, 2]
rotate_deg = 90
translate_mm = [1, 2, 3.5]
remesh = "adaptive"
patches = 4000
feature_angle_deg = 35
noise_mm = 0.02
near_edge_ratio = 0.5
close_holes_mm = 3
close_contact_mm = 6

[object.lamp]
mesh = "lamp.obj"
material = "white"
remesh = "none"
subdivide_mm = 0.5
follow_contacts = true

[light.sun]
kind = "directional"
direction = [3, 0, -4]
spectrum = "red.csv"
spectrum_column = "first"
irradiance_W_m2 = 500
half_angle_deg = 0.27

[light.glow]
kind = "surface"
object = "lamp"
spectrum = 2.5
radiance_W_m2_sr = 3

[light.sky]
kind = "sky"
spectrum = 1

[camera]
position_mm = [0, 0, 500]
target_mm = [0, 0, 0]
up = [0, 1, 0]
horizontal_fov_deg = 12.5
width_px = 640
height_px = 480
first_nm = 400
last_nm = 690

[solve]
bounces = 4
tolerance = 1e-8
max_iterations = 50
form_factor_tolerance = 1e-5
occlusion = false
smooth_closure = true
model = "paper"

[render]
samples_per_side = 2
gather_tolerance = 1e-4

[output]
exposure = 1.5
components = false
split_li = true
contact_region_mm = 3
spectra_px = [[0, 0], [639, 479]]
)";

class SceneFile : public testing::Test {
 protected:
  void SetUp() override {
    for (const char* name : {"red.csv", "matrix.csv", "left.obj", "lamp.obj"}) std::ofstream(folder_ / name) << "x\n";
  }

  SceneDescription parse(const std::string& text) const { return parse_scene(text, folder_ / "scene.toml"); }

  /// The message for the full example with `from` replaced by `to`.
  std::string message(const std::string& from, const std::string& to) const {
    std::string text = kFull;
    const auto at = text.find(from);
    if (at == std::string::npos) return "the example does not contain: " + from;
    text.replace(at, from.size(), to);
    try {
      parse(text);
    } catch (const InvalidInput& error) {
      return error.what();
    }
    return "no exception";
  }

  /// "…/scene.toml:LINE: key: ", the line being that of `marker` in the example.
  std::string place(const std::string& marker, const std::string& key) const {
    const std::string text = kFull;
    const auto line = std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(text.find(marker)), '\n') + 1;
    return (folder_ / "scene.toml").string() + ":" + std::to_string(line) + ": " + key;
  }

  void expect_refused(const std::string& from, const std::string& to, const std::string& key, const std::string& value,
                      const std::string& remedy) const {
    EXPECT_THAT(message(from, to),
                testing::AllOf(StartsWith(place(from, key + ": ")), HasSubstr(value), HasSubstr(remedy)))
        << "for " << to;
  }

  const test::TemporaryFolder folder_;
};

TEST_F(SceneFile, ReadsEveryKey) {
  const SceneDescription scene = parse(kFull);
  EXPECT_EQ(scene.grid.size(), 71);
  ASSERT_EQ(scene.materials.size(), 3U);
  EXPECT_EQ(scene.materials[0].name, "white");
  EXPECT_EQ(scene.materials[0].reflectance->constant, 0.8);
  EXPECT_EQ(scene.materials[0].scale, 0.9);
  EXPECT_EQ(scene.materials[1].reflectance->file, folder_ / "red.csv");
  EXPECT_EQ(scene.materials[1].reflectance->column, "second");
  EXPECT_FALSE(scene.materials[2].reflectance);
  EXPECT_EQ(scene.materials[2].donaldson, folder_ / "matrix.csv");
  EXPECT_EQ(scene.materials[2].donaldson_params.orientation, spectral::Orientation::kExcitationRows);
  EXPECT_TRUE(scene.materials[2].donaldson_params.resample.keep_anti_stokes);
  EXPECT_TRUE(scene.materials[2].donaldson_params.resample.keep_noise);

  ASSERT_EQ(scene.objects.size(), 2U);
  const ObjectDescription& left = scene.objects[0];
  EXPECT_EQ(left.name, "left");
  EXPECT_EQ(left.mesh, folder_ / "left.obj");
  EXPECT_EQ(left.unit_mm, 1000.0);
  EXPECT_EQ(left.material, 1);
  EXPECT_EQ(left.sides, Sides::kTwo);
  EXPECT_FALSE(left.smooth);
  EXPECT_TRUE(left.reverse);
  EXPECT_EQ(left.remesh, RemeshKind::kAdaptive);
  EXPECT_EQ(left.patches, 4000);
  EXPECT_EQ(left.feature_angle_deg, 35.0);
  EXPECT_EQ(left.noise_mm, 0.02);
  EXPECT_EQ(left.near_edge_ratio, 0.5);
  EXPECT_EQ(left.close_holes_mm, 3.0);
  EXPECT_EQ(left.close_contact_mm, 6.0);
  // Twice the size, a quarter turn about z (x becomes y), then the shift: (1, 0, 0) -> (0, 2, 0) -> (1, 4, 3.5).
  const Eigen::Vector3d moved = left.world_from_mesh * Eigen::Vector3d(1.0, 0.0, 0.0);
  EXPECT_LT((moved - Eigen::Vector3d(1.0, 4.0, 3.5)).norm(), 1e-14);
  EXPECT_EQ(scene.objects[1].remesh, RemeshKind::kNone);
  EXPECT_EQ(scene.objects[1].subdivide_mm, 0.5);
  EXPECT_TRUE(scene.objects[1].follow_contacts);
  EXPECT_FALSE(left.follow_contacts);
  EXPECT_FALSE(scene.objects[1].smooth) << "given triangles are flat unless asked otherwise";

  ASSERT_EQ(scene.lights.size(), 3U);
  EXPECT_EQ(scene.lights[0].kind, LightKind::kDirectional);
  EXPECT_LT((scene.lights[0].direction - Eigen::Vector3d(0.6, 0.0, -0.8)).norm(), 1e-15);
  EXPECT_EQ(scene.lights[0].integral, 500.0);
  EXPECT_EQ(scene.lights[0].half_angle_deg, 0.27);
  EXPECT_EQ(scene.lights[0].spectrum.column, "first");
  EXPECT_EQ(scene.lights[1].kind, LightKind::kSurface);
  EXPECT_EQ(scene.lights[1].object, 1);
  EXPECT_EQ(scene.lights[1].integral, 3.0);
  EXPECT_TRUE(scene.lights[1].integral_is_radiance);
  EXPECT_EQ(scene.lights[1].spectrum.constant, 2.5);
  EXPECT_EQ(scene.lights[2].kind, LightKind::kSky);
  EXPECT_FALSE(scene.lights[2].integral);

  EXPECT_EQ(scene.camera.position, Eigen::Vector3d(0, 0, 500));
  EXPECT_EQ(scene.camera.horizontal_fov_deg, 12.5);
  EXPECT_EQ(scene.camera.width, 640);
  EXPECT_EQ(scene.camera.height, 480);
  EXPECT_EQ(scene.camera.first_band, 10);  // 350 + 10 * 5 = 400
  EXPECT_EQ(scene.camera.last_band, 68);   // 350 + 68 * 5 = 690
  EXPECT_EQ(scene.output.contact_region_mm, 3.0);
  EXPECT_EQ(scene.solve.bounces, 4);
  EXPECT_EQ(scene.solve.tolerance, 1e-8);
  EXPECT_EQ(scene.solve.max_iterations, 50);
  EXPECT_EQ(scene.solve.form_factor_tolerance, 1e-5);
  EXPECT_FALSE(scene.solve.occlusion);
  EXPECT_TRUE(scene.solve.smooth_closure);
  EXPECT_EQ(scene.solve.model, LightModel::kPaper);
  EXPECT_EQ(scene.render.samples_per_side, 2);
  EXPECT_EQ(scene.render.gather_tolerance, 1e-4);
  EXPECT_EQ(scene.output.exposure, 1.5);
  EXPECT_FALSE(scene.output.components);
  EXPECT_TRUE(scene.output.split_li);
  ASSERT_EQ(scene.output.spectra_px.size(), 2U);
  EXPECT_EQ(scene.output.spectra_px[1], (std::array<int, 2>{639, 479}));
}

TEST_F(SceneFile, DefaultsAreTheDocumentedOnes) {
  const SceneDescription scene = parse(R"(
[material.grey]
reflectance = 0.5
[object.only]
mesh = "left.obj"
material = "grey"
[light.sky]
kind = "sky"
spectrum = 1.0
[camera]
position_mm = [0, 0, 500]
target_mm = [0, 0, 0]
horizontal_fov_deg = 20
)");
  EXPECT_EQ(scene.grid.size(), 71);
  EXPECT_EQ(scene.grid.center_nm(0), 350.0);
  EXPECT_EQ(scene.camera.first_band, 10);
  EXPECT_EQ(scene.camera.last_band, 70);
  EXPECT_EQ(scene.camera.width, 512);
  EXPECT_FALSE(scene.solve.bounces) << "all bounces";
  EXPECT_TRUE(scene.objects[0].smooth);
  EXPECT_EQ(scene.objects[0].remesh, RemeshKind::kAdaptive);
  EXPECT_FALSE(scene.output.exposure);
  EXPECT_TRUE(scene.output.components);
}

TEST_F(SceneFile, UnknownKeysNameTheNearestKnownOne) {
  expect_refused("patches = 4000", "patchs = 4000", "object.left.patchs", "4000", "\"patches\"");
  expect_refused("bounces = 4", "bounce = 4", "solve.bounce", "4", "\"bounces\"");
  expect_refused("samples_per_side = 2", "zzzzzzzzzz = 2", "render.zzzzzzzzzz", "2", "Known keys here");
  expect_refused("[render]", "[rendr]", "rendr", "a table", "\"render\"");
  expect_refused("up = [0, 1, 0]", "upp = [0, 1, 0]", "camera.upp", "[0, 1, 0]", "\"up\"");
  expect_refused("scale = 0.9", "scal = 0.9", "material.white.scal", "0.9", "\"scale\"");
  expect_refused("half_angle_deg = 0.27", "half_angel_deg = 0.27", "light.sun.half_angel_deg", "0.27",
                 "\"half_angle_deg\"");
  expect_refused("close_contact_mm = 6", "close_contct = 6", "object.left.close_contct", "6", "\"close_contact_mm\"");
  expect_refused("exposure = 1.5", "exposre = 1.5", "output.exposre", "1.5", "\"exposure\"");
}

TEST_F(SceneFile, WrongTypesAreNamed) {
  expect_refused("unit_mm = 1000", "unit_mm = \"m\"", "object.left.unit_mm", "\"m\"", "expected a number above 0");
  expect_refused("reverse = true", "reverse = 1", "object.left.reverse", "1", "true or false");
  expect_refused("patches = 4000", "patches = 4e3", "object.left.patches", "4000", "a whole number");
  expect_refused("material = \"red\"", "material = 3", "object.left.material", "3", "text in quotes");
  expect_refused("translate_mm = [1, 2, 3.5]", "translate_mm = [1, 2]", "object.left.translate_mm", "[1, 2]",
                 "three finite numbers");
  expect_refused("translate_mm = [1, 2, 3.5]", "translate_mm = [1, nan, 2]", "object.left.translate_mm", "nan",
                 "three finite numbers");
  expect_refused("reflectance = 0.8", "reflectance = true", "material.white.reflectance", "true", "name of a table");
  expect_refused("bounces = 4", "bounces = \"all\"", "solve.bounces", "\"all\"", "\"inf\"");
  expect_refused("exposure = 1.5", "exposure = \"bright\"", "output.exposure", "\"bright\"", "\"auto\"");
  expect_refused("spectra_px = [[0, 0]", "spectra_px = [[0.5, 0]", "output.spectra_px", "0.5", "[column, row]");
}

TEST_F(SceneFile, ValuesOutOfRangeAreNamed) {
  expect_refused("reflectance = 0.8", "reflectance = 1.2", "material.white.reflectance", "1.2", "from 0 to 1");
  expect_refused("unit_mm = 1000", "unit_mm = 0", "object.left.unit_mm", "0", "above 0");
  expect_refused("patches = 4000", "patches = 0", "object.left.patches", "0", "from 4 to 10000000");
  expect_refused("horizontal_fov_deg = 12.5", "horizontal_fov_deg = 180", "camera.horizontal_fov_deg", "180",
                 "below 180");
  expect_refused("width_px = 640", "width_px = 100000", "camera.width_px", "100000", "1 to 65536");
  expect_refused("tolerance = 1e-8", "tolerance = 0.5", "solve.tolerance", "0.5", "expected");
  expect_refused("form_factor_tolerance = 1e-5", "form_factor_tolerance = 0", "solve.form_factor_tolerance", "0",
                 "expected");
  expect_refused("irradiance_W_m2 = 500", "irradiance_W_m2 = -1", "light.sun.irradiance_W_m2", "-1", "above 0");
  expect_refused("half_angle_deg = 0.27", "half_angle_deg = 45", "light.sun.half_angle_deg", "45", "from 0 to 30");
  expect_refused("direction = [3, 0, -4]", "direction = [0, 0, 0]", "light.sun.direction", "[0, 0, 0]",
                 "the way the light travels");
  expect_refused("rotate_axis = [0, 0, 2]", "rotate_axis = [0, 0, 0]", "object.left.rotate_axis", "[0, 0, 0]",
                 "direction");
  expect_refused("bounces = 4", "bounces = -1", "solve.bounces", "-1", "from 0 to 10000");
  expect_refused("spectra_px = [[0, 0]", "spectra_px = [[640, 0]", "output.spectra_px", "[640, 0]", "0 to 639");
  expect_refused("up = [0, 1, 0]", "up = [0, 0, 1]", "camera.up", "parallel", "Choose");
  expect_refused("target_mm = [0, 0, 0]", "target_mm = [0, 0, 500]", "camera.target_mm", "same point", "Move");
}

TEST_F(SceneFile, WordsMustBeKnown) {
  expect_refused("sides = \"two\"", "sides = \"both\"", "object.left.sides", "\"both\"", "\"two\"");
  expect_refused("shading = \"flat\"", "shading = \"round\"", "object.left.shading", "\"round\"", "\"smooth\"");
  expect_refused("remesh = \"adaptive\"", "remesh = \"no\"", "object.left.remesh", "\"no\"", "\"none\"");
  expect_refused("kind = \"sky\"", "kind = \"dome\"", "light.sky.kind", "\"dome\"", "\"surface\"");
  expect_refused("model = \"paper\"", "model = \"papers\"", "solve.model", "\"papers\"", "\"exact\"");
}

TEST_F(SceneFile, NamesMustBeDefined) {
  expect_refused("material = \"red\"", "material = \"rd\"", "object.left.material", "\"rd\"", "\"red\"");
  expect_refused("material = \"red\"", "material = \"turquoise\"", "object.left.material", "\"turquoise\"",
                 "[material.turquoise]");
  expect_refused("object = \"lamp\"", "object = \"lamb\"", "light.glow.object", "\"lamb\"", "\"lamp\"");
}

TEST_F(SceneFile, FilesMustExist) {
  expect_refused("mesh = \"left.obj\"", "mesh = \"lost.obj\"", "object.left.mesh", "\"lost.obj\"",
                 (folder_ / "lost.obj").string());
  expect_refused("donaldson = \"matrix.csv\"", "donaldson = \"lost.csv\"", "material.glowing.donaldson", "\"lost.csv\"",
                 "not found");
  expect_refused("reflectance = \"red.csv\"", "reflectance = \"lost.csv\"", "material.red.reflectance", "\"lost.csv\"",
                 "not found");
  expect_refused("spectrum = \"red.csv\"", "spectrum = \"lost.csv\"", "light.sun.spectrum", "\"lost.csv\"",
                 "not found");
  EXPECT_THAT(message("mesh = \"left.obj\"", "mesh = \".\""), HasSubstr("not found")) << "a folder is no mesh";
}

TEST_F(SceneFile, ShippedTablesAreFoundByName) {
  std::string text = kFull;
  text.replace(text.find("\"red.csv\""), 9, "\"interglow:illuminants/d65\"");
  EXPECT_TRUE(std::filesystem::is_regular_file(parse(text).materials[1].reflectance->file));
  expect_refused("spectrum = \"red.csv\"", "spectrum = \"interglow:illuminants/d66\"", "light.sun.spectrum",
                 "interglow:illuminants/d66", "interglow:illuminants/d65");
}

TEST_F(SceneFile, MissingKeysAreNamed) {
  const auto missing = [&](const std::string& line, const std::string& table, const std::string& key) {
    EXPECT_THAT(message(line, ""), testing::AllOf(StartsWith(folder_.path().string()), HasSubstr(": " + table + ": "),
                                                  HasSubstr("\"" + key + "\" is missing")));
  };
  missing("mesh = \"left.obj\"", "object.left", "mesh");
  missing("material = \"red\"", "object.left", "material");
  missing("direction = [3, 0, -4]", "light.sun", "direction");
  missing("kind = \"sky\"", "light.sky", "kind");
  missing("spectrum = 2.5", "light.glow", "spectrum");
  missing("object = \"lamp\"", "light.glow", "object");
  missing("position_mm = [0, 0, 500]", "camera", "position_mm");
  missing("target_mm = [0, 0, 0]", "camera", "target_mm");
  missing("horizontal_fov_deg = 12.5", "camera", "horizontal_fov_deg");
}

TEST_F(SceneFile, MissingTablesAreNamed) {
  const auto refusal = [&](const std::string& text) -> std::string {
    try {
      parse(text);
    } catch (const InvalidInput& error) {
      return error.what();
    }
    return "no exception";
  };
  const std::string camera = "[camera]\nposition_mm = [0, 0, 9]\ntarget_mm = [0, 0, 0]\nhorizontal_fov_deg = 20\n";
  const std::string material = "[material.m]\nreflectance = 0.5\n";
  const std::string object = "[object.o]\nmesh = \"left.obj\"\nmaterial = \"m\"\n";
  EXPECT_THAT(refusal(""), HasSubstr("[camera]"));
  EXPECT_THAT(refusal(camera), HasSubstr("[material.NAME]"));
  EXPECT_THAT(refusal(camera + material), HasSubstr("[object.NAME]"));
  EXPECT_THAT(refusal(camera + material + object), HasSubstr("[light.NAME]"));
  EXPECT_THAT(refusal("object = 5\n" + camera + material),
              testing::AllOf(HasSubstr(":1: object: 5"), HasSubstr("expected a table")));
}

TEST_F(SceneFile, ContradictionsAreNamed) {
  const auto refused_with = [&](const std::string& from, const std::string& to, const std::string& key,
                                const std::string& sentence) {
    EXPECT_THAT(message(from, to),
                testing::AllOf(StartsWith(folder_.path().string()), HasSubstr(": " + key + ": "), HasSubstr(sentence)));
  };
  refused_with("noise_mm = 0.02", "edge_length_mm = 1", "object.left.patches", "together with \"edge_length_mm\"");
  refused_with("remesh = \"none\"", "remesh = \"none\"\npatches = 100", "object.lamp.remesh", "keeps the triangles");
  refused_with("remesh = \"adaptive\"", "subdivide_mm = 2", "object.left.subdivide_mm", "remesh = \"none\"");
  refused_with("rotate_deg = 90", "", "object.left.rotate_axis", "\"rotate_deg\"");
  refused_with("rotate_axis = [0, 0, 2]", "", "object.left.rotate_deg", "\"rotate_axis\"");
  refused_with("donaldson = \"matrix.csv\"", "donaldson = \"matrix.csv\"\nreflectance = 0.5", "material.glowing",
               "Remove one");
  refused_with("reflectance = 0.8", "", "material.white", "neither");
  refused_with("scale = 0.9", "keep_noise = true", "material.white.keep_noise", "there is none");
  refused_with("reflectance = 0.8", "reflectance = 0.8\nreflectance_column = \"a\"",
               "material.white.reflectance_column", "\"a\"");
  refused_with("radiance_W_m2_sr = 3", "radiance_W_m2_sr = 3\nexitance_W_m2 = 2", "light.glow.radiance_W_m2_sr",
               "together with \"exitance_W_m2\"");
  refused_with("[camera]", "[light.dusk]\nkind = \"sky\"\nspectrum = 1\n[camera]", "light.dusk.kind",
               "\"sky\" is a sky already");
  refused_with("[camera]", "[light.two]\nkind = \"surface\"\nspectrum = 1\nobject = \"lamp\"\n[camera]",
               "light.two.object", "\"glow\"");
  EXPECT_THAT(message("[object.lamp]", "[object.left]"),
              testing::AllOf(StartsWith(place("[object.lamp]", "table")), HasSubstr("object.left"),
                             HasSubstr("already exists")));
}

TEST_F(SceneFile, WavelengthsMustFit) {
  EXPECT_THAT(message("step_nm = 5", "step_nm = 3"),
              testing::AllOf(HasSubstr(":2: wavelengths: "), HasSubstr("whole number of steps of 3 nm")));
  expect_refused("first_nm = 400", "first_nm = 300", "camera.first_nm", "300", "350 nm to 700 nm");
  expect_refused("last_nm = 690", "last_nm = 800", "camera.last_nm", "800", "350 nm to 700 nm");
  expect_refused("first_nm = 400", "first_nm = 695", "camera.first_nm", "no band", "350 nm to 700 nm");
  EXPECT_THAT(message("step_nm = 5", "step_nm = 5\ncenters_nm = [400, 500]"), HasSubstr("Keep one"));
  EXPECT_THAT(message("first_nm = 350\nlast_nm = 700\nstep_nm = 5", "centers_nm = [400, 500, 450]"),
              testing::AllOf(HasSubstr("wavelengths.centers_nm"), HasSubstr("450"), HasSubstr("increasing")));
}

}  // namespace
}  // namespace interglow::scene
