// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/simulated_sensor.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "fitting/spline_image.h"

namespace interglow::fitting {
namespace {

/// Normal and Poisson numbers; the standard library's distributions differ between its makers.
class Noise {
 public:
  /// One sequence for each line of each frame, so that lines can be made in any order.
  Noise(std::uint64_t seed, std::uint64_t frame, std::uint64_t row = 0)
      : bits_(seed * 0x9e3779b97f4a7c15ULL + (frame << 32U) + row) {}

  double uniform() { return (static_cast<double>(bits_() >> 11) + 0.5) * 0x1.0p-53; }  // in (0, 1)
  double normal() {
    if (has_spare_) {
      has_spare_ = false;
      return spare_;
    }
    const double radius = std::sqrt(-2.0 * std::log(uniform()));
    const double angle = 2.0 * std::numbers::pi * uniform();
    spare_ = radius * std::sin(angle);
    has_spare_ = true;
    return radius * std::cos(angle);
  }
  /// Exact below a mean of 60; above, where skewness is below 0.13, the rounded normal of the same mean and variance.
  double poisson(double mean) {
    if (mean >= 60.0) return std::round(mean + std::sqrt(mean) * normal());
    const double end = std::exp(-mean);
    double product = uniform(), count = 0.0;
    for (; product > end; product *= uniform()) count += 1.0;
    return count;
  }

 private:
  std::mt19937_64 bits_;
  double spare_ = 0.0;
  bool has_spare_ = false;
};

void require(bool holds, const char* field, double value, const char* expected) {
  if (!holds) throw InvalidParams(fmt::format("{} = {}; expected {}.", field, value, expected));
}

image::ScalarMap band_of(const image::SpectralImage& image, int band) {
  image::ScalarMap map{image.width, image.height, {}};
  const auto bands = static_cast<std::size_t>(image.bands());
  for (std::size_t v = static_cast<std::size_t>(band); v < image.value.size(); v += bands)
    map.value.push_back(image.value[v]);
  return map;
}

/// The value at |x| reflected about 0 and `last`, as often as needed.
double mirrored(double x, double last) {
  const double turn = std::fmod(std::abs(x), 2.0 * last);
  return turn > last ? 2.0 * last - turn : turn;
}

bool is_identity(const Affine& map) { return map.linear.isIdentity(0.0) && map.shift.isZero(0.0); }

/// Blur, resampling, glare: what falls on the sensor, in the unit of the radiance.
std::vector<double> optical_image(const image::ScalarMap& ideal, const SensorParams& params) {
  const image::ScalarMap blurred = gaussian_blur(ideal, params.blur_px);
  std::vector<double> light(blurred.value.begin(), blurred.value.end());
  if (!is_identity(params.ideal_from_sensor)) {
    const SplineImage spline(blurred, 5);
    for (int y = 0; y < ideal.height; ++y) {
      for (int x = 0; x < ideal.width; ++x) {
        const Eigen::Vector2d at = params.ideal_from_sensor(Eigen::Vector2d(x, y));
        const double value = spline.sample(mirrored(at.x(), ideal.width - 1), mirrored(at.y(), ideal.height - 1)).value;
        // Splines ring at edges that the blur left sharp; light does not.
        light[static_cast<std::size_t>(y) * static_cast<std::size_t>(ideal.width) + static_cast<std::size_t>(x)] =
            std::max(value, 0.0);
      }
    }
  }
  double mean = 0.0;
  for (const double value : light) mean += value;
  mean /= static_cast<double>(light.size());
  for (double& value : light) value = (1.0 - params.glare) * value + params.glare * mean;
  return light;
}

/// The value that `share` of the numbers do not exceed.
double percentile(std::vector<double> values, double share) {
  const auto place = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + place, values.end());
  return values[static_cast<std::size_t>(place)];
}

}  // namespace

