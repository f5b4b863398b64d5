// SPDX-License-Identifier: GPL-3.0-or-later
#include "scene/scene_builder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <numbers>
#include <string>

#include "diagnostics/error.h"
#include "tests/temporary_folder.h"

namespace interglow::scene {
namespace {

using testing::HasSubstr;

// A unit cube, faces outward.
constexpr const char* kCube = R"(v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 0 0 1
v 1 0 1
v 1 1 1
v 0 1 1
f 1 4 3 2
f 5 6 7 8
f 1 2 6 5
f 2 3 7 6
f 3 4 8 7
f 4 1 5 8
)";

constexpr const char* kScene = R"([material.grey]
reflectance = 0.5
scale = 0.8
[material.ramp]
reflectance = "ramp.csv"
[object.cube]
mesh = "cube.obj"
unit_mm = 10
material = "ramp"
remesh = "none"
rotate_axis = [0, 0, 1]
rotate_deg = 90
translate_mm = [100, 0, 0]
[object.lamp]
mesh = "sheet.obj"
material = "grey"
remesh = "none"
sides = "two"
[light.sun]
kind = "directional"
direction = [0, 0, -1]
spectrum = "light.csv"
irradiance_W_m2 = 70
half_angle_deg = 0.5
[light.glow]
kind = "surface"
object = "lamp"
spectrum = 1
radiance_W_m2_sr = 4
[light.sky]
kind = "sky"
spectrum = 0.25
[camera]
position_mm = [0, 0, 500]
target_mm = [0, 0, 0]
horizontal_fov_deg = 20
)";

class SceneBuilder : public testing::Test {
 protected:
  void SetUp() override {
    write("cube.obj", kCube);
    write("sheet.obj", "v 0 0 -5\nv 50 0 -5\nv 50 50 -5\nv 0 50 -5\nf 1 2 3 4\n");
    write("ramp.csv", "wavelength_nm,r\n350,0\n700,0.7\n");
    write("light.csv", "wavelength_nm,e\n400,1\n405,1\n700,1\n");
  }
  void write(const std::string& name, const std::string& text) const { std::ofstream(folder_ / name) << text; }

  BuiltScene build(const std::string& from = "", const std::string& to = "") const {
    std::string text = kScene;
    if (!from.empty()) text.replace(text.find(from), from.size(), to);
    return build_scene(parse_scene(text, folder_ / "scene.toml"));
  }
  std::string message(const std::string& from, const std::string& to) const {
    try {
      build(from, to);
    } catch (const InvalidInput& error) {
      return error.what();
    }
    return "no exception";
  }

  const test::TemporaryFolder folder_;
};

// Triangles with legs 10 and hypotenuse 10 sqrt(2) mm: edges of at most 4 mm need n = ceil(14.142 / 4) = 4 parts.
TEST_F(SceneBuilder, CutsGivenTrianglesIntoCongruentOnes) {
  const BuiltScene whole = build();
  const BuiltScene cut = build("remesh = \"none\"\nrotate", "remesh = \"none\"\nsubdivide_mm = 4\nrotate");
  const mesh::PatchMesh& patches = cut.scene.objects[0].patches;
  ASSERT_EQ(patches.faces.size(), 12U * 16U);
  EXPECT_EQ(cut.objects[0].remesh.patches, 12 * 16);
  EXPECT_TRUE(patches.closed);
  EXPECT_TRUE(mesh::is_closed(patches));
  for (std::size_t f = 0; f < patches.faces.size(); ++f) {
    const Eigen::Vector3d area = mesh::vector_area(patches, patches.faces[f]);
    const Eigen::Vector3d given =
        mesh::vector_area(whole.scene.objects[0].patches, whole.scene.objects[0].patches.faces[f / 16]);
    EXPECT_LT((area - given / 16).norm(), 1e-12) << "face " << f;
  }
  EXPECT_THAT(message("unit_mm = 10\nmaterial = \"ramp\"\nremesh = \"none\"",
                      "unit_mm = 10\nmaterial = \"ramp\"\nremesh = \"none\"\nsubdivide_mm = 1e-4"),
              testing::AllOf(HasSubstr("object.cube.mesh"), HasSubstr("Choose a longer edge")));
}

