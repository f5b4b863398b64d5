// SPDX-License-Identifier: GPL-3.0-or-later
// Simulated pictures whose truth is known. Rates are counts over 10,000 trials, printed, and refused above the stated
// 1 %. One look spends half of that (`risk_of_look`): a rate of 0.5 % passes 1 % by chance with probability 1e-10.
#include "cross_check/agreement.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <vector>

#include "cross_check/pixel_diagnosis.h"
#include "diagnostics/error.h"

namespace interglow::cross_check {
namespace {

constexpr int kBatches = 32;

struct MeanAndError {
  double mean, error;
};

/// Of batches with independent normal values: mean and variance are drawn from their own distributions (Cochran).
MeanAndError normal_batches(double truth, double batch_sd, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  std::chi_squared_distribution<double> chi_squared(kBatches - 1);
  const double scale = truth * batch_sd / std::sqrt(kBatches);
  return {truth + scale * normal(random), scale * std::sqrt(chi_squared(random) / (kBatches - 1))};
}

MeanAndError lognormal_batches(double truth, double batch_sd, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  const double log_sd = std::sqrt(std::log1p(batch_sd * batch_sd));
  double sum = 0.0;
  double squares = 0.0;
  for (int batch = 0; batch < kBatches; ++batch) {
    const double value = truth * std::exp(log_sd * normal(random) - 0.5 * log_sd * log_sd);
    sum += value;
    squares += value * value;
  }
  const double mean = sum / kBatches;
  return {mean, std::sqrt((squares / kBatches - mean * mean) / (kBatches - 1))};
}

/// Batches of normal or lognormal values with the given relative standard deviation of a batch, around `truth`.
Estimate simulate(int side, double truth, double batch_sd, bool lognormal, std::mt19937_64& random) {
  Estimate estimate;
  estimate.mean = {side, side, Eigen::VectorXd::Constant(1, 550.0), {}};
  const auto pixels = static_cast<std::size_t>(side * side);
  estimate.mean.value.resize(pixels);
  estimate.standard_error = estimate.mean;
  for (std::size_t p = 0; p < pixels; ++p) {
    const auto [mean, error] =
        lognormal ? lognormal_batches(truth, batch_sd, random) : normal_batches(truth, batch_sd, random);
    estimate.mean.value[p] = static_cast<float>(mean);
    estimate.standard_error.value[p] = static_cast<float>(error);
    estimate.integral_mean.push_back(mean);
    estimate.integral_standard_error.push_back(error);
  }
  return estimate;
}

image::SpectralImage constant(int side, double value) {
  return {side, side, Eigen::VectorXd::Constant(1, 550.0),
          std::vector<float>(static_cast<std::size_t>(side * side), static_cast<float>(value))};
}

Comparison comparison(int side, double candidate, Estimate reference) {
  Comparison comparison{.candidate = constant(side, candidate),
                        .reference = std::move(reference),
                        .band_width_nm = Eigen::VectorXd::Constant(1, 1.0)};
  comparison.batches = kBatches;
  comparison.samples_per_pixel = kBatches;
  return comparison;
}

struct Rates {
  double agrees = 0.0, disagrees = 0.0, detected = 0.0;
};

Rates rates(double bias, double batch_sd, bool lognormal, int trials, int tiles = 1) {
  std::mt19937_64 random(20211);
  Rates rates;
  constexpr int kSide = 8;
  for (int trial = 0; trial < trials; ++trial) {
    const Agreement agreement = judge(
        {comparison(kSide, 1.0 + bias, simulate(kSide, 1.0, batch_sd, lognormal, random))}, {.tiles_per_side = tiles});
    rates.agrees += agreement.verdict == Verdict::kAgrees ? 1.0 : 0.0;
    rates.disagrees += agreement.verdict == Verdict::kDisagrees ? 1.0 : 0.0;
    rates.detected += agreement.difference_detected ? 1.0 : 0.0;
  }
  rates.agrees /= trials;
  rates.disagrees /= trials;
  rates.detected /= trials;
  std::printf("  of %d trials: bias %+.1f %%, %s, %d region(s): agrees %.2f %%, disagrees %.2f %%, detected %.2f %%\n",
              trials, 100.0 * bias, lognormal ? "lognormal" : "normal", tiles == 1 ? 1 : tiles * tiles + 1,
              100.0 * rates.agrees, 100.0 * rates.disagrees, 100.0 * rates.detected);
  return rates;
}

/// Independent normal batches of one pixel, as they grow.
struct GrowingPixel {
  double batches = 0.0, mean = 0.0, squares = 0.0;

