// SPDX-License-Identifier: GPL-3.0-or-later
/// Takes the keys of one table of a scene file, checking type and range, and complains about those nobody asked for.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "scene/toml_tree.h"

namespace interglow::scene {

/// A range of numbers with its words: {0, 1} is "0 to 1"; open ends exclude their value.
struct Range {
  double least = -1e300;
  double most = 1e300;
  bool least_excluded = false;
  bool most_excluded = false;
  bool contains(double value) const;  ///< false for NaN
  std::string text() const;
};

inline constexpr Range kAnyNumber{};
inline constexpr Range kPositive{0.0, 1e300, true};
inline constexpr Range kNotNegative{0.0, 1e300};

/// Every `find_…` gives nothing where the key is absent; every `require_…` refuses that. All throw InvalidInput with
/// "file:line: table.key: value, expected …".
class KeyReader {
 public:
  /// @param table  the node of the table itself (refused if it is anything else)
  /// @param path   dotted name of the table in messages, "" for the whole file
  KeyReader(std::string file, std::string path, const TomlNode& table);

  const TomlNode* find(std::string_view key);  ///< marks the key as known
  std::optional<double> find_number(std::string_view key, const Range& range = kAnyNumber);
  std::optional<int> find_integer(std::string_view key, int least, int most);
  std::optional<bool> find_bool(std::string_view key);
  std::optional<std::string> find_text(std::string_view key);
  std::optional<Eigen::Vector3d> find_vector(std::string_view key);
  std::optional<std::vector<double>> find_numbers(std::string_view key, const Range& range);
  /// Index of the word in `choices`.
  std::optional<std::size_t> find_choice(std::string_view key, const std::vector<std::string>& choices);
  std::optional<KeyReader> find_table(std::string_view key);
  /// The tables inside this one, in the order of the file; every key must hold a table.
  std::vector<std::pair<std::string, KeyReader>> all_tables();

  template <typename T>
  T require(std::string_view key, std::optional<T> found, std::string_view expected) const {
    if (!found) fail_missing(key, expected);
    return *found;
  }

  /// Call after all keys were asked for: refuses the ones that were not, naming the nearest known one.
  void finish() const;

  std::string place(std::string_view key = {}) const;  ///< "file:line: table.key"
  [[noreturn]] void fail(std::string_view key, const std::string& sentence) const;
  [[noreturn]] void fail_value(std::string_view key, const TomlNode& node, const std::string& expected) const;
  [[noreturn]] void fail_missing(std::string_view key, std::string_view expected) const;
  bool empty() const { return table_->entries.empty(); }

 private:
  std::string file_, path_;
  int line_ = 1;
  const TomlTable* table_;
  std::vector<std::string> known_;
};

}  // namespace interglow::scene
