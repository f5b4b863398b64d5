// SPDX-License-Identifier: GPL-3.0-or-later
/// Writes triangle meshes, whole or not at all.
#pragma once

#include <filesystem>
#include <string>

#include "mesh/triangle_mesh.h"

namespace interglow::mesh {

/// Writes .ply (binary little endian, double coordinates: every bit survives) or .obj (shortest digits that read back
/// as the same doubles), by the extension of `path`; coordinates in mm.
/// @param comment  one line for the file's head, e.g. what made it; may be empty
/// @throws InvalidInput for another extension, or if the file cannot be written
void write_mesh(const std::filesystem::path& path, const TriangleMesh& mesh, const std::string& comment = "");

}  // namespace interglow::mesh