  void grow(int count, double batch_sd, std::mt19937_64& random) {
    std::normal_distribution<double> normal;
    std::chi_squared_distribution<double> chi_squared(count - 1);
    const double group = 1.0 + batch_sd / std::sqrt(count) * normal(random);
    const double all = batches + count;
    squares += batch_sd * batch_sd * chi_squared(random) + (group - mean) * (group - mean) * batches * count / all;
    mean += (group - mean) * count / all;
    batches = all;
  }
};

/// Looks at growing samples until a verdict, as the cross-check does, with at most `most_batches`.
Rates rates_of_growing_samples(double bias, double batch_sd, int most_batches, int trials) {
  std::mt19937_64 random(41);
  Rates rates;
  double looks = 0.0;
  constexpr int kSide = 4;
  const Estimate shape = simulate(kSide, 1.0, batch_sd, false, random);
  for (int trial = 0; trial < trials; ++trial) {
    std::vector<GrowingPixel> pixels(kSide * kSide);
    Comparison growing = comparison(kSide, 1.0 + bias, shape);
    growing.batches = 0;
    AgreementParams params{.tiles_per_side = 1};
    int wanted = kBatches;
    for (;; ++params.look) {
      growing.batches += wanted;
      for (std::size_t p = 0; p < pixels.size(); ++p) {
        pixels[p].grow(wanted, batch_sd, random);
        growing.reference.integral_mean[p] = pixels[p].mean;
        growing.reference.integral_standard_error[p] =
            std::sqrt(pixels[p].squares / (growing.batches - 1.0) / growing.batches);
      }
      const Agreement agreement = judge({growing}, params);
      rates.agrees += agreement.verdict == Verdict::kAgrees ? 1.0 / trials : 0.0;
      rates.disagrees += agreement.verdict == Verdict::kDisagrees ? 1.0 / trials : 0.0;
      const double growth = std::clamp(agreement.samples_factor - 1.0, 0.5, 3.0);
      wanted = std::min(most_batches - growing.batches, static_cast<int>(std::ceil(growth * growing.batches)));
      if (agreement.verdict != Verdict::kUndecided || !agreement.decidable || wanted < 8) break;
    }
    looks += static_cast<double>(params.look) / trials;
  }
  std::printf("  of %d trials: bias %+.1f %%, growing samples, %.1f looks: agrees %.2f %%, disagrees %.2f %%\n", trials,
              100.0 * bias, looks, 100.0 * rates.agrees, 100.0 * rates.disagrees);
  return rates;
}

// 64 pixels × 32 batches: a batch deviation of 0.07 leaves 0.155 % of the mean.
constexpr double kBatchSd = 0.07;

TEST(Agreement, EqualSidesAreCalledDifferentAtMostAsOftenAsStated) {
  for (const bool lognormal : {false, true}) {
    const Rates found = rates(0.0, kBatchSd, lognormal, 10000);
    EXPECT_LE(found.detected, 0.01);
    EXPECT_LE(found.disagrees, 0.01);
  }
}

TEST(Agreement, FamilyOfTilesKeepsTheStatedFalseAlarmRate) {
  const Rates found = rates(0.0, kBatchSd, false, 10000, 4);
  EXPECT_LE(found.detected, 0.01);
}

TEST(Agreement, EquivalenceIsClaimedFalselyInAtMostOnePercentAtTheBoundary) {
  for (const double bias : {0.005, -0.005}) {
    for (const bool lognormal : {false, true})
      EXPECT_LE(rates(bias, kBatchSd, lognormal, 10000).agrees, 0.01) << bias << " " << lognormal;
  }
}

// Whoever looks again and again is right by chance some time: the looks share the risk.
TEST(Agreement, GrowingSamplesKeepTheStatedRisk) {
  // 16 pixels × 32 batches leave 0.44 % of the mean, 2048 batches 0.055 %.
  for (const double bias : {0.005, -0.005}) EXPECT_LE(rates_of_growing_samples(bias, 0.1, 2048, 10000).agrees, 0.01);
  const Rates equal = rates_of_growing_samples(0.0, 0.1, 2048, 1000);
  EXPECT_LE(equal.disagrees, 0.01);
  EXPECT_GE(equal.agrees, 0.95);
  EXPECT_NEAR(risk_of_look(0.01, 1) + risk_of_look(0.01, 2) + risk_of_look(0.01, 3), 0.01 * (1.0 - 1.0 / 4.0), 1e-15);
}

TEST(Agreement, IsClaimedWhereThereIsRoomAndRefusedWhereNot) {
  // Reach 2.58 × 0.062 % = 0.16 %: at no bias the claim fails only beyond 5.4 standard errors.
  EXPECT_EQ(rates(0.0, 0.4 * kBatchSd, false, 200).agrees, 1.0);
  EXPECT_EQ(rates(0.02, 0.4 * kBatchSd, false, 200).disagrees, 1.0);
  // Too noisy to say anything: 1.5 % standard error.
  const Rates noisy = rates(0.0, 10.0 * kBatchSd, false, 200);
  EXPECT_EQ(noisy.agrees, 0.0);
}

// Energy of 10 % in spikes of probability 1e-6 that no sample met: Student's t sees nothing and claims; the bound
// refuses.
TEST(Agreement, BernsteinBoundRefusesTheClaimThatRareSpikesMakeFalse) {
  std::mt19937_64 random(7);
  Comparison spiky = comparison(8, 0.9, simulate(8, 0.9, 0.01, false, random));
  EXPECT_EQ(judge({spiky}, {.tiles_per_side = 1}).verdict, Verdict::kAgrees) << "the trap must exist to be avoided";
  spiky.largest_possible_sample = 0.1 / 1e-6;
  EXPECT_EQ(judge({spiky}, {.tiles_per_side = 1}).verdict, Verdict::kUndecided);
}

TEST(Agreement, DiscretisationErrorCountsInsideTheMargin) {
  std::mt19937_64 random(8);
  Comparison refined = comparison(8, 1.0, simulate(8, 1.0, 0.01, false, random));
  refined.coarser = constant(8, 1.003);
  const Agreement fine = judge({refined}, {.tiles_per_side = 1});
  EXPECT_NEAR(fine.regions.front().discretisation, 0.003, 2e-4);
  EXPECT_EQ(fine.verdict, Verdict::kAgrees);
  refined.coarser = constant(8, 1.006);
  EXPECT_EQ(judge({refined}, {.tiles_per_side = 1}).verdict, Verdict::kUndecided);
}

// Patches too coarse for one tile do not stop the sampling that other tiles need.
TEST(Agreement, OneHopelessTileDoesNotEndTheSampling) {
  std::mt19937_64 random(15);
  Comparison two = comparison(8, 1.0, simulate(8, 1.0, 0.05, false, random));
  two.coarser = two.candidate;
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) two.coarser->pixel(row, column)[0] = 1.1F;
  }
  two.tiles_per_side = 2;
  const Agreement both = judge({two}, {});
  EXPECT_EQ(both.verdict, Verdict::kUndecided);
  EXPECT_TRUE(both.decidable);
  for (float& value : two.coarser->value) value = 1.1F;
  EXPECT_FALSE(judge({two}, {}).decidable);
}

