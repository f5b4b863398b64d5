// SPDX-License-Identifier: GPL-3.0-or-later
#include "verification/cross_check_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include "diagnostics/error.h"
#include "spectral/wavelength_grid.h"
#include "verification/check_scene.h"
#include "verification/stopwatch.h"

namespace interglow::verification {
namespace {

using cross_check::Channel;
using cross_check::Comparison;
using cross_check::Estimate;
using cross_check::PathTracer;
using cross_check::Verdict;

/// Halving patches costs at least this many times the run before it (4 times the patches, up to 16 times the pairs).
constexpr double kHalvingCost = 6.0;
/// Share of the time limit that halved patches may take.
constexpr double kHalvingShare = 0.5;

void run_both_radiosities(CrossCheck& check, const CrossCheckParams& params, const Stopwatch& clock,
                          const Progress& progress) {
  const auto keeps_its_patches = [&](const RadiosityRun& run) {
    const std::size_t fine_patches = 4 * run.patches;
    const double expected_s = kHalvingCost * run.seconds();
    if (fine_patches > params.most_halved_patches) {
      check.discretisation_note = fmt::format("{} patches would be {} when halved, more than the {} allowed",
                                              run.patches, fine_patches, params.most_halved_patches);
    } else if (clock.seconds() + expected_s > kHalvingShare * params.time_limit_s && expected_s > 1.0) {
      check.discretisation_note =
          fmt::format("halved patches were expected to take {:.0f} s, too long for a time limit of {:.0f} s",
                      expected_s, params.time_limit_s);
    }
    return !check.discretisation_note.empty();
  };
  check.coarse = run_radiosity(check.scene, params.radiosity, progress, keeps_its_patches);
  if (check.discretisation_note.empty()) check.fine = run_radiosity(halved(check.scene), params.radiosity, progress);
}

/// Own noise that adds less than this share to the reference's variance: without it intervals would be 10 % shorter.
constexpr double kLeastOwnVariance = 0.2;

double variance(const std::vector<Comparison>& comparisons) {
  double sum = 0.0;
  for (const double error : comparisons.front().reference.integral_standard_error) sum += error * error;
  return sum;
}

/// Whether a candidate without noise would decide one of the regions that are undecided.
bool samples_help(const cross_check::Agreement& now, const cross_check::Agreement& without_noise) {
  for (std::size_t r = 0; r < now.regions.size() && r < without_noise.regions.size(); ++r) {
    if (now.regions[r].verdict == Verdict::kUndecided && without_noise.regions[r].verdict != Verdict::kUndecided)
      return true;
  }
  return false;
}

/// Adds batches until `judge` decides, more samples cannot, or time is up. `compare` makes the comparisons of the
/// current estimate; `compare_without_noise` the same as if the path tracer's noise were nothing, where its other side
/// has noise of its own.
void sample_until_decided(CrossCheck& check, PathTracer& tracer, const CrossCheckParams& params, const Stopwatch& clock,
                          const Progress& progress, const std::function<std::vector<Comparison>()>& compare,
                          const std::function<std::vector<Comparison>()>& compare_without_noise = {}) {
  int wanted = params.first_batches;
  cross_check::AgreementParams agreement = params.agreement;

  double traced_s = 0.0;
  for (agreement.look = 1;; ++agreement.look) {
    const Stopwatch step;
    tracer.add_batches(wanted, progress);
    traced_s += step.seconds();
    check.comparisons = compare();
    check.agreement = cross_check::judge(check.comparisons, agreement);
    check.looks = agreement.look;
    const double pixels = static_cast<double>(check.scene.camera.width) * check.scene.camera.height;
    check.noise.push_back(
        {traced_s, static_cast<double>(tracer.paths()) / pixels, rms_noise(tracer.estimate(Channel::kTotal))});
    check.batches = tracer.batches();
    if (check.agreement.verdict != Verdict::kUndecided || !check.agreement.decidable) break;
    if (compare_without_noise) {
      const std::vector<Comparison> best = compare_without_noise();
      check.reference_limits = variance(check.comparisons) < (1.0 + kLeastOwnVariance) * variance(best) ||
                               !samples_help(check.agreement, cross_check::judge(best, agreement));
      if (check.reference_limits) break;
    }
    const double left_s = params.time_limit_s - clock.seconds();
    const double batch_s = traced_s / tracer.batches();
    const auto affordable = static_cast<int>(std::min(1e6, left_s / std::max(batch_s, 1e-9)));
    // At most four times at once, because the plan follows a noisy estimate, and half as many again at least, because
    // every look costs confidence.
    const double growth = std::clamp(check.agreement.samples_factor - 1.0, 0.5, 3.0);
    wanted = std::min(affordable, static_cast<int>(std::ceil(growth * tracer.batches())));
    if (wanted < 8) {
      check.out_of_time = true;
      break;
    }
  }
  check.paths = tracer.paths();
  check.largest_sample = tracer.largest_sample();
  check.seconds_path_tracer = traced_s;
}

void finish(CrossCheck& check, const Stopwatch& clock) {
  check.diagnosis = cross_check::diagnose(check.comparisons.front());
  check.verdict = check.reference_has_error ? check.agreement.verdict : Verdict::kUndecided;
  check.seconds = clock.seconds();
}

cross_check::TraceParams trace_params(const CrossCheckParams& params, bool components) {
  return {.bounces = params.radiosity.solve.bounces,
          .samples_per_batch = params.samples_per_batch,
          .seed = params.seed,
          .components = components};
}

/// Independent errors of both sides.
void add_error(Estimate& reference, const Estimate& other) {
  for (std::size_t i = 0; i < reference.standard_error.value.size(); ++i)
    reference.standard_error.value[i] = std::hypot(reference.standard_error.value[i], other.standard_error.value[i]);
  for (std::size_t i = 0; i < reference.integral_standard_error.size(); ++i) {
    reference.integral_standard_error[i] =
        std::hypot(reference.integral_standard_error[i], other.integral_standard_error[i]);
  }
}

image::SpectralImage black_like(image::SpectralImage image) {
  std::fill(image.value.begin(), image.value.end(), 0.0F);
  return image;
}

}  // namespace

void validate(const CrossCheckParams& params) {
  cross_check::validate(params.agreement);
  radiosity::validate(params.radiosity.transport);
  radiosity::validate(params.radiosity.solve);
  rendering::validate(params.radiosity.render);
  const auto check = [](bool good, const char* field, double value, const char* range) {
    if (!good) throw InvalidParams(fmt::format("cross-check: {} is {}, expected {}.", field, value, range));
  };
  check(params.time_limit_s > 0.0, "time_limit_s", params.time_limit_s, "above 0");
  check(params.first_batches >= 32, "first_batches", params.first_batches, "at least 32");
  check(params.samples_per_batch >= 1, "samples_per_batch", params.samples_per_batch, "at least 1");
  check(params.comparison.faint_component_share > 0.0 && params.comparison.faint_component_share < 1.0,
        "faint_component_share", params.comparison.faint_component_share, "between 0 and 1");
}

CrossCheck cross_check_scene(const scene::Scene& scene, const CrossCheckParams& params, const Progress& progress) {
  validate(params);
  const Stopwatch clock;
  CrossCheck check;
  check.scene = scene;
  check.candidate_name = "radiosity";
  check.reference_name = "path tracer";
  run_both_radiosities(check, params, clock, progress);
  PathTracer tracer(check.scene, trace_params(params, true));
  sample_until_decided(check, tracer, params, clock, progress, [&] {
    return compare_channels(check.candidate_run()->images, check.coarser_images(), tracer, check.scene,
                            params.comparison);
  });
  finish(check, clock);
  return check;
}

CrossCheck cross_check_reference(const scene::Scene& scene, const ReferenceImage& reference, Method method,
                                 const CrossCheckParams& params, const Progress& progress) {
  validate(params);
  const Stopwatch clock;
  CrossCheck check;
  check.scene = scene;
  check.scene.camera.width = reference.mean.width;
  check.scene.camera.height = reference.mean.height;
  check.reference_name = "reference image";
  check.reference_has_error = reference.standard_error.has_value();
  const Eigen::VectorXd& wavelengths = reference.mean.wavelength_nm;
  const Eigen::VectorXd widths = spectral::WavelengthGrid::from_centers(wavelengths).widths_nm();
  const image::SpectralImage error = reference.standard_error ? *reference.standard_error : black_like(reference.mean);
  const Estimate estimate = cross_check::estimate_from_images(reference.mean, error, widths);
  Comparison total{.channel = "total", .candidate = {}, .reference = estimate, .band_width_nm = widths};

  if (method == Method::kRadiosity) {
    check.candidate_name = "radiosity";
    run_both_radiosities(check, params, clock, progress);
    const Eigen::MatrixXd conversion = band_conversion(reference, check.candidate_run()->images.total.wavelength_nm);
    total.candidate = convert_bands(check.candidate_run()->images.total, conversion, wavelengths);
    if (check.coarser_images() != nullptr)
      total.coarser = convert_bands(check.coarser_images()->total, conversion, wavelengths);
    check.comparisons = {total};
    check.agreement = cross_check::judge(check.comparisons, params.agreement);
  } else {
    check.candidate_name = "path tracer";
    PathTracer tracer(check.scene, trace_params(params, false));
    const auto compared = [&](bool with_noise) {
      const Estimate traced = tracer.estimate(Channel::kTotal);
      const Estimate converted =
          convert_bands(traced, band_conversion(reference, traced.mean.wavelength_nm), wavelengths, widths);
      Comparison one = total;
      one.candidate = converted.mean;
      if (with_noise) {
        add_error(one.reference, converted);
        one.batches = tracer.batches();
      }
      return std::vector<Comparison>{one};
    };
    sample_until_decided(
        check, tracer, params, clock, progress, [&] { return compared(true); }, [&] { return compared(false); });
  }
  finish(check, clock);
  return check;
}

}  // namespace interglow::verification
