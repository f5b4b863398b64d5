// SPDX-License-Identifier: GPL-3.0-or-later
#include "spectral/table_file.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <fstream>
#include <optional>
#include <sstream>
#include <string_view>
#include <utility>

#include "diagnostics/error.h"

namespace interglow::spectral {
namespace {

namespace fs = std::filesystem;

// A 1 nm Donaldson matrix of 300-800 nm has 3 MB; what is far larger is not a table of ours.
constexpr std::uintmax_t kLargestTableBytes = 64U << 20;

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlank = " \t\r";
  const std::size_t first = text.find_first_not_of(kBlank);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlank) - first + 1);
}

std::string unquoted(std::string_view text) {
  text = trimmed(text);
  if (text.size() >= 2 && text.front() == '"' && text.back() == '"') text = text.substr(1, text.size() - 2);
  return std::string(trimmed(text));
}

std::vector<std::string_view> fields_of(std::string_view line, char separator) {
  std::vector<std::string_view> fields;
  std::size_t start = 0;
  for (std::size_t end = line.find(separator); end != std::string_view::npos; end = line.find(separator, start)) {
    fields.push_back(trimmed(line.substr(start, end - start)));
    start = end + 1;
  }
  fields.push_back(trimmed(line.substr(start)));
  return fields;
}

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  for (line = trimmed(line); !line.empty(); line = trimmed(line)) {
    const std::size_t end = std::min(line.find_first_of(" \t"), line.size());
    words.push_back(line.substr(0, end));
    line.remove_prefix(end);
  }
  return words;
}

