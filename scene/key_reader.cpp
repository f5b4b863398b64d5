// SPDX-License-Identifier: GPL-3.0-or-later
#include "scene/key_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "diagnostics/error.h"
#include "diagnostics/suggestion.h"

namespace interglow::scene {
namespace {

std::optional<double> as_number(const TomlNode& node) {
  if (const auto* whole = std::get_if<std::int64_t>(&node.value)) return static_cast<double>(*whole);
  if (const auto* real = std::get_if<double>(&node.value)) return *real;
  return std::nullopt;
}

std::string joined(const std::vector<std::string>& words) {
  std::string all;
  for (std::size_t i = 0; i < words.size(); ++i) all += (i > 0 ? ", " : "") + ("\"" + words[i] + "\"");
  return all;
}

}  // namespace

bool Range::contains(double value) const {
  return std::isfinite(value) && (least_excluded ? value > least : value >= least) &&
         (most_excluded ? value < most : value <= most);
}

std::string Range::text() const {
  std::string above = fmt::format("a number {} {}", least_excluded ? "above" : "of at least", least);
  if (least <= -1e300 && most >= 1e300) return "a finite number";
  if (most >= 1e300) return above;
  if (!least_excluded && !most_excluded) return fmt::format("a number from {} to {}", least, most);
  return fmt::format("{} and {} {}", above, most_excluded ? "below" : "at most", most);
}

KeyReader::KeyReader(std::string file, std::string path, const TomlNode& table)
    : file_(std::move(file)), path_(std::move(path)), line_(table.line), table_(std::get_if<TomlTable>(&table.value)) {
  if (table_ == nullptr) {
    throw InvalidInput(fmt::format("{}:{}: {}: {}, expected a table of keys. Write [{}] on a line of its own.", file_,
                                   line_, path_, table.text(), path_));
  }
}

const TomlNode* KeyReader::find(std::string_view key) {
  known_.emplace_back(key);
  for (const auto& [name, node] : table_->entries) {
    if (name == key) return &node;
  }
  return nullptr;
}

std::string KeyReader::place(std::string_view key) const {
  int line = line_;
  for (const auto& [name, node] : table_->entries) {
    if (name == key) line = node.line;
  }
  const std::string dotted = path_ + (path_.empty() || key.empty() ? "" : ".") + std::string(key);
  return fmt::format("{}:{}{}{}", file_, line, dotted.empty() ? "" : ": ", dotted);
}

void KeyReader::fail(std::string_view key, const std::string& sentence) const {
  throw InvalidInput(place(key) + ": " + sentence);
}

void KeyReader::fail_value(std::string_view key, const TomlNode& node, const std::string& expected) const {
  fail(key, node.text() + ", expected " + expected + ".");
}

void KeyReader::fail_missing(std::string_view key, std::string_view expected) const {
  throw InvalidInput(fmt::format("{}: the key \"{}\" is missing; expected {}. Add it.", place(), key, expected));
}

std::optional<double> KeyReader::find_number(std::string_view key, const Range& range) {
  const TomlNode* node = find(key);
  if (node == nullptr) return std::nullopt;
  const auto number = as_number(*node);
  if (!number || !range.contains(*number)) fail_value(key, *node, range.text());
  return number;
}

std::optional<int> KeyReader::find_integer(std::string_view key, int least, int most) {
  const TomlNode* node = find(key);
  if (node == nullptr) return std::nullopt;
  const auto* whole = std::get_if<std::int64_t>(&node->value);
  if (whole == nullptr || *whole < least || *whole > most) {
    fail_value(key, *node, fmt::format("a whole number from {} to {}", least, most));
  }
  return static_cast<int>(*whole);
}

std::optional<bool> KeyReader::find_bool(std::string_view key) {
  const TomlNode* node = find(key);
  if (node == nullptr) return std::nullopt;
  const auto* flag = std::get_if<bool>(&node->value);
  if (flag == nullptr) fail_value(key, *node, "true or false");
  return *flag;
}

std::optional<std::string> KeyReader::find_text(std::string_view key) {
  const TomlNode* node = find(key);
  if (node == nullptr) return std::nullopt;
  const auto* text = std::get_if<std::string>(&node->value);
  if (text == nullptr || text->empty()) fail_value(key, *node, "text in quotes");
  return *text;
}

std::optional<Eigen::Vector3d> KeyReader::find_vector(std::string_view key) {
  const TomlNode* node = find(key);
  if (node == nullptr) return std::nullopt;
  const auto* elements = std::get_if<std::vector<TomlNode>>(&node->value);
  Eigen::Vector3d vector = Eigen::Vector3d::Zero();
  bool good = elements != nullptr && elements->size() == 3;
  for (std::size_t i = 0; good && i < 3; ++i) {
    const auto number = as_number((*elements)[i]);
    good = number && kAnyNumber.contains(*number);
    if (good) vector[static_cast<Eigen::Index>(i)] = *number;
  }
  if (!good) fail_value(key, *node, "three finite numbers, [x, y, z]");
  return vector;
}

std::optional<std::vector<double>> KeyReader::find_numbers(std::string_view key, const Range& range) {
  const TomlNode* node = find(key);
  if (node == nullptr) return std::nullopt;
  const auto* elements = std::get_if<std::vector<TomlNode>>(&node->value);
  if (elements == nullptr || elements->empty()) fail_value(key, *node, "a list of numbers");
  std::vector<double> numbers;
  for (const TomlNode& element : *elements) {
    const auto number = as_number(element);
    if (!number || !range.contains(*number)) {
      fail(key, fmt::format("entry {} is {}, expected {}.", numbers.size() + 1, element.text(), range.text()));
    }
    numbers.push_back(*number);
  }
  return numbers;
}

std::optional<std::size_t> KeyReader::find_choice(std::string_view key, const std::vector<std::string>& choices) {
  const TomlNode* node = find(key);
  if (node == nullptr) return std::nullopt;
  if (const auto* text = std::get_if<std::string>(&node->value)) {
    const auto found = std::find(choices.begin(), choices.end(), *text);
    if (found != choices.end()) return static_cast<std::size_t>(found - choices.begin());
  }
  fail_value(key, *node, "one of " + joined(choices));
}

std::optional<KeyReader> KeyReader::find_table(std::string_view key) {
  const TomlNode* node = find(key);
  if (node == nullptr) return std::nullopt;
  return KeyReader(file_, path_ + (path_.empty() ? "" : ".") + std::string(key), *node);
}

std::vector<std::pair<std::string, KeyReader>> KeyReader::all_tables() {
  std::vector<std::pair<std::string, KeyReader>> tables;
  for (const auto& [name, node] : table_->entries) {
    tables.emplace_back(name, KeyReader(file_, path_ + (path_.empty() ? "" : ".") + name, node));
    known_.push_back(name);
  }
  return tables;
}

void KeyReader::finish() const {
  for (const auto& [name, node] : table_->entries) {
    if (std::find(known_.begin(), known_.end(), name) != known_.end()) continue;
    const auto nearest = nearest_word(name, known_);
    fail(name,
         fmt::format("{} is set, but there is no such key. {}", node.text(),
                     nearest ? "Did you mean \"" + *nearest + "\"?" : "Known keys here: " + joined(known_) + "."));
  }
}

}  // namespace interglow::scene
