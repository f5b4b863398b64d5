// SPDX-License-Identifier: GPL-3.0-or-later
#include "report/packing.h"

#include <Imath/half.h>
#include <openssl/evp.h>
#include <zlib.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <string>

#include "diagnostics/error.h"

namespace interglow::report {
namespace {

std::string deflate_base64(const void* bytes, std::size_t size) {
  uLongf packed_size = compressBound(size);
  std::vector<unsigned char> packed(packed_size);
  if (compress2(packed.data(), &packed_size, static_cast<const Bytef*>(bytes), size, 9) != Z_OK) {
    throw NumericalFailure("report: packing the pictures failed (zlib).");
  }
  std::string text(4 * ((packed_size + 2) / 3) + 1, '\0');
  const int length =
      EVP_EncodeBlock(reinterpret_cast<unsigned char*>(text.data()), packed.data(), static_cast<int>(packed_size));
  text.resize(static_cast<std::size_t>(length));
  return text;
}

/// Box average onto a grid of at most `largest_side` pixels a side; a view of the same picture.
image::SpectralImage shrink(const image::SpectralImage& image, int largest_side) {
  const int factor = (std::max(image.width, image.height) + largest_side - 1) / largest_side;
  if (factor <= 1) return image;
  image::SpectralImage small;
  small.width = (image.width + factor - 1) / factor;
  small.height = (image.height + factor - 1) / factor;
  small.wavelength_nm = image.wavelength_nm;
  const auto bands = static_cast<std::size_t>(image.bands());
  small.value.assign(static_cast<std::size_t>(small.width) * static_cast<std::size_t>(small.height) * bands, 0.0F);
  std::vector<double> sum(bands);
  for (int row = 0; row < small.height; ++row) {
    for (int column = 0; column < small.width; ++column) {
      std::fill(sum.begin(), sum.end(), 0.0);
      int count = 0;
      for (int r = row * factor; r < std::min(image.height, (row + 1) * factor); ++r) {
        for (int c = column * factor; c < std::min(image.width, (column + 1) * factor); ++c) {
          const float* pixel = image.pixel(r, c);
          for (std::size_t b = 0; b < bands; ++b) sum[b] += static_cast<double>(pixel[b]);
          ++count;
        }
      }
      float* out = small.pixel(row, column);
      for (std::size_t b = 0; b < bands; ++b) out[b] = static_cast<float>(sum[b] / count);
    }
  }
  return small;
}

}  // namespace

Json pack_half(std::span<const float> values, const std::vector<int>& shape) {
  float largest = 0.0F;
  for (const float value : values) {
    if (std::isfinite(value)) largest = std::max(largest, std::abs(value));
  }
  const float scale = largest > 0.0F ? largest : 1.0F;
  std::vector<std::uint16_t> bits;
  bits.reserve(values.size());
  for (const float value : values) bits.push_back(Imath::half(value / scale).bits());
  return {{"type", "f16"}, {"shape", shape}, {"scale", scale}, {"data", deflate_base64(bits.data(), 2 * bits.size())}};
}

Json pack_float(std::span<const float> values, const std::vector<int>& shape) {
  return {
      {"type", "f32"}, {"shape", shape}, {"scale", 1.0}, {"data", deflate_base64(values.data(), 4 * values.size())}};
}

Json pack_spectra(const image::SpectralImage& image, int largest_side, int largest_rank) {
  const image::SpectralImage small = shrink(image, largest_side);
  const Eigen::Index bands = small.bands();
  const Eigen::Index pixels = Eigen::Index{small.width} * small.height;
  using Rows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Eigen::Map<const Rows> spectra(small.value.data(), pixels, bands);
  const Eigen::MatrixXd gram = spectra.cast<double>().transpose() * spectra.cast<double>();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(gram);
  const double energy = std::max(0.0, eigen.eigenvalues().sum());
  Eigen::Index rank = 0;
  double kept = 0.0;
  while (rank < std::min<Eigen::Index>(largest_rank, bands) && kept < (1.0 - 1e-7) * energy) {
    kept += eigen.eigenvalues()[bands - 1 - rank];
    ++rank;
  }
  rank = std::max<Eigen::Index>(rank, 1);
  const Eigen::MatrixXd basis = eigen.eigenvectors().rightCols(rank).rowwise().reverse();
  const Rows basis_rows = basis.transpose().cast<float>();
  const Rows weights = (spectra.cast<double>() * basis).cast<float>();
  const auto view = [](const Rows& rows) {
    return std::span<const float>(rows.data(), static_cast<std::size_t>(rows.size()));
  };
  return {{"wavelength_nm", std::vector<double>(small.wavelength_nm.begin(), small.wavelength_nm.end())},
          {"basis", pack_float(view(basis_rows), {static_cast<int>(rank), static_cast<int>(bands)})},
          {"weights", pack_half(view(weights), {small.height, small.width, static_cast<int>(rank)})}};
}

}  // namespace interglow::report
