// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string>
#include <utility>

#include "mesh/ply_header.h"
#include "mesh/polygon_file.h"
#include "mesh/range_grid.h"
#include "mesh/text_cursor.h"

namespace interglow::mesh::detail {
namespace {

/// Values of binary data, one after another.
class BinaryValues {
 public:
  static constexpr const char* kPlace = "byte";

  BinaryValues(std::string_view bytes, const PlyHeader& header, const std::string& name)
      : bytes_(bytes),
        position_(header.bytes),
        swap_((header.encoding == PlyEncoding::kBigEndian) != (std::endian::native == std::endian::big)),
        name_(name) {}

  std::size_t place() const { return position_; }
  void begin_element(const PlyElement& element, std::size_t index) {
    element_ = &element;
    index_ = index;
  }
  void end_element() {}

  double number(PlyType type) {
    switch (type) {
      case PlyType::kFloat32:
        return std::bit_cast<float>(load<std::uint32_t>());
      case PlyType::kFloat64:
        return std::bit_cast<double>(load<std::uint64_t>());
      default:
        return static_cast<double>(integer(type));
    }
  }
  long long integer(PlyType type) {
    switch (type) {
      case PlyType::kInt8:
        return static_cast<std::int8_t>(load<std::uint8_t>());
      case PlyType::kUint8:
        return load<std::uint8_t>();
      case PlyType::kInt16:
        return static_cast<std::int16_t>(load<std::uint16_t>());
      case PlyType::kUint16:
        return load<std::uint16_t>();
      case PlyType::kInt32:
        return static_cast<std::int32_t>(load<std::uint32_t>());
      default:
        return load<std::uint32_t>();
    }
  }
  void skip(PlyType type, std::size_t count) {
    if (count > (bytes_.size() - position_) / byte_size(type)) fail_at_end();
    position_ += count * byte_size(type);
  }
  void finish() {
    if (position_ == bytes_.size()) return;
    if (bytes_.substr(position_).find_first_not_of(" \t\r\n") == std::string_view::npos) return;
    throw InvalidInput(
        fmt::format("{}: byte {}: {} bytes are left after the elements that the header announces. Its counts are "
                    "wrong, so what was read cannot be trusted; export the file again.",
                    name_, position_, bytes_.size() - position_));
  }

 private:
  [[noreturn]] void fail_at_end() const {
    throw InvalidInput(fmt::format(
        "{}: byte {}: the file ends inside element \"{}\" number {} of {}, so the rest of it is missing or the "
        "header's counts or types are wrong. Copy or export it again.",
        name_, position_, element_->name, index_ + 1, element_->count));
  }
  template <class T>
  T load() {
    if (bytes_.size() - position_ < sizeof(T)) fail_at_end();
    T value;
    std::memcpy(&value, bytes_.data() + position_, sizeof(T));
    position_ += sizeof(T);
    if (swap_) {
      if constexpr (sizeof(T) == 2) value = __builtin_bswap16(value);
      if constexpr (sizeof(T) == 4) value = __builtin_bswap32(value);
      if constexpr (sizeof(T) == 8) value = __builtin_bswap64(value);
    }
    return value;
  }

  std::string_view bytes_;
  const PlyElement* element_ = nullptr;
  std::size_t index_ = 0;
  std::size_t position_;
  bool swap_;
  const std::string& name_;
};

/// Values of ASCII data: one element a line.
class AsciiValues {
 public:
  static constexpr const char* kPlace = "line";

  AsciiValues(std::string_view bytes, const PlyHeader& header, const std::string& name)
      : text_(bytes.substr(header.bytes), {}, header.lines + 1), name_(name) {}

  std::size_t place() const { return text_.line(); }

  void begin_element(const PlyElement& element, std::size_t index) {
    pending_ = text_.token_across_lines();
    if (pending_.empty()) {
      throw InvalidInput(fmt::format(
          "{}:{}: the file ends before element \"{}\" number {} of {}. It is cut off or its counts are wrong; copy "
          "or export it again.",
          name_, text_.line(), element.name, index + 1, element.count));
    }
  }
  void end_element() {
    const std::string_view token = next();
    if (!token.empty()) fail(token, "the end of the line (the header declares fewer values)");
    text_.next_line();
  }

  double number(PlyType) {
    const std::string_view token = next();
    const std::optional<double> value = parse_number(token);
    if (!value) fail(token, "a number with a decimal point");
    return *value;
  }
  long long integer(PlyType) {
    const std::string_view token = next();
    const std::optional<long long> value = parse_integer(token);
    if (!value) fail(token, "an integer");
    return *value;
  }
  void skip(PlyType type, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) number(type);
  }
  void finish() {
    const std::string_view left = text_.token_across_lines();
    if (left.empty()) return;
    throw InvalidInput(
        fmt::format("{}:{}: data go on after the elements that the header announces. Its counts are wrong, so what "
                    "was read cannot be trusted; export the file again.",
                    name_, text_.line()));
  }

