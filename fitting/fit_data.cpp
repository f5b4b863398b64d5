// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/fit_data.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "diagnostics/error.h"

namespace interglow::fitting {
namespace {

/// Relative noise that is taken where the capture does not know its own.
constexpr double kUnknownNoise = 2e-3;

/// What bright values of each band reach: the 99th percentile of the pixels that take part.
std::vector<double> bright(const image::SpectralImage& image, const std::vector<std::uint8_t>& use) {
  const auto bands = static_cast<std::size_t>(image.bands());
  std::vector<double> result;
  for (std::size_t b = 0; b < bands; ++b) {
    std::vector<float> values;
    for (std::size_t p = 0; p < use.size(); ++p) {
      if (use[p]) values.push_back(image.value[p * bands + b]);
    }
    result.push_back(quantile(values, 0.99));
  }
  return result;
}

std::size_t used_values(const FitData& data) {
  const auto pixels = std::count_if(data.use.begin(), data.use.end(), [](std::uint8_t used) { return used != 0; });
  return static_cast<std::size_t>(pixels) * static_cast<std::size_t>(data.image.bands());
}

}  // namespace

double quantile(std::vector<float>& values, double share) {
  if (values.empty()) return 0.0;
  const auto at = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return static_cast<double>(values[static_cast<std::size_t>(at)]);
}

FitData fit_data(const Capture& capture, const FitParams& params) {
  FitData data;
  data.image = capture.image;
  data.use = capture.use;
  const std::vector<double> peak = bright(data.image, data.use);
  const double brightest = *std::max_element(peak.begin(), peak.end());
  if (!(brightest > 0.0)) throw InvalidInput("The capture is dark in all bands: nothing can be fitted to it.");
  const auto bands = static_cast<std::size_t>(data.image.bands());
  data.sigma.resize(data.image.value.size());
  for (std::size_t p = 0; p < data.use.size(); ++p) {
    for (std::size_t b = 0; b < bands; ++b) {
      const double value = static_cast<double>(data.image.value[p * bands + b]);
      double variance = std::pow(params.model_sigma * std::max(value, 0.0), 2);
      variance += capture.noise.known() ? capture.variance(p, static_cast<int>(b), value)
                                        : std::pow(kUnknownNoise * peak[b], 2);
      data.sigma[p * bands + b] = static_cast<float>(std::max(std::sqrt(variance), 1e-6 * brightest));
    }
  }
  data.residuals = used_values(data);
  return data;
}

FitData reduced(const FitData& data, int factor, double sigma_share) {
  FitData small;
  const int width = data.image.width / factor;
  const int height = data.image.height / factor;
  const auto bands = static_cast<std::size_t>(data.image.bands());
  const auto at = [](int row, int column, int across) {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(across) + static_cast<std::size_t>(column);
  };
  small.image.width = width;
  small.image.height = height;
  small.image.wavelength_nm = data.image.wavelength_nm;
  small.use.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 1);
  small.image.value.assign(small.use.size() * bands, 0.0F);
  for (int row = 0; row < height * factor; ++row) {
    for (int column = 0; column < width * factor; ++column) {
      const std::size_t to = at(row / factor, column / factor, width);
      if (data.use[at(row, column, data.image.width)] == 0) small.use[to] = 0;
      for (std::size_t b = 0; b < bands; ++b) {
        small.image.value[to * bands + b] += data.image.pixel(row, column)[b] / static_cast<float>(factor * factor);
      }
    }
  }
  const std::vector<double> peak = bright(small.image, small.use);
  const double brightest = *std::max_element(peak.begin(), peak.end());
  small.sigma.resize(small.image.value.size());
  for (std::size_t i = 0; i < small.sigma.size(); ++i)
    small.sigma[i] = static_cast<float>(sigma_share * std::max(peak[i % bands], 1e-3 * brightest));
  small.residuals = used_values(small);
  return small;
}

}  // namespace interglow::fitting
