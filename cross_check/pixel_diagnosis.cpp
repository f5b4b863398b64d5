// SPDX-License-Identifier: GPL-3.0-or-later
#include "cross_check/pixel_diagnosis.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <numeric>

#include "diagnostics/error.h"

namespace interglow::cross_check {
namespace {

/// Relative difference that computing and storing in single precision explains.
constexpr double kStorageRounding = 1e-5;

/// Marks the pixels within `radius` of a boundary between covered (non-zero) and empty pixels of the reference.
std::vector<char> silhouette_band(const std::vector<double>& reference, int width, int height, int radius) {
  const auto covered = [&](int row, int column) {
    return reference[static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
                     static_cast<std::size_t>(column)] > 0.0;
  };
  std::vector<char> band(reference.size(), 0);
  for (int row = 0; row < height; ++row) {
    for (int column = 0; column < width; ++column) {
      bool near = false;
      for (int r = std::max(0, row - radius); r <= std::min(height - 1, row + radius) && !near; ++r) {
        for (int c = std::max(0, column - radius); c <= std::min(width - 1, column + radius) && !near; ++c) {
          near = covered(r, c) != covered(row, column);
        }
      }
      band[static_cast<std::size_t>(row) * static_cast<std::size_t>(width) + static_cast<std::size_t>(column)] =
          near ? 1 : 0;
    }
  }
  return band;
}

/// @param degrees  of freedom; 0: unknown, many
double two_sided_p(double z, double degrees) {
  const double size = std::abs(z);
  if (!(degrees > 0.0)) return 2.0 * boost::math::cdf(boost::math::complement(boost::math::normal(), size));
  return 2.0 * boost::math::cdf(boost::math::complement(boost::math::students_t(degrees), size));
}

/// Mean of a pixel's own variance and that of its surroundings, which are `count` pixels with it among them.
struct PooledVariance {
  double variance = 0.0;
  int count = 0;

