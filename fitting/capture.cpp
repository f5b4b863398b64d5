// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/capture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

namespace interglow::fitting {
namespace {

constexpr double kLargestWhiteReflectance =
    1.2;  // of a radiance factor; packed powders reach 1.01, gloss a little more

void require(bool holds, const char* field, double value, const char* expected) {
  if (!holds) throw InvalidParams(fmt::format("{} = {}; expected {}.", field, value, expected));
}

/// Frames must be of one geometry: nothing is resampled silently.
void require_same_grid(const image::SpectralImage& frame, const std::string& name, const image::SpectralImage& object) {
  if (frame.width != object.width || frame.height != object.height) {
    throw InvalidInput(
        fmt::format("{}: {} × {} pixels, the object frame has {} × {}. Use frames of one camera setting, not cropped.",
                    name, frame.width, frame.height, object.width, object.height));
  }
  if (frame.bands() != object.bands())
    throw InvalidInput(fmt::format("{}: {} bands, the object frame has {}.", name, frame.bands(), object.bands()));
  for (int b = 0; b < object.bands(); ++b) {
    // Wavelength lists are rarely written with more than two decimals.
    if (std::abs(frame.wavelength_nm[b] - object.wavelength_nm[b]) > 0.01) {
      throw InvalidInput(fmt::format("{}: band {} is {} nm, in the object frame {} nm.", name, b + 1,
                                     frame.wavelength_nm[b], object.wavelength_nm[b]));
    }
  }
}

void require_whole_image(const image::SpectralImage& image) {
  const auto values = static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height) *
                      static_cast<std::size_t>(image.bands());
  if (image.width < 1 || image.height < 1 || image.bands() < 1 || image.value.size() != values) {
    throw InvalidParams(
        fmt::format("object frame: {} values for {} × {} pixels of {} bands; expected one a band and "
                    "pixel, at least one.",
                    image.value.size(), image.width, image.height, image.bands()));
  }
}

/// Mean of the frames; empty without frames.
std::vector<double> mean_of(const std::vector<image::SpectralImage>& frames) {
  std::vector<double> mean;
  for (const image::SpectralImage& frame : frames) {
    mean.resize(frame.value.size(), 0.0);
    for (std::size_t v = 0; v < mean.size(); ++v) mean[v] += frame.value[v];
  }
  for (double& value : mean) value /= static_cast<double>(frames.size());
  return mean;
}

/// Counts beyond the converter's range mean that bits, or the file, say something untrue.
void require_within_bits(const image::SpectralImage& frame, const std::string& name, int bits) {
  const double largest = std::ldexp(1.0, bits) - 1.0;
  for (std::size_t v = 0; v < frame.value.size(); ++v) {
    if (!(frame.value[v] > largest)) continue;
    const auto bands = static_cast<std::size_t>(frame.bands());
    const std::size_t pixel = v / bands;
    throw InvalidInput(
        fmt::format("{}: row {}, column {}, band {}: {} counts, beyond the {} that {} bits hold. Declare the camera's "
                    "bit depth, or undo the scaling of the file.",
                    name, pixel / static_cast<std::size_t>(frame.width), pixel % static_cast<std::size_t>(frame.width),
                    v % bands + 1, frame.value[v], largest, bits));
  }
}

/// Marks all pixels within `margin` columns and rows of a marked one.
std::vector<std::uint8_t> grown(const std::vector<std::uint8_t>& marked, int width, int height, int margin) {
  if (margin == 0) return marked;
  std::vector<std::uint8_t> rows(marked.size(), 0), all(marked.size(), 0);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      if (marked[static_cast<std::size_t>(y) * width + x] == 0) continue;
      for (int i = std::max(0, x - margin); i <= std::min(width - 1, x + margin); ++i)
        rows[static_cast<std::size_t>(y) * width + i] = 1;
    }
  }
  for (int y = 0; y < height; ++y) {
    for (int i = std::max(0, y - margin); i <= std::min(height - 1, y + margin); ++i) {
      for (int x = 0; x < width; ++x) {
        if (rows[static_cast<std::size_t>(y) * width + x] != 0) all[static_cast<std::size_t>(i) * width + x] = 1;
      }
    }
  }
  return all;
}

