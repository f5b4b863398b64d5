// SPDX-License-Identifier: GPL-3.0-or-later
#include "scene/scene_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "diagnostics/error.h"
#include "diagnostics/suggestion.h"
#include "scene/key_reader.h"
#include "scene/toml_tree.h"
#include "spectral/shipped_tables.h"

namespace interglow::scene {
namespace {

namespace fs = std::filesystem;

/// The file that a key names: relative to the scene file, or a shipped table.
fs::path existing_file(const KeyReader& keys, std::string_view key, const std::string& text, const fs::path& folder) {
  fs::path path;
  try {
    path = spectral::find_table(text, folder);
  } catch (const InvalidInput& error) {
    keys.fail(key, error.what());
  }
  std::error_code error;
  if (!fs::is_regular_file(path, error)) {
    keys.fail(key,
              fmt::format("\"{}\" was not found ({}); expected a file, named relative to the folder of the scene file. "
                          "Correct the path.",
                          text, path.lexically_normal().string()));
  }
  return path.lexically_normal();
}

/// A number for all wavelengths, or a table's name with the column in `<key>_column`.
SpectrumSource read_spectrum(KeyReader& keys, std::string_view key, const Range& range, const fs::path& folder) {
  SpectrumSource source;
  source.place = keys.place(key);
  const std::string column_key = std::string(key) + "_column";
  const TomlNode* node = keys.find(key);
  const auto column = keys.find_text(column_key);
  if (node == nullptr) keys.fail_missing(key, "a number, or the name of a table in quotes");
  if (const auto* text = std::get_if<std::string>(&node->value)) {
    source.file = existing_file(keys, key, *text, folder);
    source.column = column.value_or("");
    return source;
  }
  if (!std::holds_alternative<std::int64_t>(node->value) && !std::holds_alternative<double>(node->value)) {
    keys.fail_value(key, *node, range.text() + ", or the name of a table in quotes");
  }
  source.constant = keys.find_number(key, range);
  if (column)
    keys.fail(column_key, fmt::format("\"{}\" names a column, but {} is a number. Remove one of them.", *column, key));
  return source;
}

spectral::WavelengthGrid read_grid(KeyReader& file) {
  auto keys = file.find_table("wavelengths");
  if (!keys) return spectral::WavelengthGrid::uniform(350.0, 700.0, 5.0);
  const auto centers = keys->find_numbers("centers_nm", kPositive);
  const auto first = keys->find_number("first_nm", kPositive);
  const auto last = keys->find_number("last_nm", kPositive);
  const auto step = keys->find_number("step_nm", kPositive);
  keys->finish();
  if (centers && (first || last || step)) {
    keys->fail("centers_nm", "is given together with first_nm, last_nm or step_nm. Keep one of the two ways.");
  }
  try {
    if (centers)
      return spectral::WavelengthGrid::from_centers(
          Eigen::Map<const Eigen::VectorXd>(centers->data(), static_cast<Eigen::Index>(centers->size())));
    return spectral::WavelengthGrid::uniform(first.value_or(350.0), last.value_or(700.0), step.value_or(5.0));
  } catch (const InvalidParams& error) {
    keys->fail(centers ? "centers_nm" : "", error.what());
  }
}

MaterialDescription read_material(const std::string& name, KeyReader& keys, const fs::path& folder) {
  MaterialDescription material;
  material.name = name;
  material.place = keys.place();
  const bool reflects = keys.find("reflectance") != nullptr;
  const auto donaldson = keys.find_text("donaldson");
  if (reflects)
    material.reflectance = read_spectrum(keys, "reflectance", Range{0.0, 1.0}, folder);
  else
    keys.find("reflectance_column");
  material.scale = keys.find_number("scale", Range{0.0, 100.0}).value_or(1.0);
  const auto rows = keys.find_choice("donaldson_rows", {"emission", "excitation"});
  const auto keep_anti_stokes = keys.find_bool("keep_anti_stokes");
  const auto keep_noise = keys.find_bool("keep_noise");
  spectral::DonaldsonFileParams& params = material.donaldson_params;
  if (rows)
    params.orientation = *rows == 0 ? spectral::Orientation::kEmissionRows : spectral::Orientation::kExcitationRows;
  params.resample.keep_anti_stokes = keep_anti_stokes.value_or(false);
  params.resample.keep_noise = keep_noise.value_or(false);
  keys.finish();
  if (reflects == donaldson.has_value()) {
    keys.fail(
        "", reflects
                ? "has both \"reflectance\" and \"donaldson\"; a Donaldson matrix contains the reflectance. Remove one."
                : "has neither \"reflectance\" nor \"donaldson\"; expected one of them. Add it.");
  }
  for (const auto& [key, given] : {std::pair<const char*, bool>{"donaldson_rows", rows.has_value()},
                                   {"keep_anti_stokes", keep_anti_stokes.has_value()},
                                   {"keep_noise", keep_noise.has_value()}}) {
    if (given && !donaldson) keys.fail(key, "says how a Donaldson matrix is read, but there is none. Remove it.");
  }
  if (donaldson) {
    material.donaldson = existing_file(keys, "donaldson", *donaldson, folder);
    material.place = keys.place("donaldson");
  }
  return material;
}

template <typename Named>
int index_of(const KeyReader& keys, std::string_view key, const std::string& name, const std::vector<Named>& all,
             const char* table) {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (all[i].name == name) return static_cast<int>(i);
    names.push_back(all[i].name);
  }
  const auto nearest = nearest_word(name, names);
  keys.fail(key, fmt::format("\"{}\" is not defined in this file. {}", name,
                             nearest ? "Did you mean \"" + *nearest + "\"?"
                                     : fmt::format("Add a table [{}.{}].", table, name)));
}

Eigen::Affine3d read_transform(KeyReader& keys) {
  const double scale = keys.find_number("scale", kPositive).value_or(1.0);
  const auto axis = keys.find_vector("rotate_axis");
  const auto angle = keys.find_number("rotate_deg", Range{-360.0, 360.0});
  const auto translate = keys.find_vector("translate_mm");
  if (angle && !axis) keys.fail("rotate_deg", "needs \"rotate_axis\", three numbers. Add it.");
  if (axis && !angle) keys.fail("rotate_axis", "needs \"rotate_deg\", the angle about it. Add it.");
  if (axis && !(axis->norm() > 0.0)) keys.fail("rotate_axis", "is [0, 0, 0], expected a direction.");
  Eigen::Affine3d transform = Eigen::Affine3d::Identity();
  if (translate) transform.translate(*translate);
  if (axis) transform.rotate(Eigen::AngleAxisd(*angle * std::numbers::pi / 180.0, axis->normalized()));
  transform.scale(scale);
  return transform;
}

ObjectDescription read_object(const std::string& name, KeyReader& keys, const SceneDescription& scene,
                              const fs::path& folder) {
  ObjectDescription object;
  object.name = name;
  object.place = keys.place("mesh");
  const auto mesh = keys.require("mesh", keys.find_text("mesh"), "the name of an OBJ, PLY, STL or OFF file in quotes");
  object.mesh = existing_file(keys, "mesh", mesh, folder);
  object.unit_mm = keys.find_number("unit_mm", kPositive).value_or(1.0);
  const auto material =
      keys.require("material", keys.find_text("material"), "the name of a material of this file in quotes");
  object.material = index_of(keys, "material", material, scene.materials, "material");
  object.sides = keys.find_choice("sides", {"one", "two"}).value_or(0) == 0 ? Sides::kOne : Sides::kTwo;
  object.smooth = keys.find_choice("shading", {"smooth", "flat"}).value_or(0) == 0;
  object.reverse = keys.find_bool("reverse").value_or(false);
  object.world_from_mesh = read_transform(keys);
  const auto remesh = keys.find_choice("remesh", {"none", "adaptive"});
  object.remesh = remesh.value_or(1) == 0 ? RemeshKind::kNone : RemeshKind::kAdaptive;
  object.patches = keys.find_integer("patches", 4, 10'000'000);
  object.edge_length_mm = keys.find_number("edge_length_mm", kPositive);
  object.subdivide_mm = keys.find_number("subdivide_mm", kPositive);
  object.follow_contacts = keys.find_bool("follow_contacts").value_or(false);
  object.noise_mm = keys.find_number("noise_mm", kNotNegative);
  const auto feature_angle = keys.find_number("feature_angle_deg", Range{0.0, 180.0, true});
  object.feature_angle_deg = feature_angle.value_or(object.feature_angle_deg);
  object.near_edge_ratio = keys.find_number("near_edge_ratio", Range{0.0, 1.0, true}).value_or(object.near_edge_ratio);
  object.close_holes_mm = keys.find_number("close_holes_mm", kNotNegative).value_or(0.0);
  object.close_contact_mm = keys.find_number("close_contact_mm", kNotNegative).value_or(0.0);
  keys.finish();
  if (object.patches && object.edge_length_mm)
    keys.fail("patches", "is given together with \"edge_length_mm\". Keep one of them.");
  if (object.subdivide_mm && object.remesh != RemeshKind::kNone) {
    keys.fail("subdivide_mm",
              "cuts the triangles of the file as they are, which remesh = \"none\" asks for. Set that, or give "
              "\"edge_length_mm\" instead.");
  }
  if (object.remesh == RemeshKind::kNone) {
    if (object.patches || object.edge_length_mm) {
      keys.fail("remesh",
                "is \"none\", which keeps the triangles of the file, but a patch count or edge length is given. Remove "
                "one of them, or give \"subdivide_mm\".");
    }
    // Given triangles are the surface itself unless smooth shading is asked for.
    if (keys.find("shading") == nullptr) object.smooth = false;
  }
  return object;
}

void read_light_level(KeyReader& keys, LightDescription& light, std::initializer_list<std::string_view> level_keys) {
  std::string_view given;
  for (const std::string_view key : level_keys) {
    const auto level = keys.find_number(key, kPositive);
    if (!level) continue;
    if (light.integral) keys.fail(key, fmt::format("is given together with \"{}\". Keep one of them.", given));
    light.integral = level;
    light.integral_is_radiance = key.starts_with("radiance");
    given = key;
  }
}

LightDescription read_light(const std::string& name, KeyReader& keys, const SceneDescription& scene,
                            const fs::path& folder) {
  LightDescription light;
  light.name = name;
  light.place = keys.place();
  const std::vector<std::string> kinds = {"directional", "surface", "sky"};
  light.kind = static_cast<LightKind>(
      keys.require("kind", keys.find_choice("kind", kinds), "\"directional\", \"surface\" or \"sky\""));
  light.spectrum = read_spectrum(keys, "spectrum", kPositive, folder);
  switch (light.kind) {
    case LightKind::kDirectional: {
      read_light_level(keys, light, {"irradiance_W_m2"});
      const Eigen::Vector3d direction =
          keys.require("direction", keys.find_vector("direction"), "three numbers, the way the light travels");
      if (!(direction.norm() > 0.0)) keys.fail("direction", "is [0, 0, 0], expected the way the light travels.");
      light.direction = direction.normalized();
      light.half_angle_deg = keys.find_number("half_angle_deg", Range{0.0, 30.0}).value_or(0.0);
      break;
    }
    case LightKind::kSurface: {
      read_light_level(keys, light, {"exitance_W_m2", "radiance_W_m2_sr"});
      const auto object =
          keys.require("object", keys.find_text("object"), "the name of an object of this file in quotes");
      light.object = index_of(keys, "object", object, scene.objects, "object");
      break;
    }
    case LightKind::kSky:
      read_light_level(keys, light, {"radiance_W_m2_sr"});
      break;
  }
  keys.finish();
  return light;
}

/// Bands whose centre lies in [first, last].
void choose_bands(KeyReader& keys, const spectral::WavelengthGrid& grid, Camera& camera) {
  const auto first = keys.find_number("first_nm", kPositive);
  const auto last = keys.find_number("last_nm", kPositive);
  const double from = first.value_or(400.0) - 1e-9;
  const double to = last.value_or(700.0) + 1e-9;
  camera.first_band = -1;
  for (int band = 0; band < static_cast<int>(grid.size()); ++band) {
    if (grid.center_nm(band) < from || grid.center_nm(band) > to) continue;
    if (camera.first_band < 0) camera.first_band = band;
    camera.last_band = band;
  }
  const std::string_view key = first ? "first_nm" : "last_nm";
  const std::string range = fmt::format("the bands of the scene are {} nm to {} nm. Change it, or [wavelengths]",
                                        grid.center_nm(0), grid.center_nm(grid.size() - 1));
  if (camera.first_band < 0) keys.fail(key, fmt::format("no band lies within {} to {} nm; {}.", from, to, range));
  if (first && grid.lower_edge_nm(0) > *first + 1e-9) keys.fail("first_nm", fmt::format("{}, but {}.", *first, range));
  if (last && grid.upper_edge_nm(grid.size() - 1) < *last - 1e-9)
    keys.fail("last_nm", fmt::format("{}, but {}.", *last, range));
}

Camera read_camera(KeyReader& file, const spectral::WavelengthGrid& grid) {
  auto keys = file.find_table("camera");
  if (!keys) file.fail_missing("camera", "a table [camera] with position_mm, target_mm and horizontal_fov_deg");
  Camera camera;
  camera.position = keys->require("position_mm", keys->find_vector("position_mm"), "three numbers");
  camera.target = keys->require("target_mm", keys->find_vector("target_mm"), "three numbers");
  camera.up = keys->find_vector("up").value_or(camera.up);
  camera.horizontal_fov_deg =
      keys->require("horizontal_fov_deg", keys->find_number("horizontal_fov_deg", Range{0.0, 180.0, true, true}),
                    "an angle above 0 and below 180");
  camera.width = keys->find_integer("width_px", 1, 65536).value_or(camera.width);
  camera.height = keys->find_integer("height_px", 1, 65536).value_or(camera.height);
  choose_bands(*keys, grid, camera);
  keys->finish();
  const Eigen::Vector3d forward = camera.target - camera.position;
  if (!(forward.norm() > 0.0)) keys->fail("target_mm", "is the same point as position_mm. Move one of them.");
  if (!(forward.cross(camera.up).norm() > 1e-9 * forward.norm() * camera.up.norm())) {
    keys->fail("up", "is parallel to the viewing direction (or zero). Choose another direction.");
  }
  return camera;
}

SolveDescription read_solve(KeyReader& file) {
  SolveDescription solve;
  auto keys = file.find_table("solve");
  if (!keys) return solve;
  const TomlNode* bounces = keys->find("bounces");
  if (bounces != nullptr) {
    if (const auto* word = std::get_if<std::string>(&bounces->value)) {
      if (*word != "inf") keys->fail_value("bounces", *bounces, "a whole number from 0 to 10000, or \"inf\"");
    } else {
      solve.bounces = keys->find_integer("bounces", 0, 10000);
    }
  }
  solve.tolerance = keys->find_number("tolerance", Range{1e-15, 1e-2}).value_or(solve.tolerance);
  solve.max_iterations = keys->find_integer("max_iterations", 1, 1'000'000).value_or(solve.max_iterations);
  solve.form_factor_tolerance =
      keys->find_number("form_factor_tolerance", Range{1e-12, 0.1}).value_or(solve.form_factor_tolerance);
  solve.occlusion = keys->find_bool("occlusion").value_or(solve.occlusion);
  solve.smooth_closure = keys->find_bool("smooth_closure").value_or(solve.smooth_closure);
  solve.model =
      keys->find_choice("model", {"exact", "paper"}).value_or(0) == 0 ? LightModel::kExact : LightModel::kPaper;
  keys->finish();
  return solve;
}

RenderDescription read_render(KeyReader& file) {
  RenderDescription render;
  auto keys = file.find_table("render");
  if (!keys) return render;
  render.samples_per_side = keys->find_integer("samples_per_side", 1, 64).value_or(render.samples_per_side);
  render.gather_tolerance = keys->find_number("gather_tolerance", Range{1e-9, 0.1}).value_or(render.gather_tolerance);
  keys->finish();
  return render;
}

OutputDescription read_output(KeyReader& file, const Camera& camera) {
  OutputDescription output;
  auto keys = file.find_table("output");
  if (!keys) return output;
  const TomlNode* exposure = keys->find("exposure");
  const auto* word = exposure == nullptr ? nullptr : std::get_if<std::string>(&exposure->value);
  if (word != nullptr && *word != "auto") keys->fail_value("exposure", *exposure, "a number above 0, or \"auto\"");
  if (word == nullptr) output.exposure = keys->find_number("exposure", kPositive);
  output.components = keys->find_bool("components").value_or(output.components);
  output.contact_region_mm = keys->find_number("contact_region_mm", kPositive).value_or(output.contact_region_mm);
  output.split_li = keys->find_bool("split_li").value_or(output.split_li);
  if (const TomlNode* pixels = keys->find("spectra_px")) {
    const std::string expected =
        fmt::format("a list of [column, row], 0 to {} and 0 to {}", camera.width - 1, camera.height - 1);
    const auto* list = std::get_if<std::vector<TomlNode>>(&pixels->value);
    if (list == nullptr) keys->fail_value("spectra_px", *pixels, expected);
    for (const TomlNode& entry : *list) {
      const auto* pair = std::get_if<std::vector<TomlNode>>(&entry.value);
      const auto coordinate = [&](std::size_t i, int size) {
        const auto* whole =
            pair != nullptr && pair->size() == 2 ? std::get_if<std::int64_t>(&(*pair)[i].value) : nullptr;
        if (whole == nullptr || *whole < 0 || *whole >= size) keys->fail_value("spectra_px", entry, expected);
        return static_cast<int>(*whole);
      };
      output.spectra_px.push_back({coordinate(0, camera.width), coordinate(1, camera.height)});
    }
  }
  keys->finish();
  return output;
}

SceneDescription read_description(const TomlNode& document, const fs::path& path) {
  KeyReader file(path.string(), "", document);
  const fs::path folder = path.parent_path();
  SceneDescription scene;
  scene.file = path;
  scene.grid = read_grid(file);
  auto materials = file.find_table("material");
  auto objects = file.find_table("object");
  auto lights = file.find_table("light");
  scene.camera = read_camera(file, scene.grid);
  scene.solve = read_solve(file);
  scene.render = read_render(file);
  scene.output = read_output(file, scene.camera);
  file.finish();
  const auto empty = [](const auto& tables) { return !tables || tables->empty(); };
  if (empty(materials)) file.fail_missing("material", "at least one table [material.NAME]");
  if (empty(objects)) file.fail_missing("object", "at least one table [object.NAME]");
  if (empty(lights)) file.fail_missing("light", "at least one table [light.NAME]; without light everything is black");
  for (auto& [name, keys] : materials->all_tables()) scene.materials.push_back(read_material(name, keys, folder));
  for (auto& [name, keys] : objects->all_tables()) scene.objects.push_back(read_object(name, keys, scene, folder));
  for (auto& [name, keys] : lights->all_tables()) {
    scene.lights.push_back(read_light(name, keys, scene, folder));
    const LightDescription& added = scene.lights.back();
    for (std::size_t i = 0; i + 1 < scene.lights.size(); ++i) {
      const LightDescription& other = scene.lights[i];
      if (added.kind == LightKind::kSky && other.kind == LightKind::kSky) {
        keys.fail(
            "kind",
            fmt::format("\"sky\", but \"{}\" is a sky already; expected one at most. Add their radiances in one table.",
                        other.name));
      }
      if (added.kind == LightKind::kSurface && other.object == added.object && other.kind == LightKind::kSurface) {
        keys.fail("object", fmt::format("\"{}\" emits already as light \"{}\"; expected one light a surface.",
                                        scene.objects[static_cast<std::size_t>(added.object)].name, other.name));
      }
    }
  }
  return scene;
}

}  // namespace

SceneDescription read_scene_file(const fs::path& path) { return read_description(read_toml(path), path); }

SceneDescription parse_scene(std::string_view text, const fs::path& path) {
  return read_description(parse_toml(text, path.string()), path);
}

}  // namespace interglow::scene
