// SPDX-License-Identifier: GPL-3.0-or-later
#include "cross_check/agreement.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <limits>
#include <numeric>

#include "diagnostics/error.h"

namespace interglow::cross_check {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// Above this many degrees of freedom Student's t is the normal distribution to six digits.
constexpr double kManyDegrees = 1e6;

double quantile(double probability, double degrees) {
  if (degrees > kManyDegrees) return boost::math::quantile(boost::math::normal(), probability);
  return boost::math::quantile(boost::math::students_t(degrees), probability);
}

double upper_tail(double t, double degrees) {
  if (degrees > kManyDegrees) return boost::math::cdf(boost::math::complement(boost::math::normal(), t));
  return boost::math::cdf(boost::math::complement(boost::math::students_t(degrees), t));
}

/// Sums over the pixels of a region; pixels are independent of one another.
struct RegionSums {
  double candidate = 0.0;
  double coarser = 0.0;
  double reference = 0.0;
  double variance = 0.0;          ///< Σ se²
  double variance_squared = 0.0;  ///< Σ se⁴, for Satterthwaite
  std::int64_t pixels = 0;

  void add(double a, double b, double r, double se) {
    candidate += a;
    coarser += b;
    reference += r;
    variance += se * se;
    variance_squared += se * se * se * se;
    ++pixels;
  }
};

void check_sizes(const Comparison& comparison) {
  const auto check = [&](const image::SpectralImage& other, const char* what) {
    const image::SpectralImage& candidate = comparison.candidate;
    if (other.width != candidate.width || other.height != candidate.height || other.bands() != candidate.bands()) {
      throw InvalidInput(
          fmt::format("{}: the picture is {} x {} with {} bands, its {} {} x {} with {}; they must be the same.",
                      comparison.channel, candidate.width, candidate.height, candidate.bands(), what, other.width,
                      other.height, other.bands()));
    }
  };
  check(comparison.reference.mean, "reference");
  check(comparison.reference.standard_error, "standard error");
  if (comparison.coarser) check(*comparison.coarser, "coarser version");
  if (comparison.band_width_nm.size() != comparison.candidate.bands()) {
    throw InvalidInput(fmt::format("{}: {} band widths for {} bands.", comparison.channel,
                                   comparison.band_width_nm.size(), comparison.candidate.bands()));
  }
}

double integral(const image::SpectralImage& image, std::size_t pixel, const Eigen::VectorXd& width) {
  const auto bands = static_cast<std::size_t>(image.bands());
  double sum = 0.0;
  for (std::size_t b = 0; b < bands; ++b)
    sum += static_cast<double>(image.value[pixel * bands + b]) * width[static_cast<Eigen::Index>(b)];
  return sum;
}

/// Half-width at one-sided risk `alpha` of the mean of `count` independent values in [0, bound] whose mean has the
/// given standard error: Maurer and Pontil (2009), theorem 4, for one side.
double bernstein(double standard_error, double bound, double count, double alpha) {
  const double log_term = std::log(2.0 / alpha);
  return std::sqrt(2.0 * log_term) * standard_error + 7.0 * bound * log_term / (3.0 * std::max(1.0, count - 1.0));
}

enum class RegionKind { kWhole, kTile, kBand };

class Judge {
 public:
  Judge(const AgreementParams& params, std::size_t families) : params_(params), families_(families) {}

