// SPDX-License-Identifier: GPL-3.0-or-later
#include "verification/comparisons.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "verification/check_scene.h"

namespace interglow::verification {
namespace {

using cross_check::Channel;
using cross_check::Comparison;
using cross_check::Estimate;
using image::SpectralImage;

double integral(const SpectralImage& image, std::size_t pixel, const Eigen::VectorXd& width) {
  const auto bands = static_cast<std::size_t>(image.bands());
  double sum = 0.0;
  for (std::size_t b = 0; b < bands; ++b)
    sum += static_cast<double>(image.value[pixel * bands + b]) * width[static_cast<Eigen::Index>(b)];
  return sum;
}

/// A component that the scene cannot have is black.
SpectralImage or_black(const SpectralImage& image, const SpectralImage& like) {
  if (!image.value.empty()) return image;
  SpectralImage black = like;
  std::fill(black.value.begin(), black.value.end(), 0.0F);
  return black;
}

SpectralImage sum(SpectralImage a, const SpectralImage& b) {
  for (std::size_t i = 0; i < a.value.size(); ++i) a.value[i] += b.value[i];
  return a;
}

template <typename Value>
void add(std::vector<Value>& a, const std::vector<Value>& b) {
  for (std::size_t i = 0; i < a.size(); ++i) a[i] += b[i];
}

/// Estimate of the sum of two quantities of the same paths; the standard error is an upper bound (triangle inequality).
Estimate sum(Estimate a, const Estimate& b) {
  add(a.mean.value, b.mean.value);
  add(a.standard_error.value, b.standard_error.value);
  add(a.integral_mean, b.integral_mean);
  add(a.integral_standard_error, b.integral_standard_error);
  return a;
}

struct Component {
  const char* name;
  SpectralImage (*picture)(const rendering::RenderedImages&);
  Estimate (*estimate)(const cross_check::PathTracer&);
};

const Component kComponents[] = {
    {"re", [](const rendering::RenderedImages& i) { return or_black(i.re, i.total); },
     [](const cross_check::PathTracer& t) { return t.estimate(Channel::kRe); }},
    {"rr", [](const rendering::RenderedImages& i) { return or_black(i.rr, i.total); },
     [](const cross_check::PathTracer& t) { return t.estimate(Channel::kRr); }},
    {"le", [](const rendering::RenderedImages& i) { return or_black(i.le, i.total); },
     [](const cross_check::PathTracer& t) { return t.estimate(Channel::kLe); }},
    {"li", [](const rendering::RenderedImages& i) { return sum(or_black(i.lr, i.total), or_black(i.ll, i.total)); },
     [](const cross_check::PathTracer& t) { return sum(t.estimate(Channel::kLr), t.estimate(Channel::kLl)); }},
    {"rl", [](const rendering::RenderedImages& i) { return or_black(i.rl, i.total); },
     [](const cross_check::PathTracer& t) { return t.estimate(Channel::kRl); }},
};

double mean(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

}  // namespace

std::vector<Comparison> compare_channels(const rendering::RenderedImages& images,
                                         const rendering::RenderedImages* coarser,
                                         const cross_check::PathTracer& tracer, const scene::Scene& scene,
                                         const ComparisonParams& params) {
  const Eigen::VectorXd widths = camera_band_widths_nm(scene);
  const std::int64_t pixels = std::int64_t{scene.camera.width} * scene.camera.height;
  const auto comparison = [&](const char* name, SpectralImage candidate, Estimate reference) {
    Comparison one{
        .channel = name, .candidate = std::move(candidate), .reference = std::move(reference), .band_width_nm = widths};
    one.batches = tracer.batches();
    one.samples_per_pixel = tracer.paths() / pixels;
    return one;
  };
  std::vector<Comparison> comparisons;
  comparisons.push_back(comparison("total", images.total, tracer.estimate(Channel::kTotal)));
  comparisons.front().largest_possible_sample = tracer.largest_possible_sample();
  if (coarser != nullptr) comparisons.front().coarser = coarser->total;
  const double whole = mean(comparisons.front().reference.integral_mean);
  for (const Component& component : kComponents) {
    Comparison one = comparison(component.name, component.picture(images), component.estimate(tracer));
    if (mean(one.reference.integral_mean) == 0.0 && mean_radiance(one.candidate, widths) == 0.0) continue;
    if (coarser != nullptr) one.coarser = component.picture(*coarser);
    one.tiles_per_side = 1;
    one.judge_bands = false;
    one.least_reference = params.faint_component_share * whole;
    comparisons.push_back(std::move(one));
  }
  return comparisons;
}

double mean_radiance(const SpectralImage& image, const Eigen::VectorXd& band_width_nm) {
  const std::size_t pixels = static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height);
  double total = 0.0;
  for (std::size_t p = 0; p < pixels; ++p) total += integral(image, p, band_width_nm);
  return total / static_cast<double>(pixels);
}

double rms_error(const SpectralImage& candidate, const Estimate& reference, const Eigen::VectorXd& band_width_nm) {
  double squares = 0.0;
  for (std::size_t p = 0; p < reference.integral_mean.size(); ++p) {
    const double difference = integral(candidate, p, band_width_nm) - reference.integral_mean[p];
    squares += difference * difference - std::pow(reference.integral_standard_error[p], 2);
  }
  const auto pixels = static_cast<double>(reference.integral_mean.size());
  return std::sqrt(std::max(0.0, squares / pixels)) / mean(reference.integral_mean);
}

double rms_noise(const Estimate& estimate) {
  double squares = 0.0;
  for (const double error : estimate.integral_standard_error) squares += error * error;
  return std::sqrt(squares / static_cast<double>(estimate.integral_mean.size())) / mean(estimate.integral_mean);
}

}  // namespace interglow::verification
