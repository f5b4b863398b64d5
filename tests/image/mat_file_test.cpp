// SPDX-License-Identifier: GPL-3.0-or-later
#include "image/mat_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <matio.h>

#include <bit>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include "diagnostics/error.h"
#include "tests/temporary_folder.h"

namespace interglow::image {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

class MatFiles : public ::testing::Test {
 protected:
  fs::path file(const std::string& name) const { return folder_ / name; }
  std::string message(const std::string& name, const MatNames& names = {}, const Eigen::VectorXd& nm = {}) const {
    try {
      read_mat(file(name), names, nm);
    } catch (const InvalidInput& error) {
      return error.what();
    }
    return "";
  }

 private:
  const test::TemporaryFolder folder_;
};

/// An array element of level 5 as the published format describes it: a matrix tag with flags, sizes, name and values.
class Level5 {
 public:
  explicit Level5(bool big_endian) : big_endian_(big_endian) {
    bytes_ = std::string("MATLAB 5.0 MAT-file, made by hand");
    bytes_.resize(124, ' ');
    add<std::uint16_t>(bytes_, 0x0100);
    add<std::uint16_t>(bytes_, 0x4D49);  // "MI", read as "IM" where the byte order differs
  }
  template <typename Number>
  void array(const std::string& name, int array_class, int type, const std::vector<std::int32_t>& size,
             const std::vector<Number>& value) {
    std::string body;
    element<std::uint32_t>(body, 6, {static_cast<std::uint32_t>(array_class), 0});
    element<std::int32_t>(body, 5, size);
    element<std::int8_t>(body, 1, {name.begin(), name.end()});
    element<Number>(body, type, value);
    add<std::uint32_t>(bytes_, 14);
    add<std::uint32_t>(bytes_, static_cast<std::uint32_t>(body.size()));
    bytes_ += body;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  template <typename Number>
  void add(std::string& to, Number number) const {
    std::string raw(reinterpret_cast<const char*>(&number), sizeof number);
    if (big_endian_ != (std::endian::native == std::endian::big)) raw = {raw.rbegin(), raw.rend()};
    to += raw;
  }
  template <typename Number>
  void element(std::string& to, int type, const std::vector<Number>& value) const {
    add<std::uint32_t>(to, static_cast<std::uint32_t>(type));
    add<std::uint32_t>(to, static_cast<std::uint32_t>(value.size() * sizeof(Number)));
    for (const Number number : value) add<Number>(to, number);
    to.resize((to.size() + 7) / 8 * 8, '\0');
  }
  bool big_endian_;
  std::string bytes_;
};

/// 2 rows × 3 columns × 2 bands of row + 10 column + 100 band in MATLAB's order (rows run fastest).
template <typename Number>
std::vector<Number> numbered() {
  std::vector<Number> value;
  for (int band = 0; band < 2; ++band)
    for (int column = 0; column < 3; ++column)
      for (int row = 0; row < 2; ++row) value.push_back(static_cast<Number>(row + 10 * column + 100 * band));
  return value;
}

void expect_numbered(const SpectralImage& image) {
  ASSERT_EQ(image.width, 3);
  ASSERT_EQ(image.height, 2);
  ASSERT_EQ(image.bands(), 2);
  for (int row = 0; row < 2; ++row)
    for (int column = 0; column < 3; ++column)
      for (int band = 0; band < 2; ++band) EXPECT_EQ(image.pixel(row, column)[band], row + 10 * column + 100 * band);
}

TEST_F(MatFiles, ReadsFilesMadeByHand) {
  for (const bool big_endian : {false, true}) {
    Level5 made(big_endian);
    made.array<double>("wl", 6, 9, {1, 2}, {500, 510.5});
    made.array<std::uint16_t>("scan", 11, 4, {2, 3, 2}, numbered<std::uint16_t>());
    made.array<double>("gain", 6, 9, {2, 2}, {1, 2, 3, 4});
    std::ofstream(file("a.mat"), std::ios::binary) << made.bytes();
    const MatFile found = read_mat(file("a.mat"));
    expect_numbered(found.image);
    EXPECT_EQ(found.image.wavelength_nm, Eigen::Vector2d(500, 510.5));
    EXPECT_EQ(found.cube, "scan");
    EXPECT_EQ(found.whole_bits, 16);
  }
}

/// Writes arrays through libmatio itself.
void write_arrays(const fs::path& path, mat_ft version, const std::vector<std::string>& cubes,
                  std::vector<double> wavelength = {500, 510}, const char* wavelength_name = "lambda") {
  mat_t* out = Mat_CreateVer(path.c_str(), nullptr, version);
  ASSERT_NE(out, nullptr);
  std::vector<float> value = numbered<float>();
  std::size_t size[] = {2, 3, 2};
  for (const std::string& name : cubes) {
    matvar_t* cube = Mat_VarCreate(name.c_str(), MAT_C_SINGLE, MAT_T_SINGLE, 3, size, value.data(), 0);
    Mat_VarWrite(out, cube, MAT_COMPRESSION_ZLIB);
    Mat_VarFree(cube);
  }
  std::size_t length[] = {wavelength.size(), 1};
  matvar_t* vector = Mat_VarCreate(wavelength_name, MAT_C_DOUBLE, MAT_T_DOUBLE, 2, length, wavelength.data(), 0);
  Mat_VarWrite(out, vector, MAT_COMPRESSION_NONE);
  Mat_VarFree(vector);
  Mat_Close(out);
}

TEST_F(MatFiles, ReadsCompressedAndHdf5Files) {
  for (const mat_ft version : {MAT_FT_MAT5, MAT_FT_MAT73}) {
    write_arrays(file("a.mat"), version, {"first", "second"});
    const MatFile found = read_mat(file("a.mat"), {.cube = "second"});
    expect_numbered(found.image);
    EXPECT_EQ(found.image.wavelength_nm, Eigen::Vector2d(500, 510));
    EXPECT_EQ(found.whole_bits, 0);
    expect_numbered(read_mat(file("a.mat"), {.cube = "first", .wavelength = "lambda"}).image);
    EXPECT_EQ(read_mat(file("a.mat"), {.cube = "first"}, Eigen::Vector2d(400, 420)).image.wavelength_nm,
              Eigen::Vector2d(400, 420));
    EXPECT_THAT(message("a.mat"), AllOf(HasSubstr("2 numeric arrays of three dimensions"),
                                        HasSubstr("first (2 × 3 × 2)"), HasSubstr("lambda (2 × 1)")));
  }
}

TEST_F(MatFiles, RoundTripsBits) {
  std::mt19937 random(3);
  SpectralImage image{5, 4, Eigen::Vector3d(400.25, 500.1, 700), {}};
  for (int v = 0; v < 60; ++v)
    image.value.push_back(std::bit_cast<float>(static_cast<std::uint32_t>(0x3F000000U + (random() & 0xFFFFFFU))));
  write_mat(file("a.mat"), image);
  const MatFile floats = read_mat(file("a.mat"));
  EXPECT_EQ(floats.image.value, image.value);
  EXPECT_EQ(floats.image.wavelength_nm, image.wavelength_nm);
  EXPECT_EQ(floats.whole_bits, 0);
  for (float& value : image.value) value = static_cast<float>(random() & 0xFFFFU);
  write_mat(file("a.mat"), image, MatType::kUint16);
  EXPECT_EQ(read_mat(file("a.mat")).image.value, image.value);
  EXPECT_EQ(read_mat(file("a.mat")).whole_bits, 16);
  image.value[7] = 0.5F;  // row 0, column 2, band 2
  EXPECT_THROW(
      {
        try {
          write_mat(file("b.mat"), image, MatType::kUint16);
        } catch (const InvalidInput& error) {
          EXPECT_THAT(error.what(), HasSubstr("row 0, column 2, band 2: 0.5"));
          throw;
        }
      },
      InvalidInput);
  EXPECT_FALSE(fs::exists(file("b.mat")));
}

TEST_F(MatFiles, SaysWhatIsMissingOrContradictory) {
  write_arrays(file("a.mat"), MAT_FT_MAT5, {"cube"});
  EXPECT_EQ(message("a.mat"), "");  // the others differ from this in one thing
  EXPECT_THAT(message("none.mat"), HasSubstr("cannot be opened"));
  EXPECT_THAT(message("a.mat", {.cube = "kube"}), AllOf(HasSubstr("no variable \"kube\""), HasSubstr("cube (2")));
  EXPECT_THAT(message("a.mat", {}, Eigen::Vector3d(1, 2, 3)), HasSubstr("3 wavelengths for the 2 × 3 × 2 values"));
  EXPECT_THAT(message("a.mat", {.cube = "lambda"}, Eigen::VectorXd::Constant(1, 50)), HasSubstr("100 to 20000 nm"));
  write_arrays(file("b.mat"), MAT_FT_MAT5, {"cube"}, {510, 500});
  EXPECT_THAT(message("b.mat"), AllOf(HasSubstr("\"lambda\": entry 2 is 500 nm after 510"), HasSubstr("increasing")));
  write_arrays(file("c.mat"), MAT_FT_MAT5, {"cube"}, {500, 510}, "x");
  EXPECT_THAT(message("c.mat"), AllOf(HasSubstr("0 vectors of 2 numbers"), HasSubstr("x (2 × 1)")));
  EXPECT_EQ(message("c.mat", {.wavelength = "x"}), "");
  std::ofstream(file("d.mat")) << "no matlab";
  EXPECT_THAT(message("d.mat"), HasSubstr("d.mat"));
}

TEST_F(MatFiles, RefusesLyingAndCutFiles) {
  // A cube that claims 2^31 - 1 rows in a file of some hundred bytes must not be allocated.
  Level5 lying(false);
  lying.array<std::uint16_t>("cube", 11, 4, {2147483647, 30000, 2}, numbered<std::uint16_t>());
  lying.array<double>("wl", 6, 9, {1, 2}, {500, 510});
  std::ofstream(file("lying.mat"), std::ios::binary) << lying.bytes();
  EXPECT_THAT(message("lying.mat"), HasSubstr("more than a file of"));
  for (const mat_ft version : {MAT_FT_MAT5, MAT_FT_MAT73}) {
    write_arrays(file("whole.mat"), version, {"cube"});
    const auto size = fs::file_size(file("whole.mat"));
    for (const double share : {0.1, 0.5, 0.9}) {
      fs::copy_file(file("whole.mat"), file("cut.mat"), fs::copy_options::overwrite_existing);
      fs::resize_file(file("cut.mat"), static_cast<std::uintmax_t>(share * static_cast<double>(size)));
      EXPECT_THAT(message("cut.mat"), HasSubstr("cut.mat")) << "version " << version << ", share " << share;
    }
  }
}

}  // namespace
}  // namespace interglow::image
