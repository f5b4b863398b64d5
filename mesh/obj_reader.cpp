// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <limits>
#include <string>

#include "mesh/polygon_file.h"
#include "mesh/text_cursor.h"

namespace interglow::mesh::detail {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// Statements that say nothing about the surface's geometry.
constexpr std::array kIgnored = {"vt",       "vn",       "vp",     "o",          "g",        "s",      "mg",
                                 "l",        "p",        "usemtl", "mtllib",     "usemap",   "maplib", "bevel",
                                 "c_interp", "d_interp", "lod",    "shadow_obj", "trace_obj"};

class ObjReader {
 public:
  ObjReader(std::string_view text, const std::string& name)
      : text_(text, {.comments = true, .continuations = true}), name_(name) {}

  PolygonFile read() {
    file_.format = "OBJ";
    file_.bad_index_is_fatal = false;
    for (; !text_.at_end(); text_.next_line()) {
      statement_line_ = text_.line();
      const std::string_view keyword = text_.token();
      if (keyword.empty()) continue;
      if (keyword == "v") {
        read_point();
      } else if (keyword == "f" || keyword == "fo") {
        read_face();
      } else if (std::find(kIgnored.begin(), kIgnored.end(), keyword) == kIgnored.end()) {
        if (unknown_statements_++ == 0)
          first_unknown_ = fmt::format("\"{}\" in line {}", printable(keyword), statement_line_);
      }
    }
    if (unknown_statements_ > 0) {
      file_.warnings.push_back(fmt::format("{}: {} line(s) that are no polygon data were ignored (first: {}).", name_,
                                           unknown_statements_, first_unknown_));
    }
    if (malformed_points_ > 0) {
      file_.warnings.push_back(fmt::format("{}: {} vertex line(s) cannot be read as three numbers (first: {}).", name_,
                                           malformed_points_, first_malformed_point_));
    }
    if (file_.incomplete_faces > 0) {
      file_.warnings.push_back(
          fmt::format("{}: {} face line(s) with a corner that is not an index were dropped (first: {}).", name_,
                      file_.incomplete_faces, first_malformed_face_));
    }
    file_.points_in_file = file_.points.size();
    return std::move(file_);
  }

 private:
  static std::string printable(std::string_view token) {
    std::string shown(token.substr(0, 40));
    for (char& c : shown) {
      if (!std::isprint(static_cast<unsigned char>(c))) c = '?';
    }
    return shown;
  }

  void refuse_if_cut_off() {
    if (!text_.on_unfinished_line()) return;
    throw InvalidInput(
        fmt::format("{}:{}: the file ends inside this line, so the rest of it is missing. Copy or export it again.",
                    name_, statement_line_));
  }

  void read_point() {
    Eigen::Vector3d point(kNaN, kNaN, kNaN);
    int numbers = 0;
    std::string_view bad;
    for (std::string_view token = text_.token(); !token.empty(); token = text_.token()) {
      if (numbers < 3) {
        const std::optional<double> value = parse_number(token);
        if (!value && bad.empty()) bad = token;
        if (value) point[numbers] = *value;
      }
      ++numbers;
    }
    if (bad.find(',') != std::string_view::npos) {
      throw InvalidInput(
          fmt::format("{}:{}: \"{}\" has a comma, where a number with a decimal point was expected. "
                      "Export the file again with decimal points.",
                      name_, statement_line_, printable(bad)));
    }
    // x y z, then perhaps w, or r g b, or both.
    if (!bad.empty() || numbers < 3 || numbers > 8) {
      refuse_if_cut_off();
      if (malformed_points_++ == 0) {
        first_malformed_point_ = bad.empty() ? fmt::format("{} numbers in line {}", numbers, statement_line_)
                                             : fmt::format("\"{}\" in line {}", printable(bad), statement_line_);
      }
      point.setConstant(kNaN);
    }
    file_.points.push_back(point);
  }

  void read_face() {
    const std::size_t begin = file_.corners.size();
    for (std::string_view token = text_.token(); !token.empty(); token = text_.token()) {
      const std::string_view vertex = token.substr(0, token.find('/'));
      const std::optional<long long> index = parse_integer(vertex);
      const bool rest_is_indices = token.find_first_not_of("0123456789+-/", vertex.size()) == std::string_view::npos;
      if (!index || !rest_is_indices) {
        refuse_if_cut_off();
        if (file_.incomplete_faces++ == 0) {
          first_malformed_face_ = fmt::format("\"{}\" in line {}", printable(token), statement_line_);
        }
        file_.corners.resize(begin);
        return;
      }
      if (*index == 0) {
        throw InvalidInput(
            fmt::format("{}:{}: corner index 0, but OBJ counts points from 1. A program that counts from 0 "
                        "has shifted every other index too; export the file again.",
                        name_, statement_line_));
      }
      file_.corners.push_back(
          *index > 0 ? clamped_index(*index - 1)
                     : clamped_index(static_cast<long long>(file_.points.size()) + std::max(*index, -(1LL << 40))));
    }
    if (file_.corners.size() - begin < 3) refuse_if_cut_off();
    file_.end_face(statement_line_);
  }

  TextCursor text_;
  const std::string& name_;
  PolygonFile file_;
  std::size_t statement_line_ = 1;
  std::size_t unknown_statements_ = 0;
  std::size_t malformed_points_ = 0;
  std::string first_unknown_;
  std::string first_malformed_point_;
  std::string first_malformed_face_;
};

/// UTF-16 text as UTF-8; surrogates become '?', since only names could hold them.
std::string utf8_from_utf16(std::string_view bytes, bool big_endian) {
  std::string text;
  text.reserve(bytes.size() / 2);
  for (std::size_t i = 0; i + 1 < bytes.size(); i += 2) {
    const auto first = static_cast<unsigned char>(bytes[i]);
    const auto second = static_cast<unsigned char>(bytes[i + 1]);
    const unsigned code = big_endian ? first * 256U + second : second * 256U + first;
    if (code < 0x80) {
      text += static_cast<char>(code);
    } else if (code < 0x800) {
      text += static_cast<char>(0xC0U | (code >> 6U));
      text += static_cast<char>(0x80U | (code & 0x3FU));
    } else if (code >= 0xD800 && code < 0xE000) {
      text += '?';
    } else {
      text += static_cast<char>(0xE0U | (code >> 12U));
      text += static_cast<char>(0x80U | ((code >> 6U) & 0x3FU));
      text += static_cast<char>(0x80U | (code & 0x3FU));
    }
  }
  return text;
}

}  // namespace

PolygonFile read_obj(std::string_view bytes, const std::string& name) {
  if (bytes.starts_with("\xFE\xFF")) return ObjReader(utf8_from_utf16(bytes.substr(2), true), name).read();
  if (bytes.starts_with("\xFF\xFE")) return ObjReader(utf8_from_utf16(bytes.substr(2), false), name).read();
  if (bytes.starts_with("\xEF\xBB\xBF")) bytes.remove_prefix(3);
  if (const std::size_t zero = bytes.find('\0'); zero != std::string_view::npos) {
    throw InvalidInput(fmt::format(
        "{}: byte {} is 0, which no OBJ text holds. Is this another kind of file, or a damaged one?", name, zero));
  }
  return ObjReader(bytes, name).read();
}

}  // namespace interglow::mesh::detail
