// SPDX-License-Identifier: GPL-3.0-or-later
/// An unbiased spectral path tracer for diffuse and bispectral surfaces: the independent method. It shares the scene's
/// description with the radiosity solver and none of its computation.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "diagnostics/progress.h"
#include "image/spectral_image.h"
#include "scene/scene.h"

namespace interglow::cross_check {

/// The components of the solver and their sum, in this order everywhere.
enum class Channel { kTotal, kRe, kRr, kLe, kLr, kLl, kRl, kEmission };
constexpr int kChannels = 8;
const char* name(Channel channel);

struct TraceParams {
  /// Number of indirect bounces; empty: all (Russian roulette). 0 is direct light only.
  std::optional<int> bounces{};
  /// Paths of one batch in one pixel. Their sub-pixel position, light sample and first direction are stratified
  /// together, so the error falls faster with larger batches; batches are independent of one another. At least 1.
  int samples_per_batch = 4;
  /// Seed of everything random.
  std::uint64_t seed = 1;
  /// Keep the components beside the total: eight times the memory.
  bool components = true;
};

void validate(const TraceParams& params);

/// Mean and standard error of a quantity in every pixel and band, from independent batches.
struct Estimate {
  image::SpectralImage mean;
  image::SpectralImage standard_error;
  /// The same for the integral over the bands [W m^-2 sr^-1], one value a pixel: bands share paths and are not
  /// independent.
  std::vector<double> integral_mean;
  std::vector<double> integral_standard_error;
};

/// H(x) = E⁰(x) + B(next hit), B = S H + D_L H, with the next direction drawn from cosθ/π and E⁰ by next-event
/// estimation (beams and disks: a shadow ray; sky: the next ray itself; emitting surfaces: area and direction sampling
/// combined by the balance heuristic, so that no sample is unbounded). All bands share the path; it is built from the
/// camera outwards and evaluated from its far end, a matrix at each vertex, with the irradiance split by history as in
/// the solver. Russian roulette continues with the material's largest possible gain, whatever the band.
///
/// Cost O(pixels × batches × samples × path length × (rays + bands²)). Same bits for any number of threads.
class PathTracer {
 public:
  /// @throws InvalidParams. Keeps a reference to the scene.
  PathTracer(const scene::Scene& scene, const TraceParams& params);
  ~PathTracer();
  PathTracer(PathTracer&&) noexcept;

  /// Traces further independent batches in every pixel.
  void add_batches(int count, const Progress& progress = {});

  int batches() const;
  std::int64_t paths() const;

  /// @pre at least 2 batches. The t distribution with batches() - 1 degrees of freedom applies to one pixel.
  Estimate estimate(Channel channel) const;

  /// Largest band integral of a single path seen so far, and what one path could reach at most with the light paths of
  /// this scene up to the length that all but 1e-12 of the paths end at [W m^-2 sr^-1]. For bounds that do not trust
  /// the sample variance.
  double largest_sample() const;
  double largest_possible_sample() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace interglow::cross_check
