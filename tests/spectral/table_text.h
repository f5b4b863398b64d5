// SPDX-License-Identifier: GPL-3.0-or-later
/// Small table files for tests.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

namespace interglow::spectral {

/// Writes `text` to a file named after the running test and removes it at the end.
class TableText {
 public:
  explicit TableText(std::string_view text, const std::string& extension = ".csv") {
    const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
    path_ = std::filesystem::temp_directory_path() /
            (std::string(test->test_suite_name()) + "_" + test->name() + "_" + std::to_string(::getpid()) + extension);
    std::ofstream(path_, std::ios::binary) << text;
  }
  TableText(const TableText&) = delete;
  TableText& operator=(const TableText&) = delete;
  ~TableText() {
    std::error_code error;
    std::filesystem::remove(path_, error);
  }
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// Message of the exception of type Error that `call` throws; fails the test if there is none.
template <class Error, class Call>
std::string message_of(const Call& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  ADD_FAILURE() << "nothing was thrown";
  return {};
}

}  // namespace interglow::spectral
