// SPDX-License-Identifier: GPL-3.0-or-later
#include "spectral/spectrum_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cassert>
#include <iterator>

#include "diagnostics/error.h"
#include "diagnostics/suggestion.h"
#include "files/atomic_file.h"
#include "spectral/table_file.h"

namespace interglow::spectral {
namespace {

NumericTable read_table(const std::filesystem::path& path) {
  return path.extension() == ".spd" ? read_spd_table(path) : read_csv_table(path);
}

Eigen::Index find_column(const NumericTable& table, std::string_view column) {
  const std::string known = fmt::format("\"{}\"", fmt::join(table.column, "\", \""));
  if (column.empty()) {
    if (table.column.size() == 1) return 0;
    throw InvalidInput(fmt::format("{}: {} columns of values; expected the name of one. Say which: {}.", table.path,
                                   table.column.size(), known));
  }
  const auto found = std::find(table.column.begin(), table.column.end(), column);
  if (found != table.column.end()) return std::distance(table.column.begin(), found);
  const auto nearest = nearest_word(column, table.column);
  throw InvalidInput(fmt::format("{}: no column \"{}\"{}. The file has {}.", table.path, column,
                                 nearest ? "; did you mean \"" + *nearest + "\"?" : "", known));
}

// A comma or line break in a name would make another table of it.
std::string field_name(std::string name) {
  std::replace_if(
      name.begin(), name.end(), [](char c) { return c == ',' || c == '\n' || c == '\r'; }, ' ');
  return name;
}

}  // namespace

Spectrum read_spectrum(const std::filesystem::path& path, std::string_view column) {
  const NumericTable table = read_table(path);
  const Eigen::Index index = find_column(table, column);
  return {table.wavelength_nm, table.value.col(index),
          fmt::format("{}: {}", table.path, table.column[static_cast<std::size_t>(index)])};
}

std::vector<std::string> spectrum_columns(const std::filesystem::path& path) { return read_table(path).column; }

void write_spectra_csv(const std::filesystem::path& path, const Eigen::VectorXd& wavelength_nm,
                       const std::vector<NamedValues>& columns, const std::vector<std::string>& comments) {
  std::string text;
  const auto out = std::back_inserter(text);
  for (std::string comment : comments) {
    std::replace(comment.begin(), comment.end(), '\n', ' ');
    fmt::format_to(out, "# {}\n", comment);
  }
  text += "wavelength_nm";
  for (const NamedValues& column : columns) {
    assert(column.value.size() == wavelength_nm.size());
    text += "," + field_name(column.name);
  }
  text += '\n';
  for (Eigen::Index i = 0; i < wavelength_nm.size(); ++i) {
    fmt::format_to(out, "{}", wavelength_nm[i]);  // shortest text that reads back as the same number
    for (const NamedValues& column : columns) fmt::format_to(out, ",{}", column.value[i]);
    text += '\n';
  }
  files::write_text_atomically(path, text);
}

}  // namespace interglow::spectral
