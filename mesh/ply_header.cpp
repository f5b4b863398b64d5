// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/ply_header.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include "diagnostics/error.h"
#include "mesh/text_cursor.h"

namespace interglow::mesh::detail {
namespace {

constexpr std::array<std::pair<std::string_view, PlyType>, 16> kTypeNames{{{"char", PlyType::kInt8},
                                                                           {"int8", PlyType::kInt8},
                                                                           {"uchar", PlyType::kUint8},
                                                                           {"uint8", PlyType::kUint8},
                                                                           {"short", PlyType::kInt16},
                                                                           {"int16", PlyType::kInt16},
                                                                           {"ushort", PlyType::kUint16},
                                                                           {"uint16", PlyType::kUint16},
                                                                           {"int", PlyType::kInt32},
                                                                           {"int32", PlyType::kInt32},
                                                                           {"uint", PlyType::kUint32},
                                                                           {"uint32", PlyType::kUint32},
                                                                           {"float", PlyType::kFloat32},
                                                                           {"float32", PlyType::kFloat32},
                                                                           {"double", PlyType::kFloat64},
                                                                           {"float64", PlyType::kFloat64}}};

class HeaderReader {
 public:
  HeaderReader(std::string_view bytes, const std::string& name) : bytes_(bytes), name_(name) {}

  PlyHeader read() {
    // Only the first line's ending is a header ending: binary data may begin with a newline byte.
    next_line();
    carriage_return_ = line_.ends_with('\r');
    while (read_line()) {
    }
    header_.bytes = position_;
    header_.lines = line_number_;
    check_counts();
    return std::move(header_);
  }

 private:
  template <class... Args>
  [[noreturn]] void fail(fmt::format_string<Args...> format, Args&&... args) {
    throw InvalidInput(fmt::format("{}:{}: {}", name_, line_number_, fmt::format(format, std::forward<Args>(args)...)));
  }

  void next_line() {
    const std::size_t end = bytes_.find('\n', position_);
    if (end == std::string_view::npos) {
      fail("the PLY header has no \"end_header\" line, so the file is cut off. Copy or export it again.");
    }
    line_ = bytes_.substr(position_, end - position_);
    position_ = end + 1;
    ++line_number_;
  }

  /// False at the end of the header.
  bool read_line() {
    next_line();
    if (carriage_return_ && line_.ends_with('\r')) line_.remove_suffix(1);
    TextCursor text(line_, {}, line_number_);
    const std::string_view keyword = text.token();
    if (keyword == "end_header") {
      if (!format_seen_) fail("the header has no \"format\" line. Export the PLY file again.");
      return false;
    }
    if (keyword == "format") {
      read_format(text);
    } else if (keyword == "element") {
      read_element(text);
    } else if (keyword == "property") {
      read_property(text);
    } else if (keyword == "obj_info") {
      const std::string_view key = text.token();
      const std::optional<long long> value = parse_integer(text.token());
      if (key == "num_cols" && value && *value > 0) header_.grid_columns = static_cast<std::size_t>(*value);
      if (key == "num_rows" && value && *value > 0) header_.grid_rows = static_cast<std::size_t>(*value);
    } else if (keyword != "comment" && !keyword.empty()) {
      fail(
          "\"{}\" is no PLY header keyword (format, element, property, comment, obj_info, end_header). Export the file "
          "again.",
          keyword.substr(0, 40));
    }
    return true;
  }

  void read_format(TextCursor& text) {
    const std::string_view encoding = text.token();
    const std::string_view version = text.token();
    if (encoding == "ascii") {
      header_.encoding = PlyEncoding::kAscii;
    } else if (encoding == "binary_little_endian") {
      header_.encoding = PlyEncoding::kLittleEndian;
    } else if (encoding == "binary_big_endian") {
      header_.encoding = PlyEncoding::kBigEndian;
    } else {
      fail("format \"{}\"; expected ascii, binary_little_endian or binary_big_endian.", encoding.substr(0, 40));
    }
    if (version != "1.0") fail("PLY version \"{}\"; expected 1.0.", version.substr(0, 20));
    format_seen_ = true;
  }

  void read_element(TextCursor& text) {
    PlyElement element;
    element.name = text.token();
    const std::string_view token = text.token();
    const std::optional<long long> count = parse_integer(token);
    if (element.name.empty() || !count || *count < 0) {
      fail("element \"{}\" has the count \"{}\"; expected an integer of 0 or more. Export the file again.",
           element.name.substr(0, 40), token.substr(0, 40));
    }
    for (const PlyElement& other : header_.elements) {
      if (other.name == element.name)
        fail("element \"{}\" is declared twice. Export the file again.", element.name.substr(0, 40));
    }
    element.count = static_cast<std::size_t>(*count);
    header_.elements.push_back(std::move(element));
  }

  PlyType type(std::string_view token) {
    for (const auto& [type_name, type] : kTypeNames) {
      if (type_name == token) return type;
    }
    fail("\"{}\" is no PLY type (char, uchar, short, ushort, int, uint, float, double or int8 ... float64).",
         token.substr(0, 40));
  }

  void read_property(TextCursor& text) {
    if (header_.elements.empty()) fail("a property stands before any element. Export the file again.");
    PlyProperty property;
    std::string_view token = text.token();
    if (token == "list") {
      property.is_list = true;
      property.count_type = type(text.token());
      if (!is_integer(property.count_type)) fail("a list's length must have an integer type. Export the file again.");
      token = text.token();
    }
    property.type = type(token);
    property.name = text.token();
    if (property.name.empty()) fail("a property has no name. Export the file again.");
    header_.elements.back().properties.push_back(std::move(property));
  }

  /// Every announced element must find room in the file, before anything is allocated for it.
  void check_counts() {
    std::size_t left = bytes_.size() - position_;
    for (const PlyElement& element : header_.elements) {
      std::size_t smallest = 0;
      for (const PlyProperty& property : element.properties) {
        // In ASCII a digit and what separates it from the next one.
        smallest += header_.encoding == PlyEncoding::kAscii
                        ? 2
                        : byte_size(property.is_list ? property.count_type : property.type);
      }
      // The last number of an ASCII file needs no newline.
      const std::size_t room = header_.encoding == PlyEncoding::kAscii ? left + 1 : left;
      if (smallest > 0 && element.count > room / smallest) {
        throw InvalidInput(
            fmt::format("{}: the header announces {} elements \"{}\" of at least {} bytes each, but only {} bytes "
                        "are left for them. The file is cut off or its counts are wrong; export it again.",
                        name_, element.count, element.name.substr(0, 40), smallest, left));
      }
      left -= std::min(left, smallest * (smallest > 0 ? element.count : 0));
    }
  }

  std::string_view bytes_;
  const std::string& name_;
  PlyHeader header_;
  std::string_view line_;
  std::size_t position_ = 0;
  std::size_t line_number_ = 0;
  bool carriage_return_ = false;
  bool format_seen_ = false;
};

}  // namespace

PlyHeader read_ply_header(std::string_view bytes, const std::string& name) { return HeaderReader(bytes, name).read(); }

}  // namespace interglow::mesh::detail
