// SPDX-License-Identifier: GPL-3.0-or-later
/// From a scene description to a scene: loads tables and meshes, repairs and remeshes, puts everything on one grid.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "diagnostics/error.h"
#include "diagnostics/progress.h"
#include "mesh/remesh.h"
#include "mesh/repair.h"
#include "mesh/scan_file.h"
#include "scene/scene.h"
#include "scene/scene_file.h"

namespace interglow::scene {

/// What became of one object's mesh file.
struct ObjectReport {
  std::string name;
  std::filesystem::path file;
  mesh::ReadReport read;
  mesh::RepairReport repair;  ///< nothing was repaired with remesh = "none"
  mesh::RemeshReport remesh;
};

/// A file that the result depends on.
struct InputFile {
  std::filesystem::path path;
  std::string sha256;
};

struct BuiltScene {
  Scene scene;                        ///< validated
  std::vector<ObjectReport> objects;  ///< one an object
  std::vector<InputFile> inputs;      ///< scene file, meshes, tables; each once, in the order of use
  Warnings warnings;                  ///< with file and object or key
};

/// Objects are transformed before remeshing, and remeshed together, because patch sizes depend on neighbours.
/// @throws InvalidInput naming the scene file's line and key, and the place within the file it names; Cancelled
/// Cost: that of reading and of mesh::remesh.
BuiltScene build_scene(const SceneDescription& description, const Progress& progress = {});

}  // namespace interglow::scene