  /// Degrees of freedom over those of one pixel (Satterthwaite, equal variances): 1 / Σ weight².
  double more_degrees() const {
    const double other = 0.5 / count;
    const double own = 0.5 + other;
    return 1.0 / (own * own + (count - 1) * other * other);
  }
};

PooledVariance pooled_variance(const std::vector<double>& error, const std::vector<char>& use, std::size_t pixel,
                               int width, int height, int radius) {
  const int row = static_cast<int>(pixel) / width;
  const int column = static_cast<int>(pixel) % width;
  PooledVariance pooled;
  double sum = 0.0;
  for (int r = std::max(0, row - radius); r <= std::min(height - 1, row + radius); ++r) {
    for (int c = std::max(0, column - radius); c <= std::min(width - 1, column + radius); ++c) {
      const auto p = static_cast<std::size_t>(r) * static_cast<std::size_t>(width) + static_cast<std::size_t>(c);
      if (use[p] == 0) continue;
      sum += error[p] * error[p];
      ++pooled.count;
    }
  }
  pooled.variance = 0.5 * (error[pixel] * error[pixel] + sum / pooled.count);
  return pooled;
}

void hold_false_discoveries(PixelDiagnosis& diagnosis, const std::vector<std::size_t>& judged, double degrees,
                            double rate) {
  std::vector<std::pair<double, std::size_t>> p_values;
  p_values.reserve(judged.size());
  for (const std::size_t pixel : judged) p_values.emplace_back(two_sided_p(diagnosis.z[pixel], degrees), pixel);
  std::sort(p_values.begin(), p_values.end());
  std::size_t last = 0;
  for (std::size_t k = 0; k < p_values.size(); ++k) {
    if (p_values[k].first <= rate * static_cast<double>(k + 1) / static_cast<double>(p_values.size())) last = k + 1;
  }
  for (std::size_t k = 0; k < last; ++k) diagnosis.significant[p_values[k].second] = 1;
  diagnosis.significant_pixels = static_cast<int>(last);
}

}  // namespace

PixelDiagnosis diagnose(const Comparison& comparison, const DiagnosisParams& params) {
  if (params.silhouette_px < 0 || !(params.false_discovery_rate > 0.0) || !(params.false_discovery_rate < 1.0)) {
    throw InvalidParams(fmt::format(
        "pixel diagnosis: silhouette_px {} (expected 0 or more), false_discovery_rate {} (expected between 0 and 1).",
        params.silhouette_px, params.false_discovery_rate));
  }
  const image::SpectralImage& candidate = comparison.candidate;
  const std::vector<double>& reference = comparison.reference.integral_mean;
  const std::vector<double>& error = comparison.reference.integral_standard_error;
  const auto bands = static_cast<std::size_t>(candidate.bands());
  const std::size_t pixels = static_cast<std::size_t>(candidate.width) * static_cast<std::size_t>(candidate.height);
  if (reference.size() != pixels || error.size() != pixels) {
    throw InvalidInput(
        fmt::format("{}: the reference has {} pixels, the picture {}.", comparison.channel, reference.size(), pixels));
  }
  PixelDiagnosis diagnosis;
  diagnosis.z.assign(pixels, 0.0);
  diagnosis.significant.assign(pixels, 0);
  diagnosis.near_silhouette = silhouette_band(reference, candidate.width, candidate.height, params.silhouette_px);
  const auto integral = [&](const image::SpectralImage& image, std::size_t p) {
    double value = 0.0;
    for (std::size_t b = 0; b < bands; ++b)
      value += static_cast<double>(image.value[p * bands + b]) * comparison.band_width_nm[static_cast<Eigen::Index>(b)];
    return value;
  };
  const auto rounding = [&](std::size_t p) { return kStorageRounding * std::abs(reference[p]); };
  std::vector<std::size_t> judged;
  diagnosis.judged.assign(pixels, 0);
  for (std::size_t p = 0; p < pixels; ++p) {
    if (diagnosis.near_silhouette[p] != 0 || error[p] <= rounding(p)) continue;
    judged.push_back(p);
    diagnosis.judged[p] = 1;
  }
  const double batch_degrees = comparison.batches - 1.0;
  double chance_squares = 0.0;
  double more_degrees = 0.0;
  diagnosis.error = error;
  for (std::size_t p = 0; p < pixels; ++p) {
    const double value = integral(candidate, p);
    const double difference = value - reference[p];
    if (diagnosis.judged[p] != 0) {
      const PooledVariance pooled =
          pooled_variance(error, diagnosis.judged, p, candidate.width, candidate.height, params.noise_px);
      diagnosis.error[p] = std::sqrt(pooled.variance);
      more_degrees += pooled.more_degrees();
      const double degrees = batch_degrees * pooled.more_degrees();
      chance_squares += degrees > 2.0 ? degrees / (degrees - 2.0) : 1.0;
    } else if (diagnosis.near_silhouette[p] == 0 && std::abs(difference) > rounding(p)) {
      ++diagnosis.certain_differences;
    }
    if (comparison.coarser)
      diagnosis.error[p] = std::hypot(diagnosis.error[p], value - integral(*comparison.coarser, p));
    diagnosis.error[p] = std::max(diagnosis.error[p], rounding(p));
    if (diagnosis.error[p] > 0.0) diagnosis.z[p] = difference / diagnosis.error[p];
  }
  diagnosis.judged_pixels = static_cast<int>(judged.size());
  if (!judged.empty() && batch_degrees > 2.0)
    diagnosis.expected_z_rms = std::sqrt(chance_squares / static_cast<double>(judged.size()));
  double squares = 0.0;
  for (const std::size_t p : judged) squares += diagnosis.z[p] * diagnosis.z[p];
  if (!judged.empty()) diagnosis.z_rms = std::sqrt(squares / static_cast<double>(judged.size()));
  const double degrees =
      batch_degrees > 0.0 && !judged.empty() ? batch_degrees * more_degrees / static_cast<double>(judged.size()) : 0.0;
  hold_false_discoveries(diagnosis, judged, degrees, params.false_discovery_rate);

  double products = 0.0;
  double pairs = 0.0;
  const auto width = static_cast<std::size_t>(candidate.width);
  for (const std::size_t p : judged) {
    if ((p + 1) % width != 0 && diagnosis.judged[p + 1] != 0) {
      products += diagnosis.z[p] * diagnosis.z[p + 1];
      pairs += 1.0;
    }
    if (p + width < pixels && diagnosis.judged[p + width] != 0) {
      products += diagnosis.z[p] * diagnosis.z[p + width];
      pairs += 1.0;
    }
  }
  if (pairs > 0.0 && squares > 0.0) {
    diagnosis.autocorrelation = products / pairs / (squares / static_cast<double>(judged.size()));
    diagnosis.autocorrelation_z = diagnosis.autocorrelation * std::sqrt(pairs);
  }
  return diagnosis;
}

}  // namespace interglow::cross_check