std::optional<double> number(std::string_view text) {
  if (!text.empty() && text.front() == '+') text.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::string read_text(const fs::path& path) {
  std::error_code error;
  if (fs::is_directory(path, error)) throw InvalidInput(path.string() + ": this is a folder; expected a table file.");
  std::ifstream stream(path, std::ios::binary);
  if (!stream) throw InvalidInput(path.string() + ": this file cannot be opened. Check the name and the permissions.");
  const std::uintmax_t bytes = fs::file_size(path, error);
  if (error || bytes > kLargestTableBytes) {
    throw InvalidInput(
        fmt::format("{}: {} bytes; expected a table of at most {} bytes.", path.string(), bytes, kLargestTableBytes));
  }
  std::ostringstream text;
  text << stream.rdbuf();
  std::string content = std::move(text).str();
  if (content.find('\0') != std::string::npos) {
    throw InvalidInput(path.string() + ": this is not plain text (it holds zero bytes). Save the table as UTF-8 text.");
  }
  if (content.starts_with("\xEF\xBB\xBF")) content.erase(0, 3);
  return content;
}

/// Calls take(line, number) for every line that is neither blank nor a comment.
template <class Take>
void for_each_line(std::string_view text, const Take& take) {
  int line_number = 0;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view line = trimmed(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
    ++line_number;
    if (!line.empty() && line.front() != '#') take(line, line_number);
  }
}

class TableBuilder {
 public:
  TableBuilder(std::string path, std::string wavelength_name, std::vector<std::string> columns)
      : wavelength_name_(std::move(wavelength_name)) {
    table_.path = std::move(path);
    table_.column = std::move(columns);
  }

  void add(const std::vector<std::string_view>& fields, int line) {
    const std::size_t expected = table_.column.size() + 1;
    if (fields.size() != expected) {
      throw InvalidInput(fmt::format(
          "{}:{}: {} fields, expected {} as in the line of column names. Complete the row{}.", table_.path, line,
          fields.size(), expected,
          fields.size() > expected ? "; if numbers are written with decimal commas, use decimal points" : ""));
    }
    for (std::size_t i = 0; i < fields.size(); ++i) add_number(fields[i], i, line);
    const double wavelength = numbers_[numbers_.size() - expected];
    if (wavelength < 100.0 || wavelength > 20000.0) {
      throw InvalidInput(fmt::format(
          "{}:{}: column \"{}\": {} is not a wavelength in nanometres (100 to 20000). Convert the column to nm.",
          table_.path, line, wavelength_name_, wavelength));
    }
    if (!table_.line.empty() && wavelength <= last_wavelength_) {
      throw InvalidInput(fmt::format(
          "{}:{}: column \"{}\": {} nm follows {} nm; expected increasing wavelengths. Sort the rows and remove "
          "repeated ones.",
          table_.path, line, wavelength_name_, wavelength, last_wavelength_));
    }
    last_wavelength_ = wavelength;
    table_.line.push_back(line);
  }

  NumericTable finish() && {
    if (table_.line.empty()) {
      throw InvalidInput(table_.path + ": no rows of numbers; expected one line a wavelength.");
    }
    using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    const auto rows = static_cast<Eigen::Index>(table_.line.size());
    const auto columns = static_cast<Eigen::Index>(table_.column.size()) + 1;
    const Eigen::Map<const RowMajor> all(numbers_.data(), rows, columns);
    table_.wavelength_nm = all.col(0);
    table_.value = all.rightCols(columns - 1);
    return std::move(table_);
  }

 private:
  void add_number(std::string_view text, std::size_t field, int line) {
    const std::optional<double> value = number(text);
    if (!value || !std::isfinite(*value)) {
      const std::string& name = field == 0 ? wavelength_name_ : table_.column[field - 1];
      throw InvalidInput(
          fmt::format("{}:{}: column \"{}\": \"{}\" is not a finite number. Write numbers as 0.25 or 2.5e-1 and leave "
                      "no field empty.",
                      table_.path, line, name, text));
    }
    numbers_.push_back(*value);
  }

  NumericTable table_;
  std::string wavelength_name_;
  std::vector<double> numbers_;
  double last_wavelength_ = 0.0;
};

TableBuilder from_header(const fs::path& path, std::string_view line, int line_number) {
  if (line.find(';') != std::string_view::npos || line.find('\t') != std::string_view::npos) {
    throw InvalidInput(
        fmt::format("{}:{}: columns are separated by semicolons or tabs. Separate them by commas, with decimal points "
                    "in the numbers.",
                    path.string(), line_number));
  }
  std::vector<std::string> names;
  for (const std::string_view field : fields_of(line, ',')) names.push_back(unquoted(field));
  if (number(names.front())) {
    throw InvalidInput(
        fmt::format("{}:{}: \"{}\" is a number where column names are expected. Put a line such as "
                    "\"wavelength_nm,value\" above it.",
                    path.string(), line_number, names.front()));
  }
  if (names.size() < 2) {
    throw InvalidInput(
        fmt::format("{}:{}: one column, \"{}\"; expected a wavelength column and at least one column of values, "
                    "separated by commas.",
                    path.string(), line_number, names.front()));
  }
  std::string wavelength_name = names.front();
  names.erase(names.begin());
  for (std::size_t i = 0; i < names.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      if (names[i] == names[j]) {
        throw InvalidInput(fmt::format("{}:{}: two columns are named \"{}\". Rename one of them.", path.string(),
                                       line_number, names[i]));
      }
    }
  }
  return {path.string(), std::move(wavelength_name), std::move(names)};
}

}  // namespace

NumericTable read_csv_table(const fs::path& path) {
  const std::string text = read_text(path);
  std::optional<TableBuilder> builder;
  for_each_line(text, [&](std::string_view line, int line_number) {
    if (!builder) {
      builder.emplace(from_header(path, line, line_number));
    } else if (line.find(';') != std::string_view::npos) {
      throw InvalidInput(fmt::format(
          "{}:{}: fields are separated by semicolons. Separate them by commas, with decimal points in the numbers.",
          path.string(), line_number));
    } else {
      builder->add(fields_of(line, ','), line_number);
    }
  });
  if (!builder) {
    throw InvalidInput(path.string() + ": the file is empty; expected a line of column names and rows of numbers.");
  }
  return std::move(*builder).finish();
}

NumericTable read_spd_table(const fs::path& path) {
  const std::string text = read_text(path);
  TableBuilder builder(path.string(), "wavelength", {"value"});
  for_each_line(text, [&](std::string_view line, int line_number) { builder.add(words_of(line), line_number); });
  return std::move(builder).finish();
}

}  // namespace interglow::spectral
