// SPDX-License-Identifier: GPL-3.0-or-later
/// Does a picture agree with an independent estimate of it, within a stated margin and with a stated confidence?
/// "No difference was found" is never taken for agreement: a region agrees only if its whole confidence interval lies
/// inside the margin (two one-sided tests, Schuirmann 1987).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "cross_check/path_tracer.h"
#include "image/spectral_image.h"

namespace interglow::cross_check {

enum class Verdict { kAgrees, kDisagrees, kUndecided };
const char* name(Verdict verdict);

struct AgreementParams {
  /// Largest relative difference of a region's radiance that counts as agreement, in (0, 1).
  double margin = 0.005;
  /// Confidence of each claim of agreement, and of all claims of difference together, in (0.5, 1).
  double confidence = 0.99;
  /// Tiles along each side of the picture; each is a region of its own.
  int tiles_per_side = 8;
  /// Regions that hold less than this share of the mean region's signal are not judged: their relative error means
  /// nothing.
  double least_signal = 0.02;
  /// Probability of deciding that sample planning aims at, in (0.5, 1).
  double power = 0.95;
  /// Which look at the samples this is, from 1, where they grow until a verdict: each look may err, and all of them
  /// together must not err more often than the confidence allows. See `risk_of_look`.
  int look = 1;
};

/// What look k = 1, 2, ... may spend of the whole risk: risk / (k (k + 1)), which sums to the whole for any number of
/// looks (Bonferroni).
double risk_of_look(double risk, int look);

void validate(const AgreementParams& params);

/// What is compared: one channel of a deterministic picture with an estimate of the same.
struct Comparison {
  std::string channel = "total";
  image::SpectralImage candidate;
  /// The same picture from patches twice as large, if its discretisation error is to count inside the margin.
  std::optional<image::SpectralImage> coarser{};
  Estimate reference;
  Eigen::VectorXd band_width_nm;
  /// Independent batches behind each pixel of the reference; 0: unknown (the normal distribution is used).
  int batches = 0;
  std::int64_t samples_per_pixel = 0;
  /// Largest band-integrated radiance one sample can have; empty: unknown.
  std::optional<double> largest_possible_sample{};
  /// Tiles along each side for this channel; empty: as in AgreementParams.
  std::optional<int> tiles_per_side{};
  /// Whether each band of the whole picture is a region of its own.
  bool judge_bands = true;
  /// Differences are relative to the region's mean signal, or to this if it is larger: what a faint component is to be
  /// measured by [W m^-2 sr^-1; band regions ignore it].
  double least_reference = 0.0;
};

/// One region (the whole picture, a tile, or a band of the whole picture) of one channel.
struct RegionResult {
  std::string channel;
  std::string region;
  double reference = 0.0;            ///< mean signal, W m^-2 sr^-1 (band regions: per nm)
  double relative_difference = 0.0;  ///< (candidate - reference) / max(reference, Comparison::least_reference)
  double standard_error = 0.0;       ///< of the relative difference
  double degrees_of_freedom = 0.0;   ///< Welch-Satterthwaite
  double discretisation = 0.0;       ///< bound on the candidate's own relative error
  /// Half-width of the one-sided interval at the confidence of this look, Student's t; discretisation not included.
  double half_width = 0.0;
  /// The same from the empirical Bernstein inequality (Maurer and Pontil 2009), which trusts no rare-event-free sample
  /// variance; empty where the largest sample is unknown or the region is a band. It must fit into the margin too
  /// where the region is the whole picture.
  std::optional<double> bernstein_half_width{};
  Verdict verdict = Verdict::kUndecided;
  double p_difference = 1.0;         ///< of a difference beyond the discretisation error
  bool difference_detected = false;  ///< after Holm's correction over all regions of the report
  /// Factor by which the samples must grow for a decision with the wanted power; 1 where it is decided; infinite if
  /// none can.
  double samples_factor = 1.0;
};

struct Agreement {
  std::vector<RegionResult> regions;
  std::vector<std::string> not_judged;    ///< regions with too little signal
  Verdict verdict = Verdict::kUndecided;  ///< agrees: every region does; disagrees: at least one does
  bool difference_detected = false;
  double samples_factor = 1.0;  ///< largest finite one of the regions
  bool decidable = true;        ///< none is undecided, or more samples can decide one that is
};

/// @throws InvalidInput if sizes or bands of candidate and reference differ, naming both
/// Cost O(pixels × bands) a comparison.
Agreement judge(const std::vector<Comparison>& comparisons, const AgreementParams& params);

/// An estimate from images of another renderer: the band-integral's error assumes that bands share their paths
/// entirely.
Estimate estimate_from_images(const image::SpectralImage& mean, const image::SpectralImage& standard_error,
                              const Eigen::VectorXd& band_width_nm);

}  // namespace interglow::cross_check