 private:
  std::string_view next() {
    if (!pending_.empty()) return std::exchange(pending_, {});
    return text_.token();
  }
  [[noreturn]] void fail(std::string_view found, std::string_view expected) const {
    throw InvalidInput(
        fmt::format("{}:{}: {} stands where {} was expected. Export the PLY file again.", name_, text_.line(),
                    found.empty() ? "the end of the line" : fmt::format("\"{}\"", found.substr(0, 40)), expected));
  }

  TextCursor text_;
  const std::string& name_;
  std::string_view pending_;
};

enum class ElementRole { kOther, kPoints, kFaces, kStrips, kRangeGrid };

template <class Values>
class PlyReader {
 public:
  PlyReader(Values values, const PlyHeader& header, const std::string& name)
      : values_(values), header_(header), name_(name) {}

  PolygonFile read(double range_grid_edge_ratio) {
    file_.place_name = Values::kPlace;
    bool has_faces = false;
    for (const PlyElement& element : header_.elements) {
      if (element.name == "face" && element.count > 0) has_faces = true;
      if (element.name == "vertex") {
        read_points(element);
      } else if (element.name == "face") {
        read_lists(element, ElementRole::kFaces);
      } else if (element.name == "tristrips") {
        read_lists(element, ElementRole::kStrips);
      } else if (element.name == "range_grid") {
        read_lists(element, ElementRole::kRangeGrid);
      } else {
        for (std::size_t i = 0; i < count_if_stored(element); ++i) {
          values_.begin_element(element, i);
          for (const PlyProperty& property : element.properties) skip(property);
          values_.end_element();
        }
      }
    }
    values_.finish();
    file_.points_in_file = file_.points.size();
    if (!grid_.empty() && !has_faces) triangulate_grid(range_grid_edge_ratio);
    return std::move(file_);
  }

 private:
  /// Elements without properties take no bytes, whatever their count.
  static std::size_t count_if_stored(const PlyElement& element) {
    return element.properties.empty() ? 0 : element.count;
  }

  long long list_length(const PlyProperty& property) {
    const long long length = values_.integer(property.count_type);
    if (length < 0) {
      throw InvalidInput(
          fmt::format("{}: {} {}: a list has the length {}. Reading is out of step with the file: its counts, types "
                      "or byte order are wrong. Export it again.",
                      name_, Values::kPlace, values_.place(), length));
    }
    return length;
  }

  void skip(const PlyProperty& property) {
    values_.skip(property.type, property.is_list ? static_cast<std::size_t>(list_length(property)) : 1);
  }

  void read_points(const PlyElement& element) {
    constexpr std::array<std::string_view, 3> kAxes{"x", "y", "z"};
    std::vector<int> axis_of(element.properties.size(), -1);
    for (int axis = 0; axis < 3; ++axis) {
      const auto found = std::find_if(element.properties.begin(), element.properties.end(),
                                      [&](const PlyProperty& p) { return p.name == kAxes[axis] && !p.is_list; });
      if (found == element.properties.end()) {
        throw InvalidInput(fmt::format(
            "{}: the element \"vertex\" has no property \"{}\". Export the file with x, y and z.", name_, kAxes[axis]));
      }
      axis_of[found - element.properties.begin()] = axis;
    }
    file_.points.reserve(element.count);
    for (std::size_t i = 0; i < element.count; ++i) {
      values_.begin_element(element, i);
      Eigen::Vector3d point;
      for (std::size_t k = 0; k < axis_of.size(); ++k) {
        if (axis_of[k] >= 0) {
          point[axis_of[k]] = values_.number(element.properties[k].type);
        } else {
          skip(element.properties[k]);
        }
      }
      values_.end_element();
      file_.points.push_back(point);
    }
  }

