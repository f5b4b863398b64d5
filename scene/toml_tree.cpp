// SPDX-License-Identifier: GPL-3.0-or-later
#include "scene/toml_tree.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <sstream>
#include <toml.hpp>

#include "diagnostics/error.h"

namespace interglow::scene {
namespace {

using TomlValue = toml::basic_value<toml::discard_comments, std::map, std::vector>;

// Deeper nesting than any scene needs would overflow the stack of the recursive parser.
constexpr int kMaxNesting = 64;
constexpr std::size_t kMaxBytes = 64U << 20U;

struct PlacedEntry {
  std::size_t line, column;
  std::string key;
  TomlNode node;
};

TomlNode convert(const TomlValue& value, const std::string& name) {
  TomlNode node;
  const auto location = value.location();
  node.line = static_cast<int>(location.line());
  switch (value.type()) {
    case toml::value_t::boolean:
      node.value = value.as_boolean();
      break;
    case toml::value_t::integer:
      node.value = static_cast<std::int64_t>(value.as_integer());
      break;
    case toml::value_t::floating:
      node.value = value.as_floating();
      break;
    case toml::value_t::string:
      node.value = value.as_string().str;
      break;
    case toml::value_t::array: {
      std::vector<TomlNode> elements;
      for (const TomlValue& element : value.as_array()) elements.push_back(convert(element, name));
      node.value = std::move(elements);
      break;
    }
    case toml::value_t::table: {
      std::vector<PlacedEntry> placed;
      for (const auto& [key, element] : value.as_table()) {
        const auto place = element.location();
        placed.push_back({place.line(), place.column(), key, convert(element, name)});
      }
      std::sort(placed.begin(), placed.end(), [](const PlacedEntry& a, const PlacedEntry& b) {
        return std::tie(a.line, a.column, a.key) < std::tie(b.line, b.column, b.key);
      });
      TomlTable table;
      for (PlacedEntry& entry : placed) table.entries.push_back({std::move(entry.key), std::move(entry.node)});
      node.value = std::move(table);
      break;
    }
    default:
      throw InvalidInput(
          fmt::format("{}:{}: a date or time, but no key of a scene takes one. Put quotes around it if text was meant.",
                      name, node.line));
  }
  return node;
}

/// toml11's messages have several lines with a drawing; the first says what is wrong, behind "[error] toml::function:
/// ".
std::string first_line(std::string text) {
  text = text.substr(0, text.find('\n'));
  if (text.starts_with("[error] ")) text.erase(0, 8);
  if (text.starts_with("toml::")) {
    const auto colon = text.find(": ");
    if (colon != std::string::npos) text.erase(0, colon + 2);
  }
  while (text.ends_with('.') || text.ends_with(' ')) text.pop_back();
  return text;
}

std::string line_of(std::string_view text, std::size_t line) {
  for (std::size_t skipped = 1; skipped < line; ++skipped) {
    const auto end = text.find('\n');
    if (end == std::string_view::npos) return {};
    text.remove_prefix(end + 1);
  }
  std::string found(text.substr(0, std::min<std::size_t>(text.find('\n'), 80)));
  while (found.ends_with('\r')) found.pop_back();
  return found;
}

void refuse_deep_nesting(std::string_view text, const std::string& name) {
  int depth = 0;
  int line = 1;
  for (const char c : text) {
    if (c == '\n') ++line;
    depth += c == '[' || c == '{' ? 1 : 0;
    depth -= c == ']' || c == '}' ? 1 : 0;
    if (depth > kMaxNesting) {
      throw InvalidInput(
          fmt::format("{}:{}: brackets are nested more than {} deep; expected a scene file.", name, line, kMaxNesting));
    }
  }
}

}  // namespace

std::string TomlNode::text() const {
  constexpr std::size_t kLongest = 60;
  struct Print {
    std::string operator()(bool b) const { return b ? "true" : "false"; }
    std::string operator()(std::int64_t i) const { return fmt::format("{}", i); }
    std::string operator()(double d) const { return fmt::format("{}", d); }
    std::string operator()(const std::string& s) const { return "\"" + s + "\""; }
    std::string operator()(const std::vector<TomlNode>& elements) const {
      std::string list = "[";
      for (std::size_t i = 0; i < elements.size() && list.size() < kLongest; ++i)
        list += (i > 0 ? ", " : "") + elements[i].text();
      return list + "]";
    }
    std::string operator()(const TomlTable&) const { return "a table"; }
  };
  std::string all = std::visit(Print{}, value);
  if (all.size() > kLongest) all = all.substr(0, kLongest) + "...";
  return all;
}

TomlNode parse_toml(std::string_view text, const std::string& name) {
  refuse_deep_nesting(text, name);
  std::istringstream stream{std::string(text)};
  try {
    return convert(toml::parse<toml::discard_comments, std::map, std::vector>(stream, name), name);
  } catch (const toml::exception& error) {
    const auto line = error.location().line();
    throw InvalidInput(fmt::format("{}:{}: {}: `{}`. Correct the line (the file must be TOML 1.0).", name, line,
                                   first_line(error.what()), line_of(text, line)));
  } catch (const InvalidInput&) {
    throw;
  } catch (const std::exception& error) {
    throw InvalidInput(fmt::format("{}: {}. The file must be TOML 1.0.", name, first_line(error.what())));
  }
}

TomlNode read_toml(const std::filesystem::path& path) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) {
    throw InvalidInput(path.string() + ": this is a folder; expected a scene file (TOML).");
  }
  std::ifstream stream(path, std::ios::binary);
  if (!stream) throw InvalidInput(path.string() + ": this file cannot be opened. Check the name and the permissions.");
  std::string text;
  std::vector<char> buffer(1U << 16U);
  while (stream.read(buffer.data(), static_cast<std::streamsize>(buffer.size())) || stream.gcount() > 0) {
    text.append(buffer.data(), static_cast<std::size_t>(stream.gcount()));
    if (text.size() > kMaxBytes)
      throw InvalidInput(path.string() + ": larger than 64 MiB; expected a scene file (TOML).");
  }
  return parse_toml(text, path.string());
}

}  // namespace interglow::scene
