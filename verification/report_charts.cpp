// SPDX-License-Identifier: GPL-3.0-or-later
#include "verification/report_charts.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>

#include "image/preview.h"
#include "report/packing.h"
#include "spectral/spectral_metrics.h"

namespace interglow::verification {
namespace {

using cross_check::Comparison;
using image::SpectralImage;
using report::Json;

constexpr float kUndefined = std::numeric_limits<float>::quiet_NaN();

std::vector<int> shape_of(const SpectralImage& image) { return {image.height, image.width}; }

Json rgb_image(const std::string& name, const SpectralImage& image, double exposure) {
  const image::RgbImage preview = image::make_preview(image, {.exposure = exposure});
  return {{"name", name},
          {"kind", "rgb"},
          {"unit", "(linear sRGB)"},
          {"values", report::pack_half(preview.value, {image.height, image.width, 3})}};
}

Json map_image(const std::string& name, const std::string& unit, const SpectralImage& image, double low, double high,
               const std::function<double(std::size_t)>& value) {
  std::vector<float> values(static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height));
  for (std::size_t p = 0; p < values.size(); ++p) values[p] = static_cast<float>(value(p));
  return {{"name", name},
          {"kind", "map"},
          {"unit", unit},
          {"range", {low, high}},
          {"values", report::pack_half(values, shape_of(image))}};
}

/// z of the pixels that the diagnosis judges, sorted.
std::vector<double> judged_z(const CrossCheck& check) {
  std::vector<double> z;
  for (std::size_t p = 0; p < check.diagnosis.z.size(); ++p) {
    if (check.diagnosis.judged[p] != 0) z.push_back(check.diagnosis.z[p]);
  }
  std::sort(z.begin(), z.end());
  return z;
}

double chance_density(double z, int batches) {
  if (batches < 2) return boost::math::pdf(boost::math::normal(), z);
  return boost::math::pdf(boost::math::students_t(batches - 1.0), z);
}

double chance_quantile(double probability, int batches) {
  if (batches < 2) return boost::math::quantile(boost::math::normal(), probability);
  return boost::math::quantile(boost::math::students_t(batches - 1.0), probability);
}

}  // namespace

Json viewer_section(const CrossCheck& check) {
  const Comparison& total = check.comparisons.front();
  const SpectralImage& a = total.candidate;
  const SpectralImage& b = total.reference.mean;
  const double exposure = image::automatic_exposure(b);
  const auto bands = static_cast<std::size_t>(a.bands());
  std::vector<double> value(total.reference.integral_mean.size(), 0.0);
  for (std::size_t i = 0; i < a.value.size(); ++i)
    value[i / bands] += static_cast<double>(a.value[i]) * total.band_width_nm[static_cast<Eigen::Index>(i % bands)];
  const std::vector<double>& reference = total.reference.integral_mean;

  Json images =
      Json::array({rgb_image(check.candidate_name, a, exposure), rgb_image(check.reference_name, b, exposure)});
  const double brightest = reference.empty() ? 0.0 : *std::max_element(reference.begin(), reference.end());
  images.push_back(map_image(check.candidate_name + ", radiance", "W m⁻² sr⁻¹", a, 0.0, brightest,
                             [&](std::size_t p) { return value[p]; }));
  images.push_back(map_image(check.reference_name + ", radiance", "W m⁻² sr⁻¹", a, 0.0, brightest,
                             [&](std::size_t p) { return reference[p]; }));
  images.push_back(map_image("relative difference", "%", a, -5.0, 5.0, [&](std::size_t p) {
    return reference[p] > 0.0 ? 100.0 * (value[p] - reference[p]) / reference[p] : kUndefined;
  }));
  if (check.reference_has_error) {
    images.push_back(map_image("z", "standard errors", a, -4.0, 4.0, [&](std::size_t p) {
      return total.reference.integral_standard_error[p] > 0.0 ? check.diagnosis.z[p] : kUndefined;
    }));
    images.push_back(map_image("standard error", "%", a, 0.0, 5.0, [&](std::size_t p) {
      return reference[p] > 0.0 ? 100.0 * total.reference.integral_standard_error[p] / reference[p] : kUndefined;
    }));
  }
  if (bands > 1) {
    images.push_back(map_image("spectral angle", "°", a, 0.0, 2.0, [&](std::size_t p) {
      const auto spectrum = [&](const SpectralImage& image) -> Eigen::VectorXd {
        return Eigen::Map<const Eigen::VectorXf>(image.value.data() + p * bands, static_cast<Eigen::Index>(bands))
            .cast<double>();
      };
      const auto angle = spectral::spectral_angle(spectrum(a), spectrum(b));
      return angle ? *angle * 180.0 / std::numbers::pi : kUndefined;
    }));
  }
  Json reference_spectra = {{"name", check.reference_name}, {"mean", report::pack_spectra(b)}};
  if (check.reference_has_error) reference_spectra["error"] = report::pack_spectra(total.reference.standard_error);
  return {{"type", "viewer"},
          {"title", "Pictures"},
          {"text",
           "The whole radiance of both sides at one exposure, and maps of their difference, from the integral "
           "over the bands. The chart shows the spectra at the chosen pixel with two standard errors."},
          {"width", a.width},
          {"height", a.height},
          {"spectral_unit", "W m⁻² sr⁻¹ nm⁻¹"},
          {"images", images},
          {"spectra",
           Json::array({{{"name", check.candidate_name}, {"mean", report::pack_spectra(a)}}, reference_spectra})}};
}

