// SPDX-License-Identifier: GPL-3.0-or-later
/// Small table files for tests.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

#include "tests/temporary_folder.h"

namespace interglow::spectral {

/// A file that holds `text`, gone with the object.
class TableText {
 public:
  explicit TableText(std::string_view text, const std::string& extension = ".csv")
      : path_(folder_ / ("table" + extension)) {
    std::ofstream(path_, std::ios::binary) << text;
  }
  const std::filesystem::path& path() const { return path_; }

 private:
  const test::TemporaryFolder folder_;
  const std::filesystem::path path_;
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