  void read_lists(const PlyElement& element, ElementRole role) {
    const auto indices = std::find_if(element.properties.begin(), element.properties.end(), [](const PlyProperty& p) {
      return p.is_list && (p.name == "vertex_indices" || p.name == "vertex_index");
    });
    if (element.count > 0 && (indices == element.properties.end() || !is_integer(indices->type))) {
      throw InvalidInput(
          fmt::format("{}: the element \"{}\" has no list of integers \"vertex_indices\". Export the file again.",
                      name_, element.name));
    }
    if (role == ElementRole::kFaces) {
      file_.face_begin.reserve(element.count + 1);
      file_.face_place.reserve(element.count);
      file_.corners.reserve(3 * element.count);
    }
    std::vector<int> list;
    for (std::size_t i = 0; i < element.count; ++i) {
      const std::size_t place = values_.place();
      values_.begin_element(element, i);
      for (auto property = element.properties.begin(); property != element.properties.end(); ++property) {
        if (property != indices) {
          skip(*property);
          continue;
        }
        const long long length = list_length(*property);
        std::vector<int>& target = role == ElementRole::kFaces ? file_.corners : list;
        for (long long k = 0; k < length; ++k) target.push_back(clamped_index(values_.integer(property->type)));
      }
      values_.end_element();
      if (role == ElementRole::kFaces) file_.end_face(place);
      if (role == ElementRole::kStrips) add_strips(list, place);
      if (role == ElementRole::kRangeGrid) add_grid_sample(list, place);
      list.clear();
    }
  }

  /// Every corner of a strip makes a triangle with the two before it, every second one turned over; -1 begins a new
  /// strip.
  void add_strips(const std::vector<int>& strip, std::size_t place) {
    std::size_t begin = 0;
    for (std::size_t k = 0; k < strip.size(); ++k) {
      if (strip[k] < 0) {
        begin = k + 1;
      } else if (k >= begin + 2) {
        const bool turned = (k - begin) % 2 == 1;
        const int a = strip[k - (turned ? 1 : 2)];
        const int b = strip[k - (turned ? 2 : 1)];
        // A repeated corner only steers the strip.
        if (a != b && b != strip[k] && a != strip[k]) file_.add_triangle(a, b, strip[k], place);
      }
    }
  }

  void add_grid_sample(const std::vector<int>& cell, std::size_t place) {
    if (cell.size() > 1) {
      throw InvalidInput(
          fmt::format("{}: {} {}: a cell of the range grid holds {} samples, expected 0 or 1. Export it again.", name_,
                      Values::kPlace, place, cell.size()));
    }
    grid_.push_back(cell.empty() ? -1 : cell.front());
  }

  void triangulate_grid(double edge_ratio) {
    if (header_.grid_columns == 0 || header_.grid_rows == 0 || grid_.size() % header_.grid_columns != 0 ||
        grid_.size() / header_.grid_columns != header_.grid_rows) {
      throw InvalidInput(
          fmt::format("{}: a range image of {} cells, but the header says {} columns and {} rows (obj_info num_cols, "
                      "num_rows). Correct them, or triangulate the scan before.",
                      name_, grid_.size(), header_.grid_columns, header_.grid_rows));
    }
    const auto bad =
        std::find_if(grid_.begin(), grid_.end(), [&](int i) { return i >= static_cast<int>(file_.points.size()); });
    if (bad != grid_.end()) {
      throw InvalidInput(
          fmt::format("{}: a cell of the range grid names the sample {}, but there are {}. Export it again.", name_,
                      *bad, file_.points.size()));
    }
    const RangeGridTriangles made = triangulate_range_grid(file_.points, grid_, header_.grid_columns, edge_ratio);
    for (const auto& triangle : made.triangles) file_.add_triangle(triangle[0], triangle[1], triangle[2], 0);
    file_.warnings.push_back(fmt::format(
        "{}: a raw range image of {} x {} cells without faces was triangulated: {} triangles; {} across "
        "depth steps (an edge longer than {:.3g} file units) were left out.",
        name_, header_.grid_columns, header_.grid_rows, made.triangles.size(), made.across_steps, made.longest_edge));
  }

  Values values_;
  const PlyHeader& header_;
  const std::string& name_;
  PolygonFile file_;
  std::vector<int> grid_;
};

}  // namespace

PolygonFile read_ply(std::string_view bytes, const std::string& name, double range_grid_edge_ratio) {
  const PlyHeader header = read_ply_header(bytes, name);
  const bool has_points = std::any_of(header.elements.begin(), header.elements.end(), [](const PlyElement& element) {
    return element.name == "vertex" && element.count > 0;
  });
  if (!has_points) throw InvalidInput(fmt::format("{}: the PLY file has no points (element vertex).", name));
  PolygonFile file;
  if (header.encoding == PlyEncoding::kAscii) {
    file = PlyReader(AsciiValues(bytes, header, name), header, name).read(range_grid_edge_ratio);
    file.format = "PLY ascii";
  } else {
    file = PlyReader(BinaryValues(bytes, header, name), header, name).read(range_grid_edge_ratio);
    file.format = header.encoding == PlyEncoding::kBigEndian ? "PLY binary_big_endian" : "PLY binary_little_endian";
  }
  return file;
}

}  // namespace interglow::mesh::detail