  RegionResult result(const Comparison& comparison, std::string region, const RegionSums& sums, RegionKind kind) const {
    RegionResult result;
    result.channel = comparison.channel;
    result.region = std::move(region);
    const auto pixels = static_cast<double>(sums.pixels);
    result.reference = sums.reference / pixels;
    const double scale =
        kind == RegionKind::kBand ? sums.reference : std::max(sums.reference, comparison.least_reference * pixels);
    result.relative_difference = (sums.candidate - sums.reference) / scale;
    result.standard_error = std::sqrt(sums.variance) / scale;
    result.degrees_of_freedom = comparison.batches > 1 && sums.variance_squared > 0.0
                                    ? (comparison.batches - 1) * sums.variance * sums.variance / sums.variance_squared
                                    : kInfinity;
    // Grid convergence with a safety factor of 3 and order 2: 3 |f_h - f_2h| / (2² - 1).
    if (comparison.coarser) result.discretisation = std::abs(sums.candidate - sums.coarser) / scale;
    const double alpha = risk();
    result.half_width = quantile(1.0 - alpha, result.degrees_of_freedom) * result.standard_error;
    if (comparison.largest_possible_sample && kind != RegionKind::kBand) {
      const double count = pixels * static_cast<double>(comparison.samples_per_pixel);
      result.bernstein_half_width =
          bernstein(result.standard_error, *comparison.largest_possible_sample * pixels / scale, count, alpha);
    }
    const double reach = kind == RegionKind::kWhole
                             ? std::max(result.half_width, result.bernstein_half_width.value_or(0.0))
                             : result.half_width;
    decide(result, reach);
    return result;
  }

 private:
  double risk() const { return risk_of_look(1.0 - params_.confidence, params_.look); }

  /// @param reach  half-width that a claim of agreement must leave room for
  void decide(RegionResult& result, double reach) const {
    const double difference = std::abs(result.relative_difference);
    const double family_alpha = risk() / static_cast<double>(families_);
    const double family_reach = quantile(1.0 - family_alpha, result.degrees_of_freedom) * result.standard_error;
    if (difference + result.discretisation + reach < params_.margin) {
      result.verdict = Verdict::kAgrees;
    } else if (difference - result.discretisation - family_reach > params_.margin) {
      result.verdict = Verdict::kDisagrees;
    }
    const double beyond = difference - result.discretisation;
    if (beyond <= 0.0) {
      result.p_difference = 1.0;
    } else if (result.standard_error == 0.0) {
      // Nothing random: float storage decides what is a difference.
      result.p_difference = beyond > 1e-6 ? 0.0 : 1.0;
    } else {
      result.p_difference = std::min(1.0, 2.0 * upper_tail(beyond / result.standard_error, result.degrees_of_freedom));
    }
    if (result.verdict == Verdict::kUndecided) result.samples_factor = wanted_samples(result, reach, family_reach);
  }

  /// n grows the reach as 1/√n. The difference is taken as it was found, unless it is so near to the margin that chance
  /// may have put it there: then a quarter of the margin is planned for.
  double wanted_samples(const RegionResult& result, double reach, double family_reach) const {
    const double difference = std::abs(result.relative_difference);
    const double to_agree = params_.margin - difference - result.discretisation;
    const double to_disagree = difference - result.discretisation - params_.margin;
    const double chance = quantile(0.5 + params_.power / 2.0, result.degrees_of_freedom) * result.standard_error;
    double room = std::max(to_agree, to_disagree);
    if (room < chance) room = std::max(room, 0.25 * (params_.margin - result.discretisation));
    if (!(room > 0.0) || (result.standard_error == 0.0 && reach == 0.0)) return kInfinity;
    // The next look may spend less.
    const double next_risk = risk_of_look(1.0 - params_.confidence, params_.look + 1);
    const double growth =
        quantile(1.0 - next_risk, result.degrees_of_freedom) / quantile(1.0 - risk(), result.degrees_of_freedom);
    const double whole_reach = (to_agree >= to_disagree ? reach : family_reach) * growth + chance;
    return std::max(1.0, std::pow(whole_reach / room, 2));
  }

  AgreementParams params_;
  std::size_t families_;
};

/// Holm (1979): the largest set of claims with family-wise risk alpha.
void detect_differences(std::vector<RegionResult>& regions, double alpha) {
  std::vector<std::size_t> order(regions.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return regions[a].p_difference < regions[b].p_difference; });
  for (std::size_t rank = 0; rank < order.size(); ++rank) {
    RegionResult& region = regions[order[rank]];
    if (region.p_difference > alpha / static_cast<double>(order.size() - rank)) break;
    region.difference_detected = true;
  }
}

struct Region {
  const Comparison* comparison;
  std::string name;
  RegionSums sums;
  RegionKind kind;
};

