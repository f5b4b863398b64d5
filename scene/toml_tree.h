// SPDX-License-Identifier: GPL-3.0-or-later
/// A TOML document as a plain tree that knows its lines. toml11 is a large header; this keeps it in one source file.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace interglow::scene {

struct TomlEntry;

/// Keys with their values in the order of the document.
struct TomlTable {
  std::vector<TomlEntry> entries;
};

struct TomlNode {
  int line = 0;  ///< 1-based
  std::variant<bool, std::int64_t, double, std::string, std::vector<TomlNode>, TomlTable> value;
  std::string text() const;  ///< as one would write it, shortened; for messages
};

struct TomlEntry {
  std::string key;
  TomlNode node;
};

/// @throws InvalidInput "file:line: ..." for a file that cannot be read or is not TOML; dates are refused (nothing uses
/// them).
TomlNode read_toml(const std::filesystem::path& path);

/// The same for text in memory; `name` stands for the file in messages.
TomlNode parse_toml(std::string_view text, const std::string& name);

}  // namespace interglow::scene
