// SPDX-License-Identifier: GPL-3.0-or-later
#include "files/atomic_file.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <sstream>
#include <stdexcept>

#include "diagnostics/error.h"
#include "tests/temporary_folder.h"

namespace interglow::files {
namespace {

std::string content(const std::filesystem::path& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

TEST(AtomicFile, KeepsTheOldContentWhenWritingFails) {
  const test::TemporaryFolder folder;
  const std::filesystem::path path = folder / "deep/result.txt";
  write_text_atomically(path, "first");
  EXPECT_EQ(content(path), "first");
  EXPECT_THROW(write_atomically(path,
                                [](const std::filesystem::path& temporary) {
                                  std::ofstream(temporary) << "half";
                                  throw std::runtime_error("stopped");
                                }),
               std::runtime_error);
  EXPECT_EQ(content(path), "first");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(path.parent_path()), {}), 1) << "a temporary file was left";
}

TEST(AtomicFile, NamesAFolderThatCannotBeMade) {
  try {
    write_text_atomically("/proc/interglow/result.txt", "x");
    FAIL() << "expected InvalidInput";
  } catch (const InvalidInput& error) {
    EXPECT_NE(std::string(error.what()).find("/proc/interglow"), std::string::npos);
  }
}

// A process that exits in the middle of writing, as on Ctrl-C.
TEST(AtomicFile, AbandonedFilesLeaveNoTrace) {
  const test::TemporaryFolder folder;
  write_text_atomically(folder / "result.txt", "first");
  EXPECT_EXIT(write_atomically(folder / "result.txt",
                               [](const std::filesystem::path& temporary) {
                                 std::ofstream(temporary) << "half";
                                 const bool was_there = std::filesystem::exists(temporary);
                                 abandon_unfinished();
                                 ::_exit(was_there && !std::filesystem::exists(temporary) ? 0 : 1);
                               }),
              testing::ExitedWithCode(0), "");
  EXPECT_EQ(content(folder / "result.txt"), "first");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1) << "a temporary file was left";
}

}  // namespace
}  // namespace interglow::files
