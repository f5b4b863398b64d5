// SPDX-License-Identifier: GPL-3.0-or-later
#include "files/data_directory.h"

#include <cstdlib>
#include <string>
#include <vector>

#include "diagnostics/error.h"

namespace interglow::files {

namespace fs = std::filesystem;

fs::path tables_directory() {
  std::vector<fs::path> candidates;
  if (const char* from_environment = std::getenv("INTERGLOW_TABLES")) candidates.emplace_back(from_environment);
  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  if (!error) candidates.push_back(program.parent_path().parent_path() / INTERGLOW_INSTALL_DATA_SUBDIR);
  candidates.emplace_back(INTERGLOW_SOURCE_DATA_DIR);
  std::string tried;
  for (const fs::path& candidate : candidates) {
    if (fs::is_directory(candidate, error)) return candidate;
    tried += (tried.empty() ? "" : ", ") + candidate.string();
  }
  throw InvalidInput("The folder of shipped tables was not found (tried " + tried +
                     "). Set INTERGLOW_TABLES to the folder spectral/tables of the source, or install again.");
}

}  // namespace interglow::files