TEST(Agreement, PlannedSamplesDecide) {
  std::mt19937_64 random(9);
  const double sd = 3.0 * kBatchSd;
  const Agreement pilot = judge({comparison(8, 1.0, simulate(8, 1.0, sd, false, random))}, {.tiles_per_side = 1});
  ASSERT_EQ(pilot.verdict, Verdict::kUndecided);
  ASSERT_GT(pilot.samples_factor, 1.0);
  // A few times the plan covers the difference that the pilot happened to find.
  const double planned_sd = sd / std::sqrt(2.0 * pilot.samples_factor);
  int decided = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const auto verdict =
        judge({comparison(8, 1.0, simulate(8, 1.0, planned_sd, false, random))}, {.tiles_per_side = 1}).verdict;
    decided += verdict == Verdict::kAgrees ? 1 : 0;
  }
  EXPECT_GE(decided, 180);  // power 0.95 planned: below 180 of 200 with probability 1e-3
}

TEST(Agreement, LightWhereThereIsNoneDisagrees) {
  Comparison dark = comparison(8, 0.1, {});
  std::mt19937_64 random(10);
  dark.reference = simulate(8, 0.0, 0.0, false, random);
  EXPECT_EQ(judge({dark}, {}).verdict, Verdict::kDisagrees);
}

TEST(Agreement, NamesWhatDoesNotMatch) {
  std::mt19937_64 random(11);
  Comparison wrong = comparison(8, 1.0, simulate(4, 1.0, 0.1, false, random));
  try {
    judge({wrong}, {});
    FAIL();
  } catch (const InvalidInput& error) {
    EXPECT_NE(std::string(error.what()).find("8 x 8"), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("4 x 4"), std::string::npos) << error.what();
  }
  EXPECT_THROW(validate(AgreementParams{.margin = 0.0}), InvalidParams);
  EXPECT_THROW(validate(AgreementParams{.confidence = 1.0}), InvalidParams);
}

TEST(PixelDiagnosis, ChanceLooksLikeChance) {
  std::mt19937_64 random(12);
  const PixelDiagnosis diagnosis = diagnose(comparison(128, 1.0, simulate(128, 1.0, 0.2, false, random)));
  // 16,384 pixels: z² of Student's t has a relative standard deviation near 1.55 / 128 here.
  EXPECT_NEAR(diagnosis.z_rms, diagnosis.expected_z_rms, 5.0 * 0.5 * 1.55 / 128);
  EXPECT_LT(std::abs(diagnosis.autocorrelation_z), 5.0);
  // Benjamini-Hochberg at 1 % with nothing to find: any discovery at all has probability 1 %.
  EXPECT_EQ(diagnosis.significant_pixels, 0);
}

