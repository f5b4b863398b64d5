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

double two_sided_p(double z, int batches) {
  const double size = std::abs(z);
  if (batches < 2) return 2.0 * boost::math::cdf(boost::math::complement(boost::math::normal(), size));
  return 2.0 * boost::math::cdf(boost::math::complement(boost::math::students_t(batches - 1), size));
}

void hold_false_discoveries(PixelDiagnosis& diagnosis, const std::vector<std::size_t>& judged, int batches,
                            double rate) {
  std::vector<std::pair<double, std::size_t>> p_values;
  p_values.reserve(judged.size());
  for (const std::size_t pixel : judged) p_values.emplace_back(two_sided_p(diagnosis.z[pixel], batches), pixel);
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
  std::vector<std::size_t> judged;
  for (std::size_t p = 0; p < pixels; ++p) {
    double value = 0.0;
    for (std::size_t b = 0; b < bands; ++b) {
      value +=
          static_cast<double>(candidate.value[p * bands + b]) * comparison.band_width_nm[static_cast<Eigen::Index>(b)];
    }
    const double difference = value - reference[p];
    const double rounding = kStorageRounding * std::abs(reference[p]);
    const double least_error = std::max(error[p], rounding);
    if (least_error > 0.0) diagnosis.z[p] = difference / least_error;
    if (diagnosis.near_silhouette[p] != 0) continue;
    if (error[p] > rounding) {
      judged.push_back(p);
    } else if (std::abs(difference) > rounding) {
      ++diagnosis.certain_differences;
    }
  }
  diagnosis.judged_pixels = static_cast<int>(judged.size());
  const double degrees = comparison.batches - 1.0;
  if (degrees > 2.0) diagnosis.expected_z_rms = std::sqrt(degrees / (degrees - 2.0));
  double squares = 0.0;
  for (const std::size_t p : judged) squares += diagnosis.z[p] * diagnosis.z[p];
  if (!judged.empty()) diagnosis.z_rms = std::sqrt(squares / static_cast<double>(judged.size()));
  hold_false_discoveries(diagnosis, judged, comparison.batches, params.false_discovery_rate);

  std::vector<char> is_judged(pixels, 0);
  for (const std::size_t p : judged) is_judged[p] = 1;
  double products = 0.0;
  double pairs = 0.0;
  const auto width = static_cast<std::size_t>(candidate.width);
  for (const std::size_t p : judged) {
    if ((p + 1) % width != 0 && is_judged[p + 1] != 0) {
      products += diagnosis.z[p] * diagnosis.z[p + 1];
      pairs += 1.0;
    }
    if (p + width < pixels && is_judged[p + width] != 0) {
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
