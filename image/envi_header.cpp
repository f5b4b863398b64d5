// SPDX-License-Identifier: GPL-3.0-or-later
#include "image/envi_header.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <fstream>

#include "diagnostics/error.h"

namespace interglow::image {
namespace {

/// No header of a few thousand bands comes near; a raw file named .hdr by mistake is not read whole.
constexpr std::uintmax_t kLargestHeader = 16U << 20U;

std::string trimmed(const std::string& text) {
  const auto blank = [](unsigned char c) { return std::isspace(c) != 0; };
  const auto first = std::find_if_not(text.begin(), text.end(), blank);
  const auto last = std::find_if_not(text.rbegin(), text.rend(), blank).base();
  return first < last ? std::string(first, last) : std::string();
}

std::optional<double> parse(const std::string& text) {
  double value = 0.0;
  const std::string word = trimmed(text);
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

}  // namespace

EnviHeader EnviHeader::read(const std::filesystem::path& path) {
  EnviHeader header;
  header.path_ = path.string();
  std::error_code failed;
  const std::uintmax_t size = std::filesystem::file_size(path, failed);
  std::ifstream in(path, std::ios::binary);
  if (failed || !in) throw InvalidInput(fmt::format("{}: cannot be read.", header.path_));
  std::string line;
  if (size > kLargestHeader || !std::getline(in, line) || trimmed(line) != "ENVI") {
    throw InvalidInput(fmt::format("{}:1: no ENVI header; expected the word ENVI in the first line.", header.path_));
  }
  for (int number = 2; std::getline(in, line); ++number) {
    const std::string content = trimmed(line);
    if (content.empty() || content.front() == ';') continue;
    const std::size_t equals = content.find('=');
    if (equals == std::string::npos) {
      throw InvalidInput(fmt::format("{}:{}: \"{}\"; expected \"key = value\".", header.path_, number, content));
    }
    std::string key = trimmed(content.substr(0, equals));
    std::transform(key.begin(), key.end(), key.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    Entry entry{trimmed(content.substr(equals + 1)), number};
    if (!entry.value.empty() && entry.value.front() == '{') {
      while (entry.value.find('}') == std::string::npos) {
        if (!std::getline(in, line)) {
          throw InvalidInput(fmt::format("{}:{}: {}: the brace is not closed.", header.path_, entry.line, key));
        }
        ++number;
        entry.value += ' ' + trimmed(line);
      }
      entry.value = trimmed(entry.value.substr(1, entry.value.find('}') - 1));
    }
    if (!header.entries_.emplace(key, entry).second)
      throw InvalidInput(fmt::format("{}:{}: {} is given twice; remove one.", header.path_, entry.line, key));
  }
  return header;
}

std::string EnviHeader::place(const std::string& key) const {
  return fmt::format("{}:{}: {}", path_, entries_.at(key).line, key);
}

const std::string& EnviHeader::text(const std::string& key) const {
  const auto found = entries_.find(key);
  if (found == entries_.end()) {
    throw InvalidInput(fmt::format("{}: no entry \"{}\"; add a line \"{} = …\".", path_, key, key));
  }
  return found->second.value;
}

std::int64_t EnviHeader::whole(const std::string& key, std::int64_t lowest, std::int64_t highest) const {
  const std::string& value = text(key);
  std::int64_t number = 0;
  const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), number);
  if (error != std::errc() || end != value.data() + value.size() || number < lowest || number > highest) {
    throw InvalidInput(
        fmt::format("{} = {}; expected a whole number from {} to {}.", place(key), value, lowest, highest));
  }
  return number;
}

double EnviHeader::number(const std::string& key) const {
  const std::optional<double> value = parse(text(key));
  if (!value) throw InvalidInput(fmt::format("{} = {}; expected a number.", place(key), text(key)));
  return *value;
}

std::vector<double> EnviHeader::numbers(const std::string& key) const {
  std::vector<double> values;
  const std::string& list = text(key);
  for (std::size_t from = 0; from <= list.size();) {
    const std::size_t comma = std::min(list.find(',', from), list.size());
    const std::string word = trimmed(list.substr(from, comma - from));
    from = comma + 1;
    if (word.empty() && from > list.size()) break;  // a comma after the last entry
    const std::optional<double> value = parse(word);
    if (!value)
      throw InvalidInput(
          fmt::format("{}: entry {} is \"{}\"; expected a number.", place(key), values.size() + 1, word));
    values.push_back(*value);
  }
  return values;
}

std::map<std::string, std::string> EnviHeader::entries() const {
  std::map<std::string, std::string> all;
  for (const auto& [key, entry] : entries_) all.emplace(key, entry.value);
  return all;
}

}  // namespace interglow::image
