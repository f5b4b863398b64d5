// SPDX-License-Identifier: GPL-3.0-or-later
#include "image/envi.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <random>
#include <string>

#include "diagnostics/error.h"
#include "tests/temporary_folder.h"

namespace interglow::image {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr int kWidth = 3;
constexpr int kHeight = 2;
constexpr int kBands = 4;

class Envi : public ::testing::Test {
 protected:
  fs::path file(const std::string& name) const { return folder_ / name; }
  void write(const std::string& name, const std::string& bytes) const {
    std::ofstream(file(name), std::ios::binary) << bytes;
  }
  std::string message(const std::string& header, std::size_t bytes) const {
    write("a.hdr", header);
    write("a.img", std::string(bytes, '\1'));
    try {
      read_envi(file("a.hdr"));
    } catch (const InvalidInput& error) {
      return error.what();
    }
    return "";
  }

 private:
  const test::TemporaryFolder folder_;
};

std::string header(int type, const std::string& interleave, int byte_order, const std::string& more = "") {
  return "ENVI\ndescription = {made by hand,\n two lines}\nsamples = 3\nlines   = 2\nbands = 4\nheader offset = 0\n"
         "data type = " +
         std::to_string(type) + "\nInterleave = " + interleave + "\nbyte order = " + std::to_string(byte_order) +
         "\nwavelength units = Nanometers\nwavelength = {\n 400, 450.5,\n 500, 550}\n" + more;
}

/// A different value in every place, exact in all types: from -2 (0 if unsigned) up.
double value_at(int row, int column, int band, bool is_signed) {
  return (is_signed ? -2 : 0) + band + 10 * column + 60 * row;
}

/// Bytes from the highest on, as the definition of the types has them.
template <typename Number>
std::string big_endian_bytes(Number number) {
  using Bits =
      std::conditional_t<sizeof(Number) == 1, std::uint8_t,
                         std::conditional_t<sizeof(Number) == 2, std::uint16_t,
                                            std::conditional_t<sizeof(Number) == 4, std::uint32_t, std::uint64_t>>>;
  const Bits bits = std::bit_cast<Bits>(number);
  std::string bytes;
  for (int shift = 8 * static_cast<int>(sizeof(Number)) - 8; shift >= 0; shift -= 8)
    bytes += static_cast<char>(static_cast<std::uint64_t>(bits) >> shift & 0xFFU);
  return bytes;
}

template <typename Number>
std::string bytes_of(double value, bool big_endian) {
  std::string bytes = big_endian_bytes(static_cast<Number>(value));
  if (!big_endian) bytes = {bytes.rbegin(), bytes.rend()};
  return bytes;
}

TEST_F(Envi, ReadsEveryTypeInterleaveAndByteOrder) {
  struct Type {
    int code;
    bool is_signed;
    std::function<std::string(double, bool)> bytes;
  };
  const Type types[] = {
      {1, false, bytes_of<std::uint8_t>},   {2, true, bytes_of<std::int16_t>},  {3, true, bytes_of<std::int32_t>},
      {4, true, bytes_of<float>},           {5, true, bytes_of<double>},        {12, false, bytes_of<std::uint16_t>},
      {13, false, bytes_of<std::uint32_t>}, {14, true, bytes_of<std::int64_t>}, {15, false, bytes_of<std::uint64_t>}};
  for (const Type& type : types) {
    for (const bool big_endian : {false, true}) {
      for (const std::string interleave : {"bsq", "bil", "BIP"}) {
        std::string raw;
        const auto add = [&](int row, int column, int band) {
          raw += type.bytes(value_at(row, column, band, type.is_signed), big_endian);
        };
        if (interleave == "bsq") {
          for (int b = 0; b < kBands; ++b)
            for (int r = 0; r < kHeight; ++r)
              for (int c = 0; c < kWidth; ++c) add(r, c, b);
        } else if (interleave == "bil") {
          for (int r = 0; r < kHeight; ++r)
            for (int b = 0; b < kBands; ++b)
              for (int c = 0; c < kWidth; ++c) add(r, c, b);
        } else {
          for (int r = 0; r < kHeight; ++r)
            for (int c = 0; c < kWidth; ++c)
              for (int b = 0; b < kBands; ++b) add(r, c, b);
        }
        write("a.hdr", header(type.code, interleave, big_endian ? 1 : 0));
        write("a.img", raw);
        const EnviFile found = read_envi(file("a.hdr"));
        ASSERT_EQ(found.image.width, kWidth);
        ASSERT_EQ(found.image.height, kHeight);
        ASSERT_EQ(found.image.wavelength_nm, Eigen::Vector4d(400, 450.5, 500, 550));
        for (int r = 0; r < kHeight; ++r) {
          for (int c = 0; c < kWidth; ++c) {
            for (int b = 0; b < kBands; ++b) {
              ASSERT_EQ(found.image.pixel(r, c)[b], value_at(r, c, b, type.is_signed))
                  << "type " << type.code << ' ' << interleave << " big endian " << big_endian;
            }
          }
        }
      }
    }
  }
}

TEST_F(Envi, RoundTripsBits) {
  std::mt19937 random(1);
  SpectralImage image{5, 4, Eigen::Vector3d(400.25, 500.1, 700), {}};
  for (int v = 0; v < 60; ++v)
    image.value.push_back(std::bit_cast<float>(static_cast<std::uint32_t>(0x3F000000U + (random() & 0xFFFFFFU))));
  SpectralImage words = image;
  for (float& value : words.value) value = static_cast<float>(random() & 0xFFFFU);
  for (const Interleave interleave :
       {Interleave::kBandSequential, Interleave::kBandInterleavedByLine, Interleave::kBandInterleavedByPixel}) {
    for (const bool big_endian : {false, true}) {
      write_envi(file("f.img"), image, {.interleave = interleave, .big_endian = big_endian, .description = "floats"});
      const EnviFile floats = read_envi(file("f.hdr"));
      EXPECT_EQ(floats.image.value, image.value);
      EXPECT_EQ(floats.image.wavelength_nm, image.wavelength_nm);
      EXPECT_EQ(floats.header.at("description"), "floats");
      write_envi(file("w.img"), words, {.interleave = interleave, .type = EnviType::kUint16, .big_endian = big_endian});
      EXPECT_EQ(read_envi(file("w.img")).image.value, words.value);
      EXPECT_EQ(fs::file_size(file("w.img")), 120U);
    }
  }
}

TEST_F(Envi, SortsBandsAndConvertsMicrometres) {
  write("a.hdr",
        "ENVI\nsamples=1\nlines=1\nbands=3\ndata type=1\ninterleave=bip\nwavelength units = Micrometers\n"
        "; a comment\nwavelength={0.7,0.5,0.6}\nheader offset=2\nreflectance scale factor=10\n"
        "data ignore value=30\n");
  write("a", std::string("xx\x14\x1e\x28"));
  const SpectralImage image = read_envi(file("a.hdr")).image;
  EXPECT_EQ(image.wavelength_nm, Eigen::Vector3d(500, 600, 700));
  EXPECT_TRUE(std::isnan(image.value[0]));
  EXPECT_EQ(image.value[1], 4.0F);
  EXPECT_EQ(image.value[2], 2.0F);
}

TEST_F(Envi, SaysWhatIsMissingOrContradictory) {
  const auto changed = [](const std::string& from, const std::string& to) {
    std::string text = header(12, "bsq", 0);
    return text.replace(text.find(from), from.size(), to);
  };
  EXPECT_EQ(message(header(12, "bsq", 0), 48), "");  // the others differ from this in one thing
  EXPECT_THAT(message(header(12, "bsq", 0), 47),
              AllOf(HasSubstr("a.img: 47 bytes"), HasSubstr("3 samples × 2 lines × 4")));
  EXPECT_THAT(message(header(12, "bsq", 0), 50), HasSubstr("a.img: 50 bytes"));
  EXPECT_THAT(message(changed("ENVI", "IVNE"), 48), HasSubstr("a.hdr:1: no ENVI header"));
  EXPECT_THAT(message(changed("samples = 3\n", ""), 48), HasSubstr("no entry \"samples\""));
  EXPECT_THAT(message(changed("samples = 3", "samples = three"), 48),
              HasSubstr("a.hdr:4: samples = three; expected a whole"));
  EXPECT_THAT(message(changed("lines   = 2", "lines = -2"), 48), HasSubstr("a.hdr:5: lines = -2"));
  EXPECT_THAT(message(changed("data type = 12", "data type = 6"), 48),
              AllOf(HasSubstr("data type = 6"), HasSubstr("real type")));
  EXPECT_THAT(message(changed("bsq", "bsx"), 48), AllOf(HasSubstr("interleave = bsx"), HasSubstr("bsq, bil or bip")));
  EXPECT_THAT(message(changed("byte order = 0\n", ""), 48), HasSubstr("no entry \"byte order\""));
  EXPECT_THAT(message(changed("500, 550", "500"), 48),
              AllOf(HasSubstr("wavelength: 3 entries"), HasSubstr("that is 4")));
  EXPECT_THAT(message(changed("500, 550", "500, 400"), 48), HasSubstr("400 nm is given to bands 1 and 4"));
  EXPECT_THAT(message(changed("500, 550", "500, nan"), 48), HasSubstr("entry 4 is \"nan\""));
  EXPECT_THAT(message(changed("Nanometers", "Micrometers"), 48), HasSubstr("400000 nm; expected 100 to 20000"));
  EXPECT_THAT(message(changed("Nanometers", "Index"), 48), HasSubstr("wavelength units = index"));
  EXPECT_THAT(message(changed("550}", "550"), 48), HasSubstr("the brace is not closed"));
  EXPECT_THAT(message(changed("bands = 4", "bands = 4\nbands = 4"), 48), HasSubstr("bands is given twice"));
  EXPECT_THAT(message(changed("bands = 4", "bands = 4\nwhat"), 48), HasSubstr("a.hdr:7: \"what\""));
  EXPECT_THAT(message(header(12, "bsq", 0, "reflectance scale factor = 0\n"), 48),
              HasSubstr("expected a number above 0"));
}

TEST_F(Envi, DoesNotBelieveSizesThatTheFileCannotHold) {
  const std::string huge =
      "ENVI\nsamples=16777216\nlines=16777216\nbands=1\ndata type=4\ninterleave=bsq\nbyte order=0\n"
      "wavelength={500}\n";
  EXPECT_THAT(message(huge, 64), HasSubstr("64 bytes"));
}

TEST_F(Envi, NamesTheDataFileThatIsNotThere) {
  write("b.hdr", header(12, "bsq", 0));
  try {
    read_envi(file("b.hdr"));
    FAIL();
  } catch (const InvalidInput& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("b.hdr: no data file"), HasSubstr(".img")));
  }
}

TEST_F(Envi, RefusesValuesThatDoNotFit) {
  SpectralImage image{2, 1, Eigen::VectorXd::Constant(1, 500.0), {1.0F, 1.5F}};
  try {
    write_envi(file("a.img"), image, {.type = EnviType::kUint16});
    FAIL();
  } catch (const InvalidInput& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("row 0, column 1, band 1: 1.5"), HasSubstr("floats")));
  }
  EXPECT_FALSE(fs::exists(file("a.img")));
  EXPECT_THROW(write_envi(file("a.hdr"), image), InvalidParams);
  EXPECT_THROW(write_envi(file("a.img"), image, {.description = "a}"}), InvalidParams);
}

}  // namespace
}  // namespace interglow::image
