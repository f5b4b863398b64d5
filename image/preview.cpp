// SPDX-License-Identifier: GPL-3.0-or-later
#include "image/preview.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "diagnostics/error.h"
#include "spectral/colour.h"
#include "spectral/observer.h"

namespace interglow::image {
namespace {

using XyzImage = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

double exposure_for(const XyzImage& xyz, const PreviewParams& params) {
  std::vector<double> luminance;
  luminance.reserve(static_cast<std::size_t>(xyz.rows()));
  for (Eigen::Index i = 0; i < xyz.rows(); ++i) {
    if (xyz(i, 1) > 0.0) luminance.push_back(xyz(i, 1));
  }
  if (luminance.empty()) return 1.0;
  const auto rank =
      static_cast<std::ptrdiff_t>(std::ceil(params.automatic_percentile * static_cast<double>(luminance.size()))) - 1;
  const auto nth = luminance.begin() + std::max<std::ptrdiff_t>(rank, 0);
  std::nth_element(luminance.begin(), nth, luminance.end());
  return params.automatic_level / *nth;
}

}  // namespace

void validate(const PreviewParams& params) {
  const auto require = [](bool good, const char* field, double value, const char* range) {
    if (!good) throw InvalidParams(fmt::format("preview: {} is {}; expected {}.", field, value, range));
  };
  if (params.exposure) {
    require(*params.exposure > 0.0 && std::isfinite(*params.exposure), "exposure", *params.exposure,
            "a positive number");
  }
  require(params.automatic_percentile > 0.0 && params.automatic_percentile <= 1.0, "automatic_percentile",
          params.automatic_percentile, "a number above 0, at most 1");
  require(params.automatic_level > 0.0 && std::isfinite(params.automatic_level), "automatic_level",
          params.automatic_level, "a positive number");
}

XyzImage tristimulus_image(const SpectralImage& image) {
  const auto pixels = static_cast<Eigen::Index>(image.width) * image.height;
  using RowMajor = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Eigen::Map<const RowMajor> values(image.value.data(), pixels, image.bands());
  if (image.bands() == 1) return values.cast<double>() * spectral::kD65White.transpose();
  const auto grid = spectral::WavelengthGrid::from_centers(image.wavelength_nm);
  const spectral::TristimulusWeights weights = spectral::cie1931_weights(grid);
  XyzImage xyz(pixels, 3);
  constexpr Eigen::Index kRows = 4096;  // keeps the converted block in the cache
  for (Eigen::Index first = 0; first < pixels; first += kRows) {
    const Eigen::Index rows = std::min(kRows, pixels - first);
    xyz.middleRows(first, rows).noalias() = values.middleRows(first, rows).cast<double>() * weights;
  }
  return xyz;
}

double automatic_exposure(const SpectralImage& image, const PreviewParams& params) {
  validate(params);
  return exposure_for(tristimulus_image(image), params);
}

RgbImage make_preview(const SpectralImage& image, const PreviewParams& params) {
  validate(params);
  const XyzImage xyz = tristimulus_image(image);
  RgbImage rgb{image.width, image.height, {}, params.exposure ? *params.exposure : exposure_for(xyz, params), 0.0};
  const Eigen::Matrix3d adapt =
      params.adapt_from_white ? spectral::bradford_adaptation(*params.adapt_from_white / (*params.adapt_from_white)[1])
                              : Eigen::Matrix3d(Eigen::Matrix3d::Identity());
  rgb.value.resize(static_cast<std::size_t>(xyz.rows()) * 3);
  std::size_t lit = 0;
  std::size_t clipped = 0;
  constexpr double kRounding = 1e-4;  // below a tenth of an 8-bit step
  for (Eigen::Index i = 0; i < xyz.rows(); ++i) {
    const Eigen::Vector3d linear = spectral::linear_srgb(adapt * (rgb.exposure * xyz.row(i).transpose()));
    for (Eigen::Index c = 0; c < 3; ++c) rgb.value[static_cast<std::size_t>(3 * i + c)] = static_cast<float>(linear[c]);
    if (!(xyz(i, 1) > 0.0)) continue;
    ++lit;
    if (linear.minCoeff() < -kRounding || linear.maxCoeff() > 1.0 + kRounding) ++clipped;
  }
  if (lit > 0) rgb.clipped_share = static_cast<double>(clipped) / static_cast<double>(lit);
  return rgb;
}

}  // namespace interglow::image
