// SPDX-License-Identifier: GPL-3.0-or-later
#include "image/image_metrics.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "diagnostics/error.h"
#include "image/preview.h"
#include "spectral/colour.h"
#include "spectral/spectral_metrics.h"

namespace interglow::image {
namespace {

using XyzImage = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

constexpr float kNoValue = std::numeric_limits<float>::quiet_NaN();

void require_same_layout(const SpectralImage& image, const SpectralImage& reference, const CompareParams& params) {
  if (image.width != reference.width || image.height != reference.height || image.bands() != reference.bands()) {
    throw InvalidParams(
        fmt::format("compare: the image has {} x {} pixels and {} bands, the reference {} x {} and {}; expected the "
                    "same. Render or "
                    "resample one like the other.",
                    image.width, image.height, image.bands(), reference.width, reference.height, reference.bands()));
  }
  for (Eigen::Index i = 0; i < image.wavelength_nm.size(); ++i) {
    if (std::abs(image.wavelength_nm[i] - reference.wavelength_nm[i]) <= 0.01) continue;
    throw InvalidParams(
        fmt::format("compare: band {} is {} nm in the image and {} nm in the reference; expected the same wavelengths.",
                    i + 1, image.wavelength_nm[i], reference.wavelength_nm[i]));
  }
  const std::size_t pixels = static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height);
  if (!params.mask.empty() && params.mask.size() != pixels) {
    throw InvalidParams(fmt::format("compare: the mask has {} pixels, the images {}; expected the same size.",
                                    params.mask.size(), pixels));
  }
}

bool is_black(const float* spectrum, int bands) {
  return std::all_of(spectrum, spectrum + bands, [](float value) { return value == 0.0F; });
}

std::vector<std::size_t> compared_pixels(const SpectralImage& image, const SpectralImage& reference,
                                         const std::vector<std::uint8_t>& mask) {
  std::vector<std::size_t> pixels;
  const auto bands = static_cast<std::size_t>(image.bands());
  for (std::size_t p = 0; p < image.value.size() / bands; ++p) {
    const bool wanted = mask.empty() ? !is_black(image.value.data() + p * bands, image.bands()) ||
                                           !is_black(reference.value.data() + p * bands, image.bands())
                                     : mask[p] != 0;
    if (wanted) pixels.push_back(p);
  }
  if (pixels.empty()) {
    throw InvalidParams("compare: no pixel is left to compare; both images are black or the mask is empty.");
  }
  return pixels;
}

Statistic statistic_of(const std::vector<float>& map) {
  Statistic result;
  double sum = 0.0;
  for (const float value : map) {
    if (std::isnan(value)) continue;
    sum += static_cast<double>(value);
    result.largest = std::max(result.largest, static_cast<double>(value));
    ++result.count;
  }
  if (result.count == 0) return result;
  result.mean = sum / static_cast<double>(result.count);
  double squares = 0.0;
  for (const float value : map) {
    if (!std::isnan(value))
      squares += (static_cast<double>(value) - result.mean) * (static_cast<double>(value) - result.mean);
  }
  result.standard_deviation = std::sqrt(squares / static_cast<double>(result.count));
  return result;
}

/// What one image looks like under the common exposure.
struct Colours {
  XyzImage xyz;  ///< exposed and adapted
  RgbImage rgb;
};

Colours colours_of(const SpectralImage& image, double exposure, const CompareParams& params) {
  XyzImage xyz = exposure * tristimulus_image(image);
  if (params.adapt_from_white) {
    const Eigen::Vector3d white = *params.adapt_from_white / (*params.adapt_from_white)[1];
    xyz = xyz * spectral::bradford_adaptation(white).transpose();
  }
  return {std::move(xyz), make_preview(image, {.exposure = exposure, .adapt_from_white = params.adapt_from_white})};
}

Eigen::Vector3d encoded_pixel(const RgbImage& rgb, std::size_t pixel) {
  const float* linear = rgb.value.data() + 3 * pixel;
  return spectral::encoded_srgb(Eigen::Map<const Eigen::Vector3f>(linear).cast<double>());
}

void compare_colours(const std::vector<std::size_t>& pixels, const Colours& image, const Colours& reference,
                     ImageComparison& result) {
  for (const std::size_t p : pixels) {
    const auto row = static_cast<Eigen::Index>(p);
    result.delta_srgb_map.value[p] =
        static_cast<float>(spectral::delta_srgb(encoded_pixel(image.rgb, p), encoded_pixel(reference.rgb, p)));
    const Eigen::Vector3d lab_a = spectral::cielab(image.xyz.row(row).transpose());
    const Eigen::Vector3d lab_b = spectral::cielab(reference.xyz.row(row).transpose());
    result.ciede2000_map.value[p] = static_cast<float>(spectral::ciede2000(lab_a, lab_b));
    if (lab_a[0] > 100.0 || lab_b[0] > 100.0) ++result.above_white;
  }
}

void compare_spectra(const std::vector<std::size_t>& pixels, const SpectralImage& image, const SpectralImage& reference,
                     ImageComparison& result) {
  const Eigen::Index bands = image.bands();
  const auto spectrum = [bands](const SpectralImage& from, std::size_t pixel) -> Eigen::VectorXd {
    return Eigen::Map<const Eigen::VectorXf>(from.value.data() + pixel * static_cast<std::size_t>(bands), bands)
        .cast<double>();
  };
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(bands);
  Eigen::VectorXd reference_sum = Eigen::VectorXd::Zero(bands);
  double difference_sum = 0.0;
  for (const std::size_t p : pixels) {
    const Eigen::VectorXd a = spectrum(image, p);
    const Eigen::VectorXd b = spectrum(reference, p);
    const Eigen::VectorXd square = (a - b).cwiseAbs2();
    squares += square;
    reference_sum += b;
    difference_sum += (a - b).sum();
    result.relative_rmse_map.value[p] = static_cast<float>(std::sqrt(square.mean()));
    if (const auto angle = spectral::spectral_angle(a, b)) {
      result.spectral_angle_deg_map.value[p] = static_cast<float>(*angle * 180.0 / std::numbers::pi);
    }
  }
  const auto count = static_cast<double>(pixels.size());
  result.band_rmse = (squares / count).cwiseSqrt();
  const Eigen::ArrayXd means = reference_sum.array() / count;
  result.band_relative_rmse = result.band_rmse.array() / means;
  result.rmse = std::sqrt(squares.mean() / count);
  result.mean_difference = difference_sum / (count * static_cast<double>(bands));
  const double mean = means.mean();
  result.relative_rmse = result.rmse / mean;
  result.relative_mean_difference = result.mean_difference / mean;
  for (const std::size_t p : pixels) result.relative_rmse_map.value[p] /= static_cast<float>(mean);
}

}  // namespace