// A faint indirect light that few paths meet: 0, 1, 2 ... hits a batch, 3 a pixel and 8 batches. Where a pixel had none
// beside a little noise of something else, its own standard error knows nothing of them. 16,384 pixels; z² has a
// relative standard deviation below 3.
TEST(PixelDiagnosis, RarePathsDoNotMakeDifferences) {
  constexpr int kSide = 128;
  constexpr int kFewBatches = 8;
  std::mt19937_64 random(23);
  std::poisson_distribution<int> hits(3.0 / kFewBatches);
  std::normal_distribution<double> faint(0.0, 1e-4);
  Comparison rare = comparison(kSide, 1.03, simulate(kSide, 1.0, 0.2, false, random));
  rare.batches = 0;  // unknown, as of a picture from elsewhere
  for (std::size_t p = 0; p < rare.reference.integral_mean.size(); ++p) {
    double sum = 0.0;
    double squares = 0.0;
    for (int b = 0; b < kFewBatches; ++b) {
      const double value = 1.0 + 0.01 * kFewBatches * hits(random) + faint(random);
      sum += value;
      squares += value * value;
    }
    const double mean = sum / kFewBatches;
    rare.reference.integral_mean[p] = mean;
    rare.reference.integral_standard_error[p] = std::sqrt((squares / kFewBatches - mean * mean) / (kFewBatches - 1));
  }
  EXPECT_NEAR(diagnose(rare).z_rms, 1.05, 0.15);
  EXPECT_GT(diagnose(rare, {.noise_px = 0}).z_rms, 10.0) << "pixels without a hit";
}

TEST(PixelDiagnosis, TheCandidatesOwnErrorCounts) {
  std::mt19937_64 random(24);
  Comparison coarse = comparison(32, 1.2, simulate(32, 1.0, 0.2, false, random));  // 5.7 standard errors off
  EXPECT_GT(diagnose(coarse).z_rms, 5.0);
  coarse.coarser = constant(32, 1.6);
  EXPECT_NEAR(diagnose(coarse).z_rms, 0.5, 0.05);
}

TEST(PixelDiagnosis, FindsAFaultThatTheWholePictureHides) {
  std::mt19937_64 random(13);
  Comparison faulty = comparison(64, 1.0, simulate(64, 1.0, 0.2, false, random));
  for (int row = 20; row < 24; ++row) {
    for (int column = 20; column < 24; ++column) faulty.candidate.pixel(row, column)[0] = 1.5F;  // 14 standard errors
  }
  const PixelDiagnosis diagnosis = diagnose(faulty);
  EXPECT_GE(diagnosis.significant_pixels, 15);
  EXPECT_GT(diagnosis.autocorrelation_z, 10.0);
}

// Direct light without noise differs by the rounding of another renderer's single precision: no z says anything there.
TEST(PixelDiagnosis, RoundingIsNotScatter) {
  std::mt19937_64 random(16);
  Comparison quiet = comparison(16, 1.0, simulate(16, 1.0, 0.2, false, random));
  for (std::size_t p = 0; p < 128; ++p) {
    quiet.reference.integral_mean[p] = 1.0 + 3e-6;
    quiet.reference.integral_standard_error[p] = 1e-9;
  }
  const PixelDiagnosis diagnosis = diagnose(quiet);
  EXPECT_EQ(diagnosis.judged_pixels, 128);
  EXPECT_EQ(diagnosis.certain_differences, 0);
  // 128 values of z² with a relative standard deviation near 1.55 / sqrt(128) of their mean.
  EXPECT_NEAR(diagnosis.z_rms, diagnosis.expected_z_rms, 5.0 * 0.5 * 1.55 / std::sqrt(128.0));
  quiet.candidate.value[5] = 1.0001F;
  EXPECT_EQ(diagnose(quiet).certain_differences, 1);
}

TEST(PixelDiagnosis, LeavesOutTheSilhouette) {
  std::mt19937_64 random(14);
  Comparison half = comparison(16, 1.0, simulate(16, 1.0, 0.2, false, random));
  for (int row = 0; row < 16; ++row) {
    for (int column = 0; column < 8; ++column) {
      const auto p = static_cast<std::size_t>(row * 16 + column);
      half.reference.integral_mean[p] = half.reference.integral_standard_error[p] = 0.0;
      half.candidate.value[p] = 0.0F;
    }
  }
  const PixelDiagnosis diagnosis = diagnose(half, {.silhouette_px = 2});
  EXPECT_EQ(diagnosis.judged_pixels, 16 * 6);
  EXPECT_EQ(diagnosis.certain_differences, 0);
}

}  // namespace
}  // namespace interglow::cross_check
