// SPDX-License-Identifier: GPL-3.0-or-later
/// The scene file (TOML, docs/scene-format.md) as written: checked key by key, nothing loaded yet.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "scene/scene.h"
#include "spectral/donaldson_file.h"
#include "spectral/wavelength_grid.h"

namespace interglow::scene {

/// A spectrum: one number for all wavelengths, or a column of a table.
struct SpectrumSource {
  std::optional<double> constant;
  std::filesystem::path file;  ///< an existing file; empty with a constant
  std::string column;          ///< name of the column; empty: the only or first one
  std::string place;           ///< "file:line: key", for messages about its content
};

struct MaterialDescription {
  std::string name;
  std::optional<SpectrumSource> reflectance;       ///< a material that only reflects; otherwise
  std::filesystem::path donaldson;                 ///< a Donaldson matrix or a table of S, alpha, beta
  spectral::DonaldsonFileParams donaldson_params;  ///< how that file is read
  double scale = 1.0;                              ///< factor on reflectance and luminescence
  std::string place;
};

enum class RemeshKind { kNone, kAdaptive };

struct ObjectDescription {
  std::string name;
  std::filesystem::path mesh;  ///< an existing file
  double unit_mm = 1.0;        ///< length of one unit of the mesh file
  int material = 0;            ///< index into SceneDescription::materials
  Sides sides = Sides::kOne;
  bool smooth = true;    ///< smooth or flat shading
  bool reverse = false;  ///< turn all triangles round: front becomes back
  RemeshKind remesh = RemeshKind::kAdaptive;
  std::optional<int> patches;
  std::optional<double> edge_length_mm;
  std::optional<double> subdivide_mm;  ///< longest edge of the pieces that given triangles are cut into
  bool follow_contacts = false;        ///< faces are cut where other objects touch or cross them
  double feature_angle_deg = 40.0;
  std::optional<double> noise_mm;  ///< standard deviation of the scan; empty: estimated
  double near_edge_ratio = 0.25;   ///< smallest edge length near other objects over the largest
  double close_holes_mm = 0.0;     ///< holes up to this diameter are closed
  double close_contact_mm = 0.0;   ///< strips along contacts up to this width are closed
  Eigen::Affine3d world_from_mesh = Eigen::Affine3d::Identity();  ///< from mm of the mesh to mm of the world
  std::string place;
};

enum class LightKind { kDirectional, kSurface, kSky };

struct LightDescription {
  std::string name;
  LightKind kind = LightKind::kDirectional;
  SpectrumSource spectrum;
  /// Integral over the wavelength grid that the spectrum is scaled to: irradiance on a plane facing the beam, exitance
  /// [W m^-2], or radiance [W m^-2 sr^-1]; empty: the table is absolute, per nm.
  std::optional<double> integral;
  bool integral_is_radiance = false;          ///< of a surface: radiance instead of exitance
  Eigen::Vector3d direction{0.0, 0.0, -1.0};  ///< unit, the way the light travels
  double half_angle_deg = 0.0;
  int object = -1;  ///< of an emitting surface: index into SceneDescription::objects
  std::string place;
};

enum class LightModel { kExact, kPaper };

struct SolveDescription {
  std::optional<int> bounces;  ///< empty: all
  double tolerance = 1e-10;
  int max_iterations = 10000;
  double form_factor_tolerance = 1e-4;
  bool occlusion = true;
  bool smooth_closure = false;
  LightModel model = LightModel::kExact;
};

struct RenderDescription {
  int samples_per_side = 4;
  double gather_tolerance = 1e-3;
};

struct OutputDescription {
  std::optional<double> exposure;  ///< factor from Y to linear sRGB; empty: chosen from the picture
  bool components = true;
  double contact_region_mm = 2.0;  ///< points nearer than this to another object belong to the contact region of w'
  bool split_li = false;           ///< lr and ll beside li
  std::vector<std::array<int, 2>> spectra_px;  ///< column, row
};

struct SceneDescription {
  std::filesystem::path file;
  spectral::WavelengthGrid grid;
  std::vector<MaterialDescription> materials;  ///< in the order of the file, as are objects and lights
  std::vector<ObjectDescription> objects;
  std::vector<LightDescription> lights;
  Camera camera;
  SolveDescription solve;
  RenderDescription render;
  OutputDescription output;
};

/// @throws InvalidInput "file:line: key: value, expected …" for the first mistake; files that are named must exist.
SceneDescription read_scene_file(const std::filesystem::path& path);

/// The same for text in memory; paths in it are relative to the folder of `path`, which need not exist.
SceneDescription parse_scene(std::string_view text, const std::filesystem::path& path);

}  // namespace interglow::scene
