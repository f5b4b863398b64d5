// SPDX-License-Identifier: GPL-3.0-or-later
#include "files/atomic_file.h"

#include <unistd.h>

#include <fstream>
#include <string>
#include <system_error>

#include "diagnostics/error.h"

namespace interglow::files {

namespace fs = std::filesystem;

void write_atomically(const fs::path& path, const std::function<void(const fs::path& temporary)>& write) {
  std::error_code error;
  if (path.has_parent_path()) fs::create_directories(path.parent_path(), error);
  if (error) {
    throw InvalidInput(path.parent_path().string() + ": this folder cannot be made (" + error.message() +
                       "). Choose another output folder.");
  }
  fs::path temporary = path;
  temporary.replace_filename("." + path.stem().string() + ".part" + std::to_string(::getpid()) +
                             path.extension().string());
  try {
    write(temporary);
    fs::rename(temporary, path, error);
    if (error) {
      throw InvalidInput(path.string() + ": cannot be written (" + error.message() + "). Choose another output file.");
    }
  } catch (...) {
    fs::remove(temporary, error);
    throw;
  }
}

void write_text_atomically(const fs::path& path, std::string_view text) {
  write_atomically(path, [&](const fs::path& temporary) {
    std::ofstream stream(temporary, std::ios::binary);
    stream.write(text.data(), static_cast<std::streamsize>(text.size()));
    stream.close();
    if (!stream) {
      throw InvalidInput(path.string() + ": cannot be written. Check that the folder is writable and the disk has room.");
    }
  });
}

}  // namespace interglow::files
