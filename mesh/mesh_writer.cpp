// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/mesh_writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <iterator>

#include "diagnostics/error.h"
#include "files/atomic_file.h"

namespace interglow::mesh {
namespace {

template <class T>
void append_little_endian(std::string& bytes, T value) {
  auto raw = std::bit_cast<std::array<char, sizeof(T)>>(value);
  if constexpr (std::endian::native == std::endian::big) std::reverse(raw.begin(), raw.end());
  bytes.append(raw.data(), raw.size());
}

std::string ply_bytes(const TriangleMesh& mesh, const std::string& comment) {
  std::string bytes = "ply\nformat binary_little_endian 1.0\n";
  if (!comment.empty()) bytes += "comment " + comment + "\n";
  bytes += fmt::format(
      "comment unit mm\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\n"
      "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
      mesh.points.size(), mesh.triangles.size());
  bytes.reserve(bytes.size() + 24 * mesh.points.size() + 13 * mesh.triangles.size());
  for (const Eigen::Vector3d& point : mesh.points) {
    for (const double coordinate : point) append_little_endian(bytes, coordinate);
  }
  for (const auto& triangle : mesh.triangles) {
    bytes += '\3';
    for (const int corner : triangle) append_little_endian(bytes, static_cast<std::int32_t>(corner));
  }
  return bytes;
}

std::string obj_text(const TriangleMesh& mesh, const std::string& comment) {
  std::string text;
  const auto out = std::back_inserter(text);
  if (!comment.empty()) fmt::format_to(out, "# {}\n", comment);
  fmt::format_to(out, "# unit mm\n");
  for (const Eigen::Vector3d& p : mesh.points) fmt::format_to(out, "v {} {} {}\n", p.x(), p.y(), p.z());
  for (const auto& [a, b, c] : mesh.triangles) fmt::format_to(out, "f {} {} {}\n", a + 1, b + 1, c + 1);
  return text;
}

}  // namespace

void write_mesh(const std::filesystem::path& path, const TriangleMesh& mesh, const std::string& comment) {
  std::string line = comment;
  std::replace(line.begin(), line.end(), '\n', ' ');
  if (path.extension() == ".ply") {
    files::write_text_atomically(path, ply_bytes(mesh, line));
  } else if (path.extension() == ".obj") {
    files::write_text_atomically(path, obj_text(mesh, line));
  } else {
    throw InvalidInput(
        fmt::format("{}: meshes are written as .ply or .obj. Choose one of these extensions.", path.string()));
  }
}

}  // namespace interglow::mesh