// The cube stands on [20, 30]² of the sheet of 50 mm a side: on 100 of 2500 mm².
TEST_F(SceneBuilder, CutsPatchesWhereOthersStandOnThem) {
  const std::string stands = "translate_mm = [30, 20, -5]\n[object.lamp]\nmesh = \"sheet.obj\"\n";
  const BuiltScene whole = build("translate_mm = [100, 0, 0]\n[object.lamp]\nmesh = \"sheet.obj\"\n", stands);
  const BuiltScene built =
      build("translate_mm = [100, 0, 0]\n[object.lamp]\nmesh = \"sheet.obj\"\n", stands + "follow_contacts = true\n");
  EXPECT_EQ(built.scene.objects[0].patches.faces, whole.scene.objects[0].patches.faces) << "not asked for";
  const mesh::PatchMesh& sheet = built.scene.objects[1].patches;
  EXPECT_GT(sheet.faces.size(), whole.scene.objects[1].patches.faces.size());
  EXPECT_EQ(built.objects[1].remesh.patches, static_cast<int>(sheet.faces.size()));
  double inside = 0.0;
  for (std::size_t f = 0; f < sheet.faces.size(); ++f) {
    int within = 0;
    int beyond = 0;
    for (int k = 0; k < mesh::corner_count(sheet.faces[f]); ++k) {
      const auto& point = sheet.points[static_cast<std::size_t>(sheet.faces[f][static_cast<std::size_t>(k)])];
      const double distance = std::max(std::abs(point.x() - 25.0), std::abs(point.y() - 25.0)) - 5.0;
      within += distance < -1e-9 ? 1 : 0;
      beyond += distance > 1e-9 ? 1 : 0;
    }
    EXPECT_FALSE(within > 0 && beyond > 0) << "face " << f << " reaches under the cube";
    if (beyond == 0) inside += mesh::vector_area(sheet, sheet.faces[f]).norm();
  }
  EXPECT_NEAR(inside, 100.0, 1e-9);
  EXPECT_NEAR(mesh::total_area(sheet), 2500.0, 1e-9);
}

TEST_F(SceneBuilder, TransformsAndKeepsTheTriangles) {
  const BuiltScene built = build();
  ASSERT_EQ(built.scene.objects.size(), 2U);
  const Object& cube = built.scene.objects[0];
  EXPECT_EQ(cube.patches.points.size(), 8U);
  EXPECT_EQ(cube.patches.faces.size(), 12U);
  EXPECT_TRUE(cube.patches.closed);
  EXPECT_TRUE(cube.patches.corner_normals.empty()) << "flat, because the triangles are kept";
  // (1, 0, 0) in units of 10 mm, a quarter turn about z, 100 mm along x.
  EXPECT_LT((cube.patches.points[1] - Eigen::Vector3d(100.0, 10.0, 0.0)).norm(), 1e-12);
  EXPECT_NEAR(mesh::total_area(cube.patches), 600.0, 1e-10);
  EXPECT_FALSE(built.scene.objects[1].patches.closed);
  EXPECT_EQ(built.scene.objects[1].sides, Sides::kTwo);
}

TEST_F(SceneBuilder, ReverseTurnsTheFrontRound) {
  const BuiltScene given = build();
  const BuiltScene reversed = build("unit_mm = 10", "unit_mm = 10\nreverse = true");
  for (std::size_t f = 0; f < 12; ++f) {
    const auto area = [f](const BuiltScene& built) {
      return mesh::vector_area(built.scene.objects[0].patches, built.scene.objects[0].patches.faces[f]);
    };
    EXPECT_LT((area(given) + area(reversed)).norm(), 1e-10) << "face " << f;
  }
}

