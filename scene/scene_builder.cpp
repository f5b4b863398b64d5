// SPDX-License-Identifier: GPL-3.0-or-later
#include "scene/scene_builder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "files/sha256.h"
#include "mesh/subdivide.h"
#include "scene/contact_faces.h"
#include "scene/corner_normals.h"
#include "spectral/donaldson_file.h"
#include "spectral/spectrum_file.h"

namespace interglow::scene {
namespace {

/// Runs `load`; a complaint about a file's content is preceded by the line of the scene file that names it.
template <typename Load>
auto at_place(const std::string& place, const Load& load) {
  try {
    return load();
  } catch (const InvalidInput& error) {
    throw InvalidInput(place + ": " + error.what());
  } catch (const InvalidParams& error) {
    throw InvalidInput(place + ": " + error.what());
  }
}

class Builder {
 public:
  Builder(const SceneDescription& description, const Progress& progress)
      : description_(description), progress_(progress) {}

  BuiltScene build() {
    if (std::filesystem::exists(description_.file)) note_input(description_.file);
    Scene& scene = built_.scene;
    scene.grid = description_.grid;
    scene.camera = description_.camera;
    for (const MaterialDescription& material : description_.materials)
      scene.materials.push_back(load_material(material));
    load_objects();
    for (const LightDescription& light : description_.lights) add_light(light);
    at_place(description_.file.string(), [&] { validate(scene); });
    return std::move(built_);
  }

 private:
  void note_input(const std::filesystem::path& path) {
    const auto known = [&](const InputFile& input) { return input.path == path; };
    if (std::none_of(built_.inputs.begin(), built_.inputs.end(), known)) {
      built_.inputs.push_back({path, files::sha256_of_file(path)});
    }
  }

  void add_warnings(const std::string& place, const Warnings& warnings) {
    for (const std::string& warning : warnings) built_.warnings.push_back(place + ": " + warning);
  }

  spectral::Material load_material(const MaterialDescription& described) {
    const spectral::WavelengthGrid& grid = description_.grid;
    spectral::Material material;
    material.name = described.name;
    if (!described.reflectance) {
      note_input(described.donaldson);
      const auto reading = at_place(described.place, [&] {
        return spectral::read_donaldson(described.donaldson, grid, described.donaldson_params);
      });
      add_warnings(described.place, reading.warnings);
      material.donaldson = reading.donaldson;
    } else if (described.reflectance->constant) {
      material.donaldson.reflectance = Eigen::VectorXd::Constant(grid.size(), *described.reflectance->constant);
    } else {
      const SpectrumSource& source = *described.reflectance;
      note_input(source.file);
      const auto reading =
          at_place(source.place, [&] { return spectral::read_reflectance(source.file, source.column, grid); });
      add_warnings(source.place, reading.warnings);
      material.donaldson = reading.donaldson;
    }
    material.donaldson.reflectance *= described.scale;
    material.donaldson.luminescence *= described.scale;
    Eigen::Index band = 0;
    const double largest = material.donaldson.reflectance.maxCoeff(&band);
    if (largest > 1.0) {
      throw InvalidInput(
          fmt::format("{}: with scale {} the reflectance is {} at {} nm, expected at most 1. Lower the scale.",
                      described.place, described.scale, largest, grid.center_nm(band)));
    }
    add_warnings(described.place, at_place(described.place, [&] { return spectral::validate(material, grid); }));
    return material;
  }

  /// Reads, repairs and transforms one mesh.
  mesh::RemeshInput load_scan(const ObjectDescription& described) {
    note_input(described.mesh);
    mesh::ScanFile scan =
        at_place(described.place, [&] { return mesh::read_scan(described.mesh, {.mm_per_unit = described.unit_mm}); });
    add_warnings(described.place, scan.report.warnings);
    ObjectReport report{
        .name = described.name, .file = described.mesh, .read = scan.report, .repair = {}, .remesh = {}};
    mesh::RemeshInput input{.name = described.name, .scan = std::move(scan.mesh), .params = {}};
    if (described.remesh == RemeshKind::kNone) {
      input.params.keep_triangles = true;
    } else {
      mesh::Repaired repaired = at_place(described.place, [&] { return mesh::repair(std::move(input.scan)); });
      add_warnings(described.place, repaired.report.warnings);
      report.repair = std::move(repaired.report);
      input.scan = std::move(repaired.mesh);
      input.params = {.keep_triangles = false,
                      .patches = described.patches,
                      .edge_length_mm = described.edge_length_mm,
                      .feature_angle_deg = described.feature_angle_deg,
                      .noise_sigma_mm = described.noise_mm,
                      .proximity_ratio = described.near_edge_ratio,
                      .close_holes_mm = described.close_holes_mm,
                      .close_contact_mm = described.close_contact_mm};
    }
    // A closed piece has been turned outward by now, so that `reverse` makes a room of it.
    if (described.reverse) {
      for (auto& triangle : input.scan.triangles) std::swap(triangle[1], triangle[2]);
    }
    for (Eigen::Vector3d& point : input.scan.points) point = described.world_from_mesh * point;
    built_.objects.push_back(std::move(report));
    return input;
  }