/// Median of each band's white signal: what a pixel of the target counts.
std::vector<double> median_white(const std::vector<double>& signal, std::size_t bands) {
  std::vector<double> median(bands);
  std::vector<double> band(signal.size() / bands);
  for (std::size_t b = 0; b < bands; ++b) {
    for (std::size_t p = 0; p < band.size(); ++p) band[p] = signal[p * bands + b];
    const auto middle = band.begin() + static_cast<std::ptrdiff_t>(band.size() / 2);
    std::nth_element(band.begin(), middle, band.end());
    median[b] = *middle;
  }
  return median;
}

/// Sums over all values of the frames: mean, and variance of repetitions.
struct Repetitions {
  double mean = 0.0;
  double variance = 0.0;
};

Repetitions repetitions_of(const std::vector<image::SpectralImage>& frames) {
  Repetitions sums;
  double values = 0.0;
  for (std::size_t v = 0; v < frames.front().value.size(); ++v) {
    double mean = 0.0, squares = 0.0;
    for (const image::SpectralImage& frame : frames) mean += frame.value[v];
    mean /= static_cast<double>(frames.size());
    if (!std::isfinite(mean)) continue;
    for (const image::SpectralImage& frame : frames) squares += (frame.value[v] - mean) * (frame.value[v] - mean);
    sums.mean += mean;
    sums.variance += squares / static_cast<double>(frames.size() - 1);
    values += 1.0;
  }
  return values > 0.0 ? Repetitions{sums.mean / values, sums.variance / values} : Repetitions{};
}

}  // namespace

SensorNoise estimate_noise(const CaptureFrames& frames, double quantisation_step) {
  for (const auto& frame : frames.dark) require_same_grid(frame, "dark frame", frames.dark.front());
  for (const auto& frame : frames.white) require_same_grid(frame, "white frame", frames.dark.front());
  const Repetitions dark = repetitions_of(frames.dark);
  const Repetitions white = repetitions_of(frames.white);
  if (!(white.mean > dark.mean)) {
    throw InvalidInput(
        fmt::format("The white frames have a mean of {:.4g} counts, the dark ones {:.4g}; expected more light in the "
                    "white ones. Are they swapped?",
                    white.mean, dark.mean));
  }
  const double rounding = quantisation_step * quantisation_step / 12.0;
  return {.read_sigma = std::sqrt(std::max(dark.variance - rounding, 0.0)),
          .shot_gain = std::max(white.variance - dark.variance, 0.0) / (white.mean - dark.mean),
          .quantisation_step = quantisation_step};
}

double SensorNoise::variance(double signal) const {
  const double response = relative_sigma * signal;
  return read_sigma * read_sigma + shot_gain * std::max(signal, 0.0) + quantisation_step * quantisation_step / 12.0 +
         response * response;
}