std::vector<Region> regions_of(const Comparison& comparison, int default_tiles) {
  const int tiles = comparison.tiles_per_side.value_or(default_tiles);
  const image::SpectralImage& candidate = comparison.candidate;
  const Estimate& reference = comparison.reference;
  const auto bands = static_cast<std::size_t>(candidate.bands());
  RegionSums whole;
  std::vector<RegionSums> tile(static_cast<std::size_t>(tiles) * static_cast<std::size_t>(tiles));
  std::vector<RegionSums> band(bands);
  for (int row = 0; row < candidate.height; ++row) {
    for (int column = 0; column < candidate.width; ++column) {
      const auto pixel =
          static_cast<std::size_t>(row) * static_cast<std::size_t>(candidate.width) + static_cast<std::size_t>(column);
      const double a = integral(candidate, pixel, comparison.band_width_nm);
      const double b = comparison.coarser ? integral(*comparison.coarser, pixel, comparison.band_width_nm) : a;
      const double r = reference.integral_mean[pixel];
      const double se = reference.integral_standard_error[pixel];
      whole.add(a, b, r, se);
      const auto t = static_cast<std::size_t>(row * tiles / candidate.height) * static_cast<std::size_t>(tiles) +
                     static_cast<std::size_t>(column * tiles / candidate.width);
      tile[t].add(a, b, r, se);
      for (std::size_t k = 0; k < bands; ++k) {
        const std::size_t i = pixel * bands + k;
        const auto fine = static_cast<double>(candidate.value[i]);
        band[k].add(fine, comparison.coarser ? static_cast<double>(comparison.coarser->value[i]) : fine,
                    static_cast<double>(reference.mean.value[i]),
                    static_cast<double>(reference.standard_error.value[i]));
      }
    }
  }
  std::vector<Region> regions;
  regions.push_back({&comparison, "whole", whole, RegionKind::kWhole});
  if (tiles > 1) {
    for (std::size_t t = 0; t < tile.size(); ++t) {
      const auto side = static_cast<std::size_t>(tiles);
      regions.push_back(
          {&comparison, fmt::format("tile row {} column {}", t / side + 1, t % side + 1), tile[t], RegionKind::kTile});
    }
  }
  if (bands > 1 && comparison.judge_bands) {
    for (std::size_t k = 0; k < bands; ++k) {
      regions.push_back({&comparison,
                         fmt::format("band {:g} nm", candidate.wavelength_nm[static_cast<Eigen::Index>(k)]), band[k],
                         RegionKind::kBand});
    }
  }
  return regions;
}

}  // namespace

const char* name(Verdict verdict) {
  switch (verdict) {
    case Verdict::kAgrees:
      return "agrees";
    case Verdict::kDisagrees:
      return "disagrees";
    case Verdict::kUndecided:
      break;
  }
  return "undecided";
}

double risk_of_look(double risk, int look) { return risk / (static_cast<double>(look) * (look + 1)); }

void validate(const AgreementParams& params) {
  const auto check = [](bool good, const char* field, double value, const char* range) {
    if (!good) throw InvalidParams(fmt::format("agreement: {} is {}, expected {}.", field, value, range));
  };
  check(params.margin > 0.0 && params.margin < 1.0, "margin", params.margin, "between 0 and 1");
  check(params.confidence > 0.5 && params.confidence < 1.0, "confidence", params.confidence, "between 0.5 and 1");
  check(params.tiles_per_side >= 1 && params.tiles_per_side <= 1024, "tiles_per_side", params.tiles_per_side,
        "1 to 1024");
  check(params.least_signal >= 0.0 && params.least_signal < 1.0, "least_signal", params.least_signal,
        "from 0 to below 1");
  check(params.look >= 1, "look", params.look, "at least 1");
  check(params.power > 0.5 && params.power < 1.0, "power", params.power, "between 0.5 and 1");
}

