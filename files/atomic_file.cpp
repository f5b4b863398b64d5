// SPDX-License-Identifier: GPL-3.0-or-later
#include "files/atomic_file.h"

#include <unistd.h>

#include <fstream>
#include <mutex>
#include <set>
#include <string>
#include <system_error>

#include "diagnostics/error.h"

namespace interglow::files {

namespace fs = std::filesystem;

namespace {

/// The temporary files that exist now. The process's files are the process's state; nothing else can remove them when
/// it is interrupted.
struct Unfinished {
  std::mutex mutex;
  std::set<fs::path> paths;
};

Unfinished& unfinished() {
  static Unfinished all;
  return all;
}

void note(const fs::path& temporary) {
  const std::lock_guard lock(unfinished().mutex);
  unfinished().paths.insert(temporary);
}

void forget(const fs::path& temporary) {
  const std::lock_guard lock(unfinished().mutex);
  unfinished().paths.erase(temporary);
}

}  // namespace

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
  note(temporary);
  try {
    write(temporary);
    {
      const std::lock_guard lock(unfinished().mutex);
      fs::rename(temporary, path, error);
    }
    if (error) {
      throw InvalidInput(path.string() + ": cannot be written (" + error.message() + "). Choose another output file.");
    }
  } catch (...) {
    fs::remove(temporary, error);
    forget(temporary);
    throw;
  }
  forget(temporary);
}

void write_text_atomically(const fs::path& path, std::string_view text) {
  write_atomically(path, [&](const fs::path& temporary) {
    std::ofstream stream(temporary, std::ios::binary);
    stream.write(text.data(), static_cast<std::streamsize>(text.size()));
    stream.close();
    if (!stream) {
      throw InvalidInput(path.string() +
                         ": cannot be written. Check that the folder is writable and the disk has room.");
    }
  });
}

void abandon_unfinished() {
  Unfinished& all = unfinished();
  all.mutex.lock();  // never unlocked: see the header
  std::error_code error;
  for (const fs::path& temporary : all.paths) fs::remove(temporary, error);
}

}  // namespace interglow::files
