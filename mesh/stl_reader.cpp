// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cctype>
#include <cstdint>
#include <cstring>
#include <string>

#include "mesh/polygon_file.h"
#include "mesh/text_cursor.h"
#include "mesh/weld_points.h"

namespace interglow::mesh::detail {
namespace {

constexpr std::size_t kHeaderBytes = 80;
constexpr std::size_t kFirstFacet = kHeaderBytes + 4;
constexpr std::size_t kFacetBytes = 50;  // normal, three points (floats), two bytes of attributes

std::uint32_t little_endian_u32(const char* bytes) {
  std::uint32_t value = 0;
  for (int i = 3; i >= 0; --i) value = value << 8U | static_cast<unsigned char>(bytes[i]);
  return value;
}

bool same_word(std::string_view token, std::string_view lower_case_word) {
  return std::equal(token.begin(), token.end(), lower_case_word.begin(), lower_case_word.end(),
                    [](char a, char b) { return std::tolower(static_cast<unsigned char>(a)) == b; });
}

/// STL has no indices: equal coordinates are the same point.
void weld(PolygonFile& file) {
  file.points_in_file = file.points.size();
  WeldedPoints welded = weld_equal_points(file.points);
  for (int& corner : file.corners) corner = welded.index_of[corner];
  file.points_welded = file.points.size() - welded.points.size();
  file.points = std::move(welded.points);
}

PolygonFile read_binary(std::string_view bytes, std::size_t facets) {
  PolygonFile file;
  file.format = "STL binary";
  file.place_name = "byte";
  file.points.reserve(3 * facets);
  for (std::size_t facet = 0; facet < facets; ++facet) {
    const std::size_t place = kFirstFacet + kFacetBytes * facet;
    const int first = static_cast<int>(file.points.size());
    for (std::size_t corner = 0; corner < 3; ++corner) {
      Eigen::Vector3d point;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        point[static_cast<Eigen::Index>(axis)] =
            std::bit_cast<float>(little_endian_u32(bytes.data() + place + 12 + 12 * corner + 4 * axis));
      }
      file.points.push_back(point);
    }
    file.add_triangle(first, first + 1, first + 2, place);
  }
  weld(file);
  return file;
}

class AsciiReader {
 public:
  AsciiReader(std::string_view text, const std::string& name) : text_(text, {}), name_(name) {}

  PolygonFile read() {
    file_.format = "STL ascii";
    for (std::string_view word = text_.token_across_lines(); !word.empty(); word = text_.token_across_lines()) {
      if (!same_word(word, "solid")) fail(word, "\"solid\"");
      text_.next_line();  // the solid's name
      read_solid();
    }
    weld(file_);
    return std::move(file_);
  }

 private:
  [[noreturn]] void fail(std::string_view found, std::string_view expected) {
    if (found.empty()) {
      throw InvalidInput(
          fmt::format("{}:{}: the file ends where {} was expected, so the rest of it is missing. "
                      "Copy or export it again.",
                      name_, text_.line(), expected));
    }
    throw InvalidInput(fmt::format("{}:{}: \"{}\" stands where {} was expected. Export the STL file again.", name_,
                                   text_.line(), found.substr(0, 40), expected));
  }
  void expect(std::string_view word) {
    const std::string_view found = text_.token_across_lines();
    if (!same_word(found, word)) fail(found, fmt::format("\"{}\"", word));
  }

  void read_solid() {
    for (;;) {
      const std::string_view word = text_.token_across_lines();
      if (same_word(word, "endsolid")) {
        text_.next_line();
        return;
      }
      if (!same_word(word, "facet")) fail(word, "\"facet\" or \"endsolid\"");
      read_facet();
    }
  }

  void read_facet() {
    const std::size_t place = text_.line();
    // The normal is told by the corners; what is written for it is often wrong or not a number.
    expect("normal");
    for (int axis = 0; axis < 3; ++axis) text_.token_across_lines();
    expect("outer");
    expect("loop");
    const int first = static_cast<int>(file_.points.size());
    for (int corner = 0; corner < 3; ++corner) {
      expect("vertex");
      Eigen::Vector3d point;
      for (int axis = 0; axis < 3; ++axis) {
        const std::string_view token = text_.token_across_lines();
        const std::optional<double> value = parse_number(token);
        if (!value) fail(token, "a coordinate (a number with a decimal point)");
        point[axis] = *value;
      }
      file_.points.push_back(point);
    }
    expect("endloop");
    expect("endfacet");
    file_.add_triangle(first, first + 1, first + 2, place);
  }

  TextCursor text_;
  const std::string& name_;
  PolygonFile file_;
};

}  // namespace

PolygonFile read_stl(std::string_view bytes, const std::string& name) {
  const bool has_count = bytes.size() >= kFirstFacet;
  const std::size_t announced = has_count ? little_endian_u32(bytes.data() + kHeaderBytes) : 0;
  const std::size_t expected_bytes = kFirstFacet + kFacetBytes * announced;
  if (has_count && bytes.size() == expected_bytes) return read_binary(bytes, announced);

  // Not a binary file of the right size: ASCII if it begins like one and holds no zero bytes where text would be.
  const std::size_t start = bytes.find_first_not_of(" \t\r\n");
  if (start != std::string_view::npos && same_word(bytes.substr(start, 5), "solid") &&
      bytes.substr(0, 1024).find('\0') == std::string_view::npos) {
    return AsciiReader(bytes, name).read();
  }
  if (!has_count) {
    throw InvalidInput(
        fmt::format("{}: {} bytes are neither an ASCII STL file (which begins with \"solid\") nor a binary one "
                    "(at least 84 bytes). Export it again.",
                    name, bytes.size()));
  }
  if (bytes.size() < expected_bytes || announced == 0) {
    throw InvalidInput(fmt::format(
        "{}: byte {}: the header announces {} facets, but {} bytes follow, room for {}. The file is "
        "cut off, its count is wrong, or it is not an STL file; export it again.",
        name, kHeaderBytes, announced, bytes.size() - kFirstFacet, (bytes.size() - kFirstFacet) / kFacetBytes));
  }
  PolygonFile file = read_binary(bytes, announced);
  file.warnings.push_back(fmt::format("{}: {} bytes after the last of {} facets were ignored.", name,
                                      bytes.size() - expected_bytes, announced));
  return file;
}

}  // namespace interglow::mesh::detail
