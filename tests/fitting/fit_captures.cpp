// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit_captures.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "cross_check/path_tracer.h"
#include "fitting/forward_model.h"
#include "radiosity/direct_light.h"
#include "radiosity/solution.h"
#include "rendering/render.h"

namespace interglow::test {
namespace {

/// Adds what `other` holds; a component that the scene cannot have holds nothing.
void add(image::SpectralImage& image, const image::SpectralImage& other) {
  if (image.value.empty()) {
    image = other;
    return;
  }
  for (std::size_t i = 0; i < other.value.size(); ++i) image.value[i] += other.value[i];
}

/// What the sensor makes of the light whose direct part is `first`.
fitting::Capture sensed(const image::SpectralImage& total, const image::SpectralImage& first,
                        const CaptureOptions& options) {
  image::SpectralImage picture = total;
  const int bands = picture.bands();
  const auto pixels = static_cast<Eigen::Index>(picture.width) * picture.height;
  for (std::size_t i = 0; i < picture.value.size(); ++i) {
    const auto direct = static_cast<double>(first.value[i]);
    picture.value[i] = static_cast<float>(direct + options.w * (static_cast<double>(total.value[i]) - direct));
  }
  radiosity::RowMatrix values = Eigen::Map<const Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
                                    picture.value.data(), pixels, bands)
                                    .cast<double>();
  values = fitting::blurred(values, picture.width, picture.height, options.blur_px);
  values = ((1.0 - options.veil_share) * values).rowwise() + options.veil_share * values.colwise().mean();

  fitting::Capture capture;
  capture.image = picture;
  capture.use.assign(static_cast<std::size_t>(pixels), 1);
  capture.value_per_count.assign(static_cast<std::size_t>(bands), 1.0F);
  if (options.noise > 0.0) capture.noise = {1.5 * options.noise, 0.25 * options.noise * options.noise, 1.0, 0.0};
  std::mt19937_64 random(options.seed);
  std::normal_distribution<double> normal;
  const double scale = options.scale.value_or(options.full_scale / values.maxCoeff());
  for (Eigen::Index p = 0; p < pixels; ++p) {
    for (int b = 0; b < bands; ++b) {
      const double gain = 1.0 + (b % 2 == 0 ? options.gain_spread : -options.gain_spread);
      double counts = scale * gain * values(p, b) + options.offset_share * options.full_scale;
      const double sigma =
          std::sqrt(std::pow(1.5 * options.noise, 2) + 0.25 * options.noise * options.noise * std::max(counts, 0.0));
      counts += sigma * normal(random);
      if (options.noise > 0.0) counts = std::round(counts);
      capture.image.value[static_cast<std::size_t>(p * bands + b)] = static_cast<float>(counts);
    }
  }
  return capture;
}

}  // namespace

fitting::Capture simulated_capture(const scene::Scene& scene, const CaptureOptions& options) {
  const radiosity::Elements elements = radiosity::make_elements(scene);
  const auto transport = radiosity::Transport::build(elements, {});
  const auto direct =
      radiosity::total(radiosity::direct_light(scene, elements, transport), elements.size(), scene.grid.size());
  const auto solution =
      radiosity::solve(transport, scene.materials, elements.material, direct, {.bounces = options.bounces});
  const rendering::RenderedImages images =
      rendering::render(scene, elements, solution, {.samples_per_side = 8, .gather_tolerance = 3e-4});
  image::SpectralImage first = images.re;
  add(first, images.le);
  return sensed(images.total, first, options);
}

fitting::Capture traced_capture(const scene::Scene& scene, int paths, const CaptureOptions& options) {
  // Two batches, as estimates need: large ones are stratified best.
  cross_check::PathTracer tracer(
      scene, {.bounces = options.bounces, .samples_per_batch = paths / 2, .seed = 1000003ULL * options.seed});
  tracer.add_batches(2);
  image::SpectralImage first = tracer.estimate(cross_check::Channel::kRe).mean;
  add(first, tracer.estimate(cross_check::Channel::kLe).mean);
  return sensed(tracer.estimate(cross_check::Channel::kTotal).mean, first, options);
}

}  // namespace interglow::test