void validate(const SensorParams& params) {
  require(params.bits >= 2 && params.bits <= 16, "bits", params.bits, "2 to 16");
  const double full_scale = std::ldexp(1.0, params.bits) - 1.0;
  const auto finite = [](double value) { return std::isfinite(value); };
  require(finite(params.full_well_electrons) && params.full_well_electrons > 0.0, "full_well_electrons",
          params.full_well_electrons, "a number above 0");
  require(finite(params.read_electrons) && params.read_electrons >= 0.0, "read_electrons", params.read_electrons,
          "a number, at least 0");
  require(params.black_counts >= 0.0 && params.black_counts < full_scale, "black_counts", params.black_counts,
          "at least 0, below full scale");
  require(finite(params.peak) && params.peak > 0.0, "peak", params.peak, "a number above 0");
  require(params.gain_spread >= 0.0 && params.gain_spread < 1.0, "gain_spread", params.gain_spread,
          "at least 0, below 1");
  require(params.blur_px >= 0.0 && params.blur_px <= 50.0, "blur_px", params.blur_px, "0 to 50");
  require(params.glare >= 0.0 && params.glare < 1.0, "glare", params.glare, "at least 0, below 1");
  require(finite(params.stray) && params.stray >= 0.0, "stray", params.stray, "a number, at least 0");
  require(finite(params.response_sigma) && params.response_sigma >= 0.0, "response_sigma", params.response_sigma,
          "a number, at least 0");
  const Affine& map = params.ideal_from_sensor;
  if (!map.linear.allFinite() || !map.shift.allFinite())
    throw InvalidParams("ideal_from_sensor: not finite; expected finite shift, turn and scale.");
  require(std::abs(map.linear.determinant()) > 1e-6, "ideal_from_sensor: determinant", map.linear.determinant(),
          "a map that can be inverted");
  require(params.dark_frames >= 0 && params.dark_frames <= 1000, "dark_frames", params.dark_frames, "0 to 1000");
  require(params.white_frames >= 0 && params.white_frames <= 1000, "white_frames", params.white_frames, "0 to 1000");
}