ImageComparison compare(const SpectralImage& image, const SpectralImage& reference, const CompareParams& params) {
  require_same_layout(image, reference, params);
  const std::vector<std::size_t> pixels = compared_pixels(image, reference, params.mask);
  ImageComparison result;
  result.pixels = pixels.size();
  const ScalarMap empty{
      image.width, image.height,
      std::vector<float>(static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height), kNoValue)};
  result.spectral_angle_deg_map = result.delta_srgb_map = result.ciede2000_map = result.relative_rmse_map = empty;
  compare_spectra(pixels, image, reference, result);

  result.exposure = params.exposure ? *params.exposure : automatic_exposure(reference);
  const Colours image_colours = colours_of(image, result.exposure, params);
  const Colours reference_colours = colours_of(reference, result.exposure, params);
  result.image_clipped_share = image_colours.rgb.clipped_share;
  result.reference_clipped_share = reference_colours.rgb.clipped_share;
  compare_colours(pixels, image_colours, reference_colours, result);

  result.spectral_angle_deg = statistic_of(result.spectral_angle_deg_map.value);
  result.delta_srgb = statistic_of(result.delta_srgb_map.value);
  result.ciede2000 = statistic_of(result.ciede2000_map.value);
  return result;
}

}  // namespace interglow::image