TEST_F(SceneBuilder, PutsMaterialsOnTheGrid) {
  const BuiltScene built = build();
  EXPECT_LT((built.scene.materials[0].donaldson.reflectance.array() - 0.4).abs().maxCoeff(), 1e-15)
      << "0.5 scaled by 0.8";
  // A straight line's mean over a band is its value at the band's centre: (λ - 350) / 500; the outer bands hold the end
  // values.
  for (int band = 1; band < 70; ++band) {
    EXPECT_NEAR(built.scene.materials[1].donaldson.reflectance[band], 0.01 * band, 1e-12) << "band " << band;
  }
}

TEST_F(SceneBuilder, ScalesLightsToTheirLevels) {
  const BuiltScene built = build();
  const Eigen::VectorXd& widths = built.scene.grid.widths_nm();
  const DirectionalLight& sun = built.scene.directional_lights.at(0);
  EXPECT_NEAR(sun.normal_irradiance.dot(widths), 70.0, 1e-10);
  EXPECT_EQ(sun.normal_irradiance[0], 0.0) << "350 nm lies outside the table";
  EXPECT_NEAR(sun.half_angle_rad, 0.5 * std::numbers::pi / 180.0, 1e-16);
  // A radiance of 4 is an exitance of 4π.
  EXPECT_NEAR(built.scene.objects[1].exitance.dot(widths), 4.0 * std::numbers::pi, 1e-10);
  EXPECT_FALSE(built.scene.objects[0].emits());
  ASSERT_TRUE(built.scene.sky);
  EXPECT_EQ(built.scene.sky->radiance[3], 0.25) << "absolute without a level";
}

TEST_F(SceneBuilder, WarnsWhereTheTableOfALightEnds) {
  const BuiltScene built = build();
  EXPECT_THAT(built.warnings,
              testing::Contains(testing::AllOf(HasSubstr("light.sun.spectrum"), HasSubstr("light.csv"))));
}

TEST_F(SceneBuilder, ListsItsInputsOnce) {
  const BuiltScene built = build("mesh = \"sheet.obj\"\nmaterial = \"grey\"\nremesh = \"none\"\nsides = \"two\"",
                                 "mesh = \"cube.obj\"\nmaterial = \"grey\"\nremesh = \"none\"");
  std::vector<std::string> names;
  for (const InputFile& input : built.inputs) {
    names.push_back(input.path.filename().string());
    EXPECT_EQ(input.sha256.size(), 64U);
  }
  EXPECT_EQ(names, (std::vector<std::string>{"ramp.csv", "cube.obj", "light.csv"}));
}

TEST_F(SceneBuilder, RefusesBadContentWithBothPlaces) {
  const auto refusal = [&](const std::string& from, const std::string& to, const std::string& line_and_key,
                           const std::string& content) {
    EXPECT_THAT(message(from, to), testing::AllOf(HasSubstr("scene.toml:" + line_and_key + ": "), HasSubstr(content)));
  };
  write("bad.obj", "v 0 0 0\nv 1 0 0\n");
  write("bad.csv", "wavelength_nm,r\n400,0.5\n390,0.5\n");
  write("high.csv", "wavelength_nm,r\n400,0.5\n700,0.9\n");
  write("dark.csv", "wavelength_nm,e\n800,1\n900,1\n");
  write("negative.csv", "wavelength_nm,e\n400,1\n500,-1\n600,1\n");
  refusal("mesh = \"cube.obj\"", "mesh = \"bad.obj\"", "7: object.cube.mesh", "bad.obj");
  refusal("\"ramp.csv\"", "\"bad.csv\"", "5: material.ramp.reflectance", "bad.csv");
  refusal("\"ramp.csv\"", "\"high.csv\"\nscale = 1.5", "4: material.ramp", "scale 1.5");
  refusal("\"light.csv\"", "\"dark.csv\"", "22: light.sun.spectrum", "zero in all bands");
  refusal("\"light.csv\"", "\"negative.csv\"", "22: light.sun.spectrum", "negative");
  refusal("\"light.csv\"", "\"light.csv\"\nspectrum_column = \"x\"", "22: light.sun.spectrum", "x");
  refusal("mesh = \"sheet.obj\"", "mesh = \"cube.obj\"", "15: object.lamp.mesh", "one-sided");
}

}  // namespace
}  // namespace interglow::scene
