// SPDX-License-Identifier: GPL-3.0-or-later
/// The text part of ENVI files.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace interglow::image {

/// Entries `key = value` of a header with the lines they stand in.
class EnviHeader {
 public:
  /// @throws InvalidInput if the file is no ENVI header, an entry has no value, a brace is not closed or a key is
  /// twice.
  static EnviHeader read(const std::filesystem::path& path);

  bool has(const std::string& key) const { return entries_.count(key) != 0; }
  /// @throws InvalidInput if the key is missing, naming what to add.
  const std::string& text(const std::string& key) const;
  /// A whole number in [lowest, highest]. @throws InvalidInput naming line, key, value and range.
  std::int64_t whole(const std::string& key, std::int64_t lowest, std::int64_t highest) const;
  double number(const std::string& key) const;
  /// A list in braces. @throws InvalidInput naming the entry that is no number.
  std::vector<double> numbers(const std::string& key) const;
  std::map<std::string, std::string> entries() const;
  /// "FILE:LINE: KEY" of an entry, for messages.
  std::string place(const std::string& key) const;

 private:
  struct Entry {
    std::string value;
    int line = 0;
  };
  std::string path_;
  std::map<std::string, Entry> entries_;
};

}  // namespace interglow::image