Json z_histogram_section(const CrossCheck& check) {
  const std::vector<double> z = judged_z(check);
  constexpr int kBins = 49;
  constexpr double kReach = 6.125;  // bins of a quarter, one of them centred on 0
  constexpr double kWidth = 2.0 * kReach / kBins;
  std::vector<double> centre, found(kBins, 0.0), expected;
  for (int k = 0; k < kBins; ++k) {
    centre.push_back(-kReach + (k + 0.5) * kWidth);
    expected.push_back(static_cast<double>(z.size()) * kWidth *
                       chance_density(centre.back(), check.comparisons.front().batches));
  }
  for (const double value : z)
    found[static_cast<std::size_t>(std::clamp(static_cast<int>((value + kReach) / kWidth), 0, kBins - 1))] += 1.0;
  return {
      {"type", "chart"},
      {"title", "z of the pixels"},
      {"text", fmt::format("Difference over error of {} pixels away from silhouettes; the outermost bars hold all that "
                           "lies beyond. Root mean square {:.3f}, by chance {:.3f}. The error is the reference's "
                           "standard error, its variance averaged with that of the pixels around it{}.",
                           z.size(), check.diagnosis.z_rms, check.diagnosis.expected_z_rms,
                           check.comparisons.front().coarser
                               ? ", and the radiosity's change from larger patches, added in squares"
                               : "")},
      {"x", {{"label", "z [standard errors]"}}},
      {"y", {{"label", "pixels"}}},
      {"series", Json::array({{{"name", "found"}, {"bars", true}, {"x", centre}, {"y", found}},
                              {{"name", "by chance"}, {"x", centre}, {"y", expected}}})}};
}

Json z_quantile_section(const CrossCheck& check) {
  const std::vector<double> z = judged_z(check);
  std::vector<double> expected, found;
  const std::size_t points = std::min<std::size_t>(z.size(), 400);
  for (std::size_t k = 0; k < points; ++k) {
    // Denser towards the tails: the sine spreads the ranks.
    const double share =
        0.5 - 0.5 * std::cos(std::numbers::pi * (static_cast<double>(k) + 0.5) / static_cast<double>(points));
    const auto rank = std::min(z.size() - 1, static_cast<std::size_t>(share * static_cast<double>(z.size())));
    const double probability = (static_cast<double>(rank) + 0.5) / static_cast<double>(z.size());
    if (!expected.empty() && z[rank] == found.back()) continue;
    expected.push_back(chance_quantile(probability, check.comparisons.front().batches));
    found.push_back(z[rank]);
  }
  const double reach = expected.empty() ? 1.0 : std::max(std::abs(expected.front()), std::abs(expected.back()));
  return {{"type", "chart"},
          {"title", "Quantiles of z"},
          {"text",
           "On the straight line the differences are what chance gives; steeper: something beside chance; a shift: "
           "a common bias."},
          {"x", {{"label", "quantile by chance"}}},
          {"y", {{"label", "quantile found"}}},
          {"series", Json::array({{{"name", "found"}, {"points", true}, {"line", false}, {"x", expected}, {"y", found}},
                                  {{"name", "chance"}, {"x", {-reach, reach}}, {"y", {-reach, reach}}}})}};
}

