// SPDX-License-Identifier: GPL-3.0-or-later
#include "spectral/shipped_tables.h"

#include <fmt/format.h>

#include <algorithm>

#include "diagnostics/error.h"
#include "diagnostics/suggestion.h"
#include "files/data_directory.h"

namespace interglow::spectral {

namespace fs = std::filesystem;

std::vector<std::string> shipped_tables() {
  const fs::path root = files::tables_directory();
  std::vector<std::string> names;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(root)) {
    if (!entry.is_regular_file() || entry.path().extension() != ".csv") continue;
    fs::path name = entry.path().lexically_relative(root);
    names.push_back(std::string(kShippedPrefix) + name.replace_extension().generic_string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

fs::path find_table(const std::string& name, const fs::path& folder) {
  if (!name.starts_with(kShippedPrefix)) return folder / name;
  const std::vector<std::string> known = shipped_tables();
  if (std::find(known.begin(), known.end(), name) == known.end()) {
    const auto nearest = nearest_word(name, known);
    throw InvalidInput(fmt::format("\"{}\" is not a table that comes with the program{}. Known are: {}.", name,
                                   nearest ? "; did you mean \"" + *nearest + "\"?" : "", fmt::join(known, ", ")));
  }
  return files::tables_directory() / (name.substr(kShippedPrefix.size()) + ".csv");
}

}  // namespace interglow::spectral