void validate(const CaptureParams& params, int bands) {
  const auto at_least_0 = [](const char* field, double value) {
    require(value >= 0.0 && std::isfinite(value), field, value, "a finite number, at least 0");
  };
  at_least_0("noise.read_sigma", params.noise.read_sigma);
  at_least_0("noise.shot_gain", params.noise.shot_gain);
  at_least_0("noise.quantisation_step", params.noise.quantisation_step);
  at_least_0("noise.relative_sigma", params.noise.relative_sigma);
  if (params.bits) require(*params.bits >= 1 && *params.bits <= 32, "bits", *params.bits, "1 to 32");
  if (params.saturation) {
    require(std::isfinite(*params.saturation) && *params.saturation > params.dark_level, "saturation",
            *params.saturation, "more counts than the dark level");
    if (params.bits)
      require(*params.saturation <= std::ldexp(1.0, *params.bits) - 1.0, "saturation", *params.saturation,
              "no more than 2^bits - 1");
  }
  require(std::isfinite(params.dark_level), "dark_level", params.dark_level, "a finite number");
  if (params.exposure.size() != 0 && params.exposure.size() != bands) {
    throw InvalidParams(fmt::format("exposure: {} values, the image has {} bands; expected one a band.",
                                    params.exposure.size(), bands));
  }
  for (const double value : params.exposure)
    require(value > 0.0 && std::isfinite(value), "exposure", value, "positive numbers");
  if (params.white_reflectance.size() != 1 && params.white_reflectance.size() != bands) {
    throw InvalidParams(fmt::format("white_reflectance: {} values, the image has {} bands; expected 1 or one a band.",
                                    params.white_reflectance.size(), bands));
  }
  for (const double value : params.white_reflectance)
    require(value > 0.0 && value <= kLargestWhiteReflectance, "white_reflectance", value, "above 0, at most 1.2");
  require(params.saturation_margin_px >= 0 && params.saturation_margin_px <= 100, "saturation_margin_px",
          params.saturation_margin_px, "0 to 100");
  require(params.least_white >= 0.0 && params.least_white < 1.0, "least_white", params.least_white,
          "at least 0, below 1");
}

double Capture::variance(std::size_t pixel, int band, double value) const {
  const auto bands = static_cast<std::size_t>(image.bands());
  const auto b = static_cast<std::size_t>(band);
  const double scale = has_white() ? value_per_count[pixel * bands + b] : value_per_count[b];
  if (scale == 0.0) return 0.0;
  const double dark_variance = dark_frames > 0 ? noise.variance(0.0) / dark_frames : 0.0;
  double variance = scale * scale * (noise.variance(value / scale) + dark_variance);
  if (has_white()) {
    const double white = white_reflectance[band] / scale;
    variance += value * value * (noise.variance(white) / white_frames + dark_variance) / (white * white);
  }
  return variance;
}

double Capture::variance(std::size_t pixel, int band) const {
  return variance(pixel, band, image.value[pixel * static_cast<std::size_t>(image.bands()) + band]);
}