  void warn_of_crossings(const ObjectDescription& described, const mesh::RemeshReport& report) {
    if (report.crossings == 0) return;
    built_.warnings.push_back(fmt::format(
        "{}: {} of the object's own patches pass through each other where the scan has folds, tunnels or inner walls "
        "smaller than a patch of {:.3g} mm; light near them is not reliable. Ask for more patches, or clean the scan.",
        described.place, report.crossings == 1 ? "one pair" : fmt::format("{} pairs", report.crossings),
        report.edge_length_mm));
  }

  void load_objects() {
    std::vector<mesh::RemeshInput> inputs;
    for (const ObjectDescription& object : description_.objects) {
      progress_.update("reading meshes",
                       static_cast<double>(inputs.size()) / static_cast<double>(description_.objects.size()));
      inputs.push_back(load_scan(object));
    }
    std::vector<mesh::Remeshed> remeshed =
        at_place(description_.file.string(), [&] { return mesh::remesh(inputs, progress_); });
    for (std::size_t o = 0; o < remeshed.size(); ++o) {
      const ObjectDescription& described = description_.objects[o];
      Object object;
      object.name = described.name;
      object.material = described.material;
      object.sides = described.sides;
      object.patches = std::move(remeshed[o].patches);
      if (!described.smooth) object.patches.corner_normals.clear();
      if (described.smooth && object.patches.corner_normals.empty()) {
        object.patches.corner_normals = corner_normals(object.patches, described.feature_angle_deg);
      }
      if (described.subdivide_mm) {
        object.patches =
            at_place(described.place, [&] { return mesh::subdivide(object.patches, *described.subdivide_mm); });
        remeshed[o].report.patches = static_cast<int>(object.patches.faces.size());
        remeshed[o].report.edge_length_mm = *described.subdivide_mm;
      }
      if (object.patches.closed && object.sides == Sides::kTwo) {
        throw InvalidInput(described.place +
                           ": the mesh is closed, but sides = \"two\"; a closed solid is one-sided. Remove \"sides\".");
      }
      warn_of_crossings(described, remeshed[o].report);
      built_.objects[o].remesh = remeshed[o].report;
      built_.scene.objects.push_back(std::move(object));
    }
    follow_contacts();
  }

  /// Every object is cut by the others as they were before.
  void follow_contacts() {
    std::vector<mesh::PatchMesh> cut;
    for (std::size_t o = 0; o < description_.objects.size(); ++o) {
      const ObjectDescription& described = description_.objects[o];
      cut.push_back(described.follow_contacts ? scene::follow_contacts(built_.scene, o, 0) : mesh::PatchMesh{});
    }
    for (std::size_t o = 0; o < cut.size(); ++o) {
      if (!description_.objects[o].follow_contacts) continue;
      built_.scene.objects[o].patches = std::move(cut[o]);
      built_.objects[o].remesh.patches = static_cast<int>(built_.scene.objects[o].patches.faces.size());
    }
  }

  /// The spectrum on the grid, scaled to the level if one is given.
  Eigen::VectorXd load_light_spectrum(const LightDescription& light) {
    const spectral::WavelengthGrid& grid = description_.grid;
    Eigen::VectorXd bands;
    if (light.spectrum.constant) {
      bands = Eigen::VectorXd::Constant(grid.size(), *light.spectrum.constant);
    } else {
      note_input(light.spectrum.file);
      const std::string& place = light.spectrum.place;
      bands = at_place(place, [&] {
        const spectral::Spectrum table = spectral::read_spectrum(light.spectrum.file, light.spectrum.column);
        add_warnings(place, spectral::warn_where_uncovered(table, grid, spectral::Outside::kZero));
        return spectral::band_means(table, grid, spectral::Outside::kZero);
      });
      Eigen::Index least = 0;
      if (bands.minCoeff(&least) < 0.0) {
        throw InvalidInput(fmt::format("{}: {} at {} nm; light cannot be negative. Correct the table.", place,
                                       bands[least], grid.center_nm(least)));
      }
    }
    const double integral = bands.dot(grid.widths_nm());
    if (!(integral > 0.0)) {
      throw InvalidInput(
          fmt::format("{}: the light is zero in all bands ({} to {} nm). Choose a table that covers them.",
                      light.spectrum.place, grid.lower_edge_nm(0), grid.upper_edge_nm(grid.size() - 1)));
    }
    return light.integral ? Eigen::VectorXd(bands * (*light.integral / integral)) : bands;
  }

  void add_light(const LightDescription& light) {
    Eigen::VectorXd spectrum = load_light_spectrum(light);
    switch (light.kind) {
      case LightKind::kDirectional:
        built_.scene.directional_lights.push_back(
            {light.name, light.direction, std::move(spectrum), light.half_angle_deg * std::numbers::pi / 180.0});
        break;
      case LightKind::kSurface:
        // Exitance = π × radiance of a diffuse emitter.
        if (light.integral_is_radiance) spectrum *= std::numbers::pi;
        built_.scene.objects[static_cast<std::size_t>(light.object)].exitance = std::move(spectrum);
        break;
      case LightKind::kSky:
        built_.scene.sky = SkyLight{light.name, std::move(spectrum)};
        break;
    }
  }

  const SceneDescription& description_;
  const Progress& progress_;
  BuiltScene built_;
};

}  // namespace

BuiltScene build_scene(const SceneDescription& description, const Progress& progress) {
  return Builder(description, progress).build();
}

}  // namespace interglow::scene
