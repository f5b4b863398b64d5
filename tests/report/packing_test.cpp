// SPDX-License-Identifier: GPL-3.0-or-later
#include "report/packing.h"

#include <Imath/half.h>
#include <gtest/gtest.h>
#include <openssl/evp.h>
#include <zlib.h>

#include <cmath>
#include <cstring>
#include <random>

namespace interglow::report {
namespace {

/// What the page does: base64, inflate, numbers, scale.
std::vector<float> unpack(const Json& packed, std::size_t count) {
  const std::string text = packed.at("data");
  std::vector<unsigned char> bytes(text.size());
  EVP_DecodeBlock(bytes.data(), reinterpret_cast<const unsigned char*>(text.data()), static_cast<int>(text.size()));
  const bool half = packed.at("type") == "f16";
  std::vector<unsigned char> raw(count * (half ? 2 : 4));
  uLongf size = raw.size();
  EXPECT_EQ(uncompress(raw.data(), &size, bytes.data(), bytes.size()), Z_OK);
  EXPECT_EQ(size, raw.size());
  std::vector<float> values(count);
  const float scale = packed.at("scale");
  for (std::size_t i = 0; i < count; ++i) {
    if (half) {
      Imath::half value;
      std::uint16_t bits = 0;
      std::memcpy(&bits, raw.data() + 2 * i, 2);
      value.setBits(bits);
      values[i] = static_cast<float>(value) * scale;
    } else {
      std::memcpy(&values[i], raw.data() + 4 * i, 4);
    }
  }
  return values;
}

TEST(Packing, HalfKeepsElevenBitsAndFloatAll) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> uniform(-3e5F, 3e5F);
  std::vector<float> values(1000);
  for (float& value : values) value = uniform(random);
  const auto half = unpack(pack_half(values, {1000}), values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    // Relative 2^-11, absolute 2^-25 of the largest below the normal numbers.
    EXPECT_NEAR(half[i], values[i], std::abs(values[i]) / 2048 + 3e5 * 0x1.0p-24) << i;
  }
  EXPECT_EQ(unpack(pack_float(values, {1000}), values.size()), values);
}

TEST(Packing, SpectraOfAFewMaterialsComeBack) {
  image::SpectralImage image{20, 10, Eigen::VectorXd::LinSpaced(61, 400, 700), {}};
  for (int p = 0; p < 200; ++p) {
    for (int b = 0; b < 61; ++b)
      image.value.push_back(static_cast<float>((1 + p % 7) * std::exp(-0.01 * b) + (p % 3) * std::sin(0.05 * b)));
  }
  const Json packed = pack_spectra(image);
  const int rank = packed.at("basis").at("shape")[0];
  EXPECT_EQ(rank, 2);
  const auto basis = unpack(packed.at("basis"), static_cast<std::size_t>(rank) * 61);
  const auto weights = unpack(packed.at("weights"), static_cast<std::size_t>(rank) * 200);
  for (std::size_t p = 0; p < 200; ++p) {
    for (std::size_t b = 0; b < 61; ++b) {
      float value = 0.0F;
      for (std::size_t k = 0; k < static_cast<std::size_t>(rank); ++k)
        value += weights[p * static_cast<std::size_t>(rank) + k] * basis[k * 61 + b];
      EXPECT_NEAR(value, image.value[p * 61 + b], 0.02) << p << " " << b;  // 11 bits of weights up to 30
    }
  }
}

TEST(Packing, LargePicturesAreAveragedDown) {
  image::SpectralImage image{600, 300, Eigen::VectorXd::Constant(1, 550.0), std::vector<float>(180000, 2.0F)};
  const Json packed = pack_spectra(image, 256);
  EXPECT_EQ(packed.at("weights").at("shape"), (Json{100, 200, 1}));
}

}  // namespace
}  // namespace interglow::report