Capture correct_capture(const CaptureFrames& frames, const CaptureParams& params) {
  const image::SpectralImage& object = frames.object;
  require_whole_image(object);
  validate(params, object.bands());
  const auto named = [](const char* what, std::size_t i, std::size_t count) {
    return count > 1 ? fmt::format("{} frame {}", what, i + 1) : fmt::format("{} frame", what);
  };
  for (std::size_t i = 0; i < frames.dark.size(); ++i)
    require_same_grid(frames.dark[i], named("dark", i, frames.dark.size()), object);
  for (std::size_t i = 0; i < frames.white.size(); ++i)
    require_same_grid(frames.white[i], named("white", i, frames.white.size()), object);
  const auto width = static_cast<std::size_t>(object.width);
  const std::size_t pixels = width * static_cast<std::size_t>(object.height);
  const auto bands = static_cast<std::size_t>(object.bands());
  if (!frames.mask.empty() && frames.mask.size() != pixels) {
    throw InvalidInput(
        fmt::format("mask: {} pixels, the object frame has {} × {}.", frames.mask.size(), object.width, object.height));
  }
  if (params.bits) {
    require_within_bits(object, "object frame", *params.bits);
    for (const auto& frame : frames.dark) require_within_bits(frame, "dark frame", *params.bits);
    for (const auto& frame : frames.white) require_within_bits(frame, "white frame", *params.bits);
  }

  Capture capture;
  capture.image = {object.width, object.height, object.wavelength_nm, std::vector<float>(object.value.size(), 0.0F)};
  capture.use.assign(pixels, 1);
  capture.noise = params.noise;
  capture.dark_frames = static_cast<int>(frames.dark.size());
  capture.white_frames = static_cast<int>(frames.white.size());
  capture.bits = params.bits.value_or(0);
  capture.saturation = params.saturation;
  if (!capture.saturation && params.bits) capture.saturation = std::ldexp(1.0, *params.bits) - 2.0;

  const std::vector<double> dark = mean_of(frames.dark);
  const auto dark_at = [&](std::size_t v) { return dark.empty() ? params.dark_level : dark[v]; };
  std::vector<double> white = mean_of(frames.white);
  std::vector<double> white_median;
  if (!white.empty()) {
    for (std::size_t v = 0; v < white.size(); ++v) white[v] -= dark_at(v);
    white_median = median_white(white, bands);
    capture.white_reflectance = params.white_reflectance.size() == 1
                                    ? Eigen::VectorXd::Constant(object.bands(), params.white_reflectance[0])
                                    : params.white_reflectance;
    for (std::size_t b = 0; b < bands; ++b) {
      if (white_median[b] > 0.0) continue;
      throw InvalidInput(fmt::format(
          "white frame: band {} ({} nm): the median is {:.4g} counts above the dark; expected a lit white target. "
          "Are dark and white frames swapped?",
          b + 1, object.wavelength_nm[static_cast<Eigen::Index>(b)], white_median[b]));
    }
    capture.value_per_count.assign(object.value.size(), 0.0F);
  } else {
    for (std::size_t b = 0; b < bands; ++b) {
      const auto band = static_cast<Eigen::Index>(b);
      capture.value_per_count.push_back(
          static_cast<float>(params.exposure.size() == 0 ? 1.0 : 1.0 / params.exposure[band]));
    }
  }

  std::vector<std::uint8_t> saturated(pixels, 0), invalid(pixels, 0);
  const double limit = capture.saturation.value_or(INFINITY);
  for (std::size_t p = 0; p < pixels; ++p) {
    for (std::size_t b = 0; b < bands; ++b) {
      const std::size_t v = p * bands + b;
      const double raw = object.value[v];
      if (raw > limit) saturated[p] = 1;
      for (const image::SpectralImage& frame : frames.white) {
        if (frame.value[v] > limit) saturated[p] = 1;
      }
      const double signal = raw - dark_at(v);
      if (!white.empty() && std::isfinite(white[v]) && white[v] > params.least_white * white_median[b])
        capture.value_per_count[v] =
            static_cast<float>(capture.white_reflectance[static_cast<Eigen::Index>(b)] / white[v]);
      const double scale = white.empty() ? capture.value_per_count[b] : capture.value_per_count[v];
      if (!std::isfinite(signal) || scale == 0.0) {
        invalid[p] = 1;
      } else {
        capture.image.value[v] = static_cast<float>(signal * scale);
      }
    }
  }
  saturated = grown(saturated, object.width, object.height, params.saturation_margin_px);
  for (std::size_t p = 0; p < pixels; ++p) {
    if (!frames.mask.empty() && frames.mask[p] == 0) {
      ++capture.masked;
    } else if (invalid[p] != 0) {
      ++capture.invalid;
    } else if (saturated[p] != 0) {
      ++capture.saturated;
    } else {
      ++capture.used;
      continue;
    }
    capture.use[p] = 0;
  }
  if (capture.used == 0) {
    throw InvalidInput(
        fmt::format("No pixel is left of {} × {}: {} outside the mask, {} saturated (beyond {} counts) or beside such, "
                    "{} not finite or without white. Expose less, or correct mask, saturation or white frame.",
                    object.width, object.height, capture.masked, capture.saturated, limit, capture.invalid));
  }
  const std::size_t inside = pixels - capture.masked;
  if (capture.saturated * 100 > inside) {
    capture.warnings.push_back(
        fmt::format("{:.1f} % of the pixels are saturated or beside such and take no part; expose less.",
                    100.0 * static_cast<double>(capture.saturated) / static_cast<double>(inside)));
  }
  if (frames.dark.empty() && params.dark_level == 0.0)
    capture.warnings.push_back(
        "No dark frame and no dark level: an offset of 0.5 % of the peak moves w/w′ by 6 to 11 %.");
  if (!params.noise.known()) capture.warnings.push_back("The noise is not known: residuals cannot be whitened.");
  return capture;
}

}  // namespace interglow::fitting