SensorOutput simulate_sensor(const image::SpectralImage& radiance, const SensorParams& params,
                             const Eigen::VectorXd& white_radiance) {
  validate(params);
  const auto bands = static_cast<std::size_t>(radiance.bands());
  const std::size_t pixels = static_cast<std::size_t>(radiance.width) * static_cast<std::size_t>(radiance.height);
  if (radiance.width < 4 || radiance.height < 4 || bands == 0 || radiance.value.size() != pixels * bands) {
    throw InvalidParams(fmt::format("radiance: {} values for {} × {} pixels of {} bands; expected at least 4 × 4.",
                                    radiance.value.size(), radiance.width, radiance.height, bands));
  }
  if (params.white_frames > 0 && white_radiance.size() != radiance.bands()) {
    throw InvalidParams(fmt::format("white_radiance: {} values for {} bands; white frames need one a band.",
                                    white_radiance.size(), bands));
  }
  if (!std::all_of(radiance.value.begin(), radiance.value.end(), [](float value) { return std::isfinite(value); }))
    throw InvalidInput("The radiance to be captured is not finite.");

  std::vector<std::vector<double>> light(bands);
  SensorOutput output;
  const auto count = static_cast<Eigen::Index>(bands);
  output.band_gain = Eigen::VectorXd::Ones(count);
  output.exposure = Eigen::VectorXd::Ones(count);
  output.offset_counts = Eigen::VectorXd::Zero(count);
  Noise drawn(params.seed, 0);
  for (double& gain : output.band_gain) gain = 1.0 + params.gain_spread * (2.0 * drawn.uniform() - 1.0);
  Eigen::VectorXd brightest(count);
  tbb::parallel_for(Eigen::Index{0}, count, [&](Eigen::Index band) {
    std::vector<double>& here = light[static_cast<std::size_t>(band)];
    const image::ScalarMap ideal = band_of(radiance, static_cast<int>(band));
    double mean = 0.0;
    for (const float value : ideal.value) mean += value;
    mean /= static_cast<double>(pixels);
    here = optical_image(ideal, params);
    const double stray = params.stray * percentile(here, 0.999);
    for (double& value : here) value += stray;
    brightest[band] = percentile(here, 0.999);
    if (params.white_frames > 0) brightest[band] = std::max(brightest[band], white_radiance[band]);
    brightest[band] *= output.band_gain[band];
    output.offset_counts[band] = params.glare * mean + stray;
  });
  const double most = brightest.maxCoeff();
  if (!(most > 0.0)) throw InvalidInput("The radiance to be captured is 0 everywhere. Is the scene lit?");

  const double full_scale = std::ldexp(1.0, params.bits) - 1.0;
  const double range = params.peak * (full_scale - params.black_counts);
  if (params.expose_bands) {
    for (Eigen::Index b = 0; b < count; ++b) output.exposure[b] = brightest[b] > 0.0 ? most / brightest[b] : 1.0;
    output.exposure /= output.exposure.maxCoeff();
  }
  const double scale = range / (brightest.array() * output.exposure.array()).maxCoeff();
  output.counts_per_radiance = scale * output.band_gain.cwiseProduct(output.exposure);
  output.offset_counts = output.offset_counts.cwiseProduct(output.counts_per_radiance).eval();
  const double electrons_per_count = params.full_well_electrons / full_scale;
  output.noise = {.read_sigma = params.read_electrons / electrons_per_count,
                  .shot_gain = 1.0 / electrons_per_count,
                  .quantisation_step = 1.0,
                  .relative_sigma = params.response_sigma};

  std::vector<double> response(pixels, 1.0);
  if (params.response_sigma > 0.0) {
    Noise pattern(params.seed, 1);
    for (double& value : response) value = std::max(1.0 + params.response_sigma * pattern.normal(), 0.0);
  }
  // signal: radiance in a pixel and band; each frame has random numbers of its own
  const auto record = [&](std::uint64_t frame, const auto& signal) {
    const auto width = static_cast<std::size_t>(radiance.width);
    image::SpectralImage raw{radiance.width, radiance.height, radiance.wavelength_nm,
                             std::vector<float>(radiance.value.size())};
    tbb::parallel_for(std::size_t{0}, static_cast<std::size_t>(radiance.height), [&](std::size_t row) {
      Noise noise(params.seed, frame, row);
      for (std::size_t p = row * width; p < (row + 1) * width; ++p) {
        for (std::size_t b = 0; b < bands; ++b) {
          const double counts = signal(p, b) * output.counts_per_radiance[static_cast<Eigen::Index>(b)];
          double electrons = noise.poisson(std::max(counts, 0.0) * electrons_per_count * response[p]);
          electrons += params.read_electrons * noise.normal();
          const double value = std::round(electrons / electrons_per_count + params.black_counts);
          raw.value[p * bands + b] = static_cast<float>(std::clamp(value, 0.0, full_scale));
        }
      }
    });
    return raw;
  };
  std::uint64_t frame = 2;
  output.frames.object = record(frame++, [&](std::size_t p, std::size_t b) { return light[b][p]; });
  for (int i = 0; i < params.dark_frames; ++i)
    output.frames.dark.push_back(record(frame++, [](std::size_t, std::size_t) { return 0.0; }));
  for (int i = 0; i < params.white_frames; ++i) {
    output.frames.white.push_back(
        record(frame++, [&](std::size_t, std::size_t b) { return white_radiance[static_cast<Eigen::Index>(b)]; }));
  }
  std::size_t saturated = 0;
  for (std::size_t p = 0; p < pixels; ++p) {
    const auto first = output.frames.object.value.begin() + static_cast<std::ptrdiff_t>(p * bands);
    if (std::any_of(first, first + static_cast<std::ptrdiff_t>(bands),
                    [&](float value) { return value >= full_scale; }))
      ++saturated;
  }
  output.saturated_share = static_cast<double>(saturated) / static_cast<double>(pixels);
  return output;
}

}  // namespace interglow::fitting
