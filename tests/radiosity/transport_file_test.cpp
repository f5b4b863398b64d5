// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/transport_file.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include "diagnostics/error.h"
#include "tests/temporary_folder.h"

namespace interglow::radiosity {
namespace {

/// Areas 1, 2, 4; the third sees itself.
Transport example() {
  Eigen::MatrixXd f(3, 3);
  f << 0.0, 0.1, 0.9, 0.05, 0.0, 0.3, 0.225, 0.15, 1.0 / 3.0;
  return Transport::from_form_factors(f, Eigen::Vector3d(1, 2, 4));
}

std::string content(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

TEST(TransportFile, MatrixMarketListsTheEntriesInFullPrecision) {
  const test::TemporaryFolder folder;
  const auto path = folder / "f.mtx";
  write_form_factors(example(), path, "made by a test\nof two lines");
  EXPECT_EQ(content(path),
            "%%MatrixMarket matrix coordinate real general\n% made by a test\n% of two lines\n3 3 7\n"
            "1 2 0.1\n1 3 0.9\n2 1 0.05\n2 3 0.3\n3 1 0.225\n3 2 0.15\n3 3 0.3333333333333333\n");
}

TEST(TransportFile, NpzIsAnArchiveOfStoredArrays) {
  const test::TemporaryFolder folder;
  const auto path = folder / "f.npz";
  write_form_factors(example(), path);
  const std::string bytes = content(path);
  EXPECT_EQ(bytes.substr(0, 4), "PK\x03\x04");
  for (const char* name : {"indices.npy", "indptr.npy", "format.npy", "shape.npy", "data.npy", "area_mm2.npy"}) {
    EXPECT_NE(bytes.find(name), std::string::npos) << name;
  }
  const std::size_t data = bytes.find("'descr': '<f8', 'fortran_order': False, 'shape': (7,)");
  ASSERT_NE(data, std::string::npos);
  // Python's zipfile checks every header and checksum.
  if (std::system("python3 -c pass") != 0) GTEST_SKIP() << "python3 is not there to read the archive";
  const std::string command =
      "python3 -c \"import zipfile,struct; z=zipfile.ZipFile('" + path.string() +
      "'); assert z.testzip() is None; b=z.read('data.npy'); "
      "assert struct.unpack('<7d',b[-56:])==(0.1,0.9,0.05,0.3,0.225,0.15,1/3), b[-56:]; "
      "assert (len(b)-56)%64==0; assert struct.unpack('<7i',z.read('indices.npy')[-28:])==(1,2,0,2,0,1,2)\"";
  EXPECT_EQ(std::system(command.c_str()), 0) << command;
}

TEST(TransportFile, RefusesOtherEndingsAndLeavesNothing) {
  const test::TemporaryFolder folder;
  const auto path = folder / "f.txt";
  try {
    write_form_factors(example(), path);
    FAIL();
  } catch (const InvalidParams& error) {
    EXPECT_NE(std::string(error.what()).find("f.txt"), std::string::npos) << error.what();
  }
  EXPECT_FALSE(std::filesystem::exists(path));
}

}  // namespace
}  // namespace interglow::radiosity