Agreement judge(const std::vector<Comparison>& comparisons, const AgreementParams& params) {
  validate(params);
  Agreement agreement;
  std::vector<Region> judged;
  for (const Comparison& comparison : comparisons) {
    check_sizes(comparison);
    std::vector<Region> regions = regions_of(comparison, params.tiles_per_side);
    const double mean_signal = regions.front().sums.reference / static_cast<double>(regions.front().sums.pixels);
    double mean_band_signal = 0.0;
    int bands = 0;
    for (const Region& region : regions) {
      if (region.kind != RegionKind::kBand) continue;
      mean_band_signal += region.sums.reference / static_cast<double>(region.sums.pixels);
      ++bands;
    }
    if (bands > 0) mean_band_signal /= bands;
    for (Region& region : regions) {
      const RegionSums& sums = region.sums;
      if (sums.pixels == 0) continue;
      const double wanted = params.least_signal * (region.kind == RegionKind::kBand ? mean_band_signal : mean_signal);
      const bool dark = sums.reference / static_cast<double>(sums.pixels) <= wanted || sums.reference <= 0.0;
      // Light where the reference has none at all is a difference that no relative margin covers.
      const bool light_from_nothing =
          sums.candidate / static_cast<double>(sums.pixels) > wanted && sums.candidate > 0.0;
      if (dark && !light_from_nothing) {
        agreement.not_judged.push_back(comparison.channel + ", " + region.name);
      } else {
        judged.push_back(std::move(region));
      }
    }
  }
  const Judge judge(params, std::max<std::size_t>(1, judged.size()));
  for (const Region& region : judged) {
    const bool measurable = region.kind != RegionKind::kBand && region.comparison->least_reference > 0.0;
    if (region.sums.reference > 0.0 || measurable) {
      agreement.regions.push_back(judge.result(*region.comparison, region.name, region.sums, region.kind));
      continue;
    }
    RegionResult result{.channel = region.comparison->channel, .region = region.name};
    result.relative_difference = kInfinity;
    result.verdict = Verdict::kDisagrees;
    result.p_difference = 0.0;
    agreement.regions.push_back(result);
  }
  detect_differences(agreement.regions, risk_of_look(1.0 - params.confidence, params.look));
  agreement.verdict = agreement.regions.empty() ? Verdict::kUndecided : Verdict::kAgrees;
  const auto is_undecided = [](const RegionResult& region) { return region.verdict == Verdict::kUndecided; };
  const auto can_be_decided = [&](const RegionResult& region) {
    return is_undecided(region) && std::isfinite(region.samples_factor);
  };
  agreement.decidable = std::none_of(agreement.regions.begin(), agreement.regions.end(), is_undecided) ||
                        std::any_of(agreement.regions.begin(), agreement.regions.end(), can_be_decided);
  for (const RegionResult& region : agreement.regions) {
    agreement.difference_detected |= region.difference_detected;
    if (std::isfinite(region.samples_factor))
      agreement.samples_factor = std::max(agreement.samples_factor, region.samples_factor);
    if (region.verdict == Verdict::kDisagrees) agreement.verdict = Verdict::kDisagrees;
    if (region.verdict == Verdict::kUndecided && agreement.verdict == Verdict::kAgrees)
      agreement.verdict = Verdict::kUndecided;
  }
  return agreement;
}

Estimate estimate_from_images(const image::SpectralImage& mean, const image::SpectralImage& standard_error,
                              const Eigen::VectorXd& band_width_nm) {
  if (mean.width != standard_error.width || mean.height != standard_error.height ||
      mean.bands() != standard_error.bands()) {
    throw InvalidInput(fmt::format(
        "reference image {} x {} with {} bands, its standard error {} x {} with {}; they must be the same.", mean.width,
        mean.height, mean.bands(), standard_error.width, standard_error.height, standard_error.bands()));
  }
  if (band_width_nm.size() != mean.bands()) {
    throw InvalidInput(
        fmt::format("reference image: {} band widths for {} bands.", band_width_nm.size(), mean.bands()));
  }
  Estimate estimate{mean, standard_error, {}, {}};
  const std::size_t pixels = static_cast<std::size_t>(mean.width) * static_cast<std::size_t>(mean.height);
  estimate.integral_mean.resize(pixels);
  estimate.integral_standard_error.resize(pixels);
  for (std::size_t p = 0; p < pixels; ++p) {
    estimate.integral_mean[p] = integral(mean, p, band_width_nm);
    estimate.integral_standard_error[p] = integral(standard_error, p, band_width_nm);
  }
  return estimate;
}

}  // namespace interglow::cross_check
