// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <string>

#include "mesh/polygon_file.h"
#include "mesh/text_cursor.h"

namespace interglow::mesh::detail {
namespace {

class OffReader {
 public:
  OffReader(std::string_view bytes, const std::string& name) : text_(bytes, {.comments = true}), name_(name) {}

  PolygonFile read() {
    file_.format = "OFF";
    read_keyword();
    const std::size_t points = count("points");
    const std::size_t faces = count("faces");
    if (!text_.token().empty()) text_.next_line();  // the number of edges may be missing
    // A point needs 6 bytes ("0 0 0\n"), a face 2.
    if (points > text_.bytes_left() / 5 || faces > text_.bytes_left() / 2) {
      throw InvalidInput(
          fmt::format("{}: the header announces {} points and {} faces, but only {} bytes follow. The file is cut "
                      "off or its counts are wrong; export it again.",
                      name_, points, faces, text_.bytes_left()));
    }
    file_.points.reserve(points);
    for (std::size_t i = 0; i < points; ++i) read_point();
    for (std::size_t i = 0; i < faces; ++i) read_face();
    text_.next_line();
    const std::string_view left = text_.token_across_lines();
    if (!left.empty()) {
      throw InvalidInput(
          fmt::format("{}:{}: data go on after the {} points and {} faces that the header announces. "
                      "Correct its counts, or export the file again.",
                      name_, text_.line(), points, faces));
    }
    file_.points_in_file = points;
    return std::move(file_);
  }

 private:
  void read_keyword() {
    const std::string_view keyword = text_.token_across_lines();
    if (keyword != "OFF" && keyword != "COFF" && keyword != "NOFF" && keyword != "CNOFF" && keyword != "STOFF" &&
        keyword != "STNOFF" && keyword != "STCOFF" && keyword != "STCNOFF") {
      throw InvalidInput(
          fmt::format("{}:{}: \"{}\" was found where OFF, COFF or NOFF was expected (three-dimensional points). "
                      "Export the mesh as PLY or OBJ.",
                      name_, text_.line(), keyword.substr(0, 20)));
    }
  }

  std::size_t count(std::string_view what) {
    const std::string_view token = text_.token_across_lines();
    if (token == "BINARY") {
      throw InvalidInput(
          fmt::format("{}:{}: binary OFF is not read. Export the mesh as PLY or ASCII OFF.", name_, text_.line()));
    }
    const std::optional<long long> value = parse_integer(token);
    if (!value || *value < 0) fail(token, fmt::format("the number of {}", what));
    return static_cast<std::size_t>(*value);
  }

  [[noreturn]] void fail(std::string_view found, std::string_view expected) {
    if (found.empty() && text_.at_end()) {
      throw InvalidInput(
          fmt::format("{}:{}: the file ends where {} was expected, so the rest of it is missing. "
                      "Copy or export it again.",
                      name_, text_.line(), expected));
    }
    throw InvalidInput(fmt::format("{}:{}: \"{}\" stands where {} was expected. Export the OFF file again.", name_,
                                   text_.line(), found.substr(0, 40), expected));
  }

  /// First token of the next line that is not empty.
  std::string_view begin_line() {
    text_.next_line();
    return text_.token_across_lines();
  }

  void read_point() {
    Eigen::Vector3d point;
    std::string_view token = file_.points.empty() ? text_.token_across_lines() : begin_line();
    for (int axis = 0; axis < 3; ++axis) {
      const std::optional<double> value = parse_number(token);
      if (!value) fail(token, "a coordinate (a number with a decimal point)");
      point[axis] = *value;
      if (axis < 2) token = text_.token();
    }
    file_.points.push_back(point);  // normal, colour and texture coordinates may follow on the line
  }

  void read_face() {
    std::string_view token = begin_line();
    const std::optional<long long> corners = parse_integer(token);
    if (!corners || *corners < 0) fail(token, "a face's number of corners");
    for (long long i = 0; i < *corners; ++i) {
      token = text_.token();
      const std::optional<long long> index = parse_integer(token);
      if (!index) fail(token, "the index of a point");
      file_.corners.push_back(clamped_index(*index));
    }
    file_.end_face(text_.line());
  }

  TextCursor text_;
  const std::string& name_;
  PolygonFile file_;
};

}  // namespace

PolygonFile read_off(std::string_view bytes, const std::string& name) { return OffReader(bytes, name).read(); }

}  // namespace interglow::mesh::detail
