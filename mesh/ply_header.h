// SPDX-License-Identifier: GPL-3.0-or-later
/// The text at the beginning of a PLY file: which elements follow, how many, and of which properties.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace interglow::mesh::detail {

enum class PlyType { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat32, kFloat64 };

constexpr std::size_t byte_size(PlyType type) {
  constexpr std::size_t kSizes[] = {1, 1, 2, 2, 4, 4, 4, 8};
  return kSizes[static_cast<int>(type)];
}
constexpr bool is_integer(PlyType type) { return type < PlyType::kFloat32; }

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::kFloat32;  ///< of the value, or of a list's entries
  bool is_list = false;
  PlyType count_type = PlyType::kUint8;
};

struct PlyElement {
  std::string name;
  std::size_t count = 0;
  std::vector<PlyProperty> properties;
};

enum class PlyEncoding { kAscii, kLittleEndian, kBigEndian };

struct PlyHeader {
  PlyEncoding encoding = PlyEncoding::kAscii;
  std::vector<PlyElement> elements;
  std::size_t grid_columns = 0;  ///< obj_info num_cols of a range image, 0 if absent
  std::size_t grid_rows = 0;
  std::size_t bytes = 0;  ///< where the data begin
  std::size_t lines = 0;
};

/// @throws InvalidInput for a malformed header, or counts for which the file has too few bytes
PlyHeader read_ply_header(std::string_view bytes, const std::string& name);

}  // namespace interglow::mesh::detail