Json autocorrelation_section(const CrossCheck& check) {
  const Comparison& total = check.comparisons.front();
  const int width = total.candidate.width;
  const int height = total.candidate.height;
  const auto index = [&](int row, int column) {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(width) + static_cast<std::size_t>(column);
  };
  const auto judged = [&](std::size_t p) { return check.diagnosis.judged[p] != 0; };
  const std::vector<double>& z = check.diagnosis.z;
  std::vector<double> distance, chance_high, chance_low;
  std::array<std::vector<double>, 2> correlation;
  const double mean_square = check.diagnosis.z_rms * check.diagnosis.z_rms;
  for (int lag = 1; lag <= 16; ++lag) {
    double fewest = std::numeric_limits<double>::infinity();
    for (const int along : {0, 1}) {
      double products = 0.0;
      double pairs = 0.0;
      for (int row = 0; row + along * lag < height; ++row) {
        for (int column = 0; column + (1 - along) * lag < width; ++column) {
          const std::size_t p = index(row, column);
          const std::size_t q = index(row + along * lag, column + (1 - along) * lag);
          if (!judged(p) || !judged(q)) continue;
          products += z[p] * z[q];
          pairs += 1.0;
        }
      }
      fewest = std::min(fewest, pairs);
      correlation[static_cast<std::size_t>(along)].push_back(
          pairs > 0.0 && mean_square > 0.0 ? products / pairs / mean_square : 0.0);
    }
    distance.push_back(lag);
    const double chance = fewest > 0.0 ? 2.0 / std::sqrt(fewest) : 0.0;
    chance_high.push_back(chance);
    chance_low.push_back(-chance);
  }
  return {
      {"type", "chart"},
      {"title", "Autocorrelation of z"},
      {"text", fmt::format("Neighbouring pixels of the path tracer share no random numbers: correlation means a common "
                           "difference below the noise of single pixels. With the next pixel: {:.4f}, {:.1f} of its "
                           "chance deviations.",
                           check.diagnosis.autocorrelation, check.diagnosis.autocorrelation_z)},
      {"x", {{"label", "distance [pixels]"}}},
      {"y", {{"label", "correlation"}}},
      {"series", Json::array({{{"name", "along rows"}, {"points", true}, {"x", distance}, {"y", correlation[0]}},
                              {{"name", "along columns"}, {"points", true}, {"x", distance}, {"y", correlation[1]}},
                              {{"name", "chance, +2 deviations"}, {"x", distance}, {"y", chance_high}},
                              {{"name", "chance, −2 deviations"}, {"x", distance}, {"y", chance_low}}})}};
}

Json error_against_time_section(const CrossCheck& check) {
  Json series = Json::array();
  std::string note;
  if (!check.noise.empty()) {
    std::vector<double> x, y;
    for (const NoisePoint& point : check.noise) {
      x.push_back(point.seconds);
      y.push_back(100.0 * point.relative_error);
    }
    series.push_back({{"name", "path tracer"}, {"points", true}, {"x", x}, {"y", y}});
  }
  const Comparison& total = check.comparisons.front();
  std::vector<double> x, y;
  for (const RadiosityRun* run : {check.coarser_run(), check.candidate_run()}) {
    if (run == nullptr) continue;
    const SpectralImage& picture = run == check.candidate_run() ? total.candidate : *total.coarser;
    const double error = rms_error(picture, total.reference, total.band_width_nm);
    if (error > 0.0) {
      x.push_back(run->seconds());
      y.push_back(100.0 * error);
      note += fmt::format(" Radiosity with {} patches: {:.3f} % after {:.2f} s.", run->patches, 100.0 * error,
                          run->seconds());
    } else {
      note +=
          fmt::format(" Radiosity with {} patches took {:.2f} s; its error is too small for the path tracer to see.",
                      run->patches, run->seconds());
    }
  }
  if (!x.empty()) series.push_back({{"name", "radiosity"}, {"points", true}, {"x", x}, {"y", y}});
  return {{"type", "chart"},
          {"title", "Error against time"},
          {"text",
           "Root mean square error of the pixels, relative to the mean radiance, against wall time on this machine. "
           "The path tracer's is its standard error; the radiosity's is its difference from the path tracer with "
           "the noise taken off." +
               note},
          {"x", {{"label", "time [s]"}, {"scale", "log"}}},
          {"y", {{"label", "error [%]"}, {"scale", "log"}}},
          {"series", series}};
}

}  // namespace interglow::verification
