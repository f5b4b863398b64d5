// SPDX-License-Identifier: GPL-3.0-or-later
/// Pixel by pixel: where do a picture and an estimate of it differ, and are the differences what chance would make?
/// For diagnosis; claims of agreement are made on regions (`judge`).
#pragma once

#include <vector>

#include "cross_check/agreement.h"

namespace interglow::cross_check {

struct PixelDiagnosis {
  /// (candidate - reference) / `error`, of the band integrals; 0 where both are 0.
  std::vector<double> z;
  /// What each pixel's difference is measured by, from three parts added in squares. Noise of the reference: mean of
  /// the pixel's own variance and that of the judged pixels up to `noise_px` away, because a standard error of few runs
  /// that met no rare path says too little. The candidate's own error: its change from patches twice as large, if these
  /// are there. And the rounding of single precision (1e-5 of the reference), of which it is at least.
  std::vector<double> error;
  /// Pixels within `silhouette_px` of an edge of what the reference shows; left out of the figures below.
  std::vector<char> near_silhouette;
  /// Pixels that the figures below are about: not near a silhouette, and the reference scatters more than single
  /// precision rounds.
  std::vector<char> judged;
  /// Pixels whose difference is significant with the false-discovery rate held (Benjamini and Hochberg 1995).
  std::vector<char> significant;
  int judged_pixels = 0;
  int significant_pixels = 0;
  double z_rms = 0.0;
  /// What z_rms would be by chance: that of Student's t with the degrees of freedom (Satterthwaite) that the
  /// reference's batches give to the averaged variances.
  double expected_z_rms = 1.0;
  /// Correlation of z with its right and lower neighbour: structure below the threshold of single pixels.
  double autocorrelation = 0.0;
  /// The same in standard deviations of its chance value, (autocorrelation × √pairs).
  double autocorrelation_z = 0.0;
  /// Pixels where the reference scatters less than single precision rounds (they are not judged), but the values differ
  /// by more.
  int certain_differences = 0;
};

struct DiagnosisParams {
  int silhouette_px = 2;
  int noise_px = 2;
  /// Expected share of false alarms among the significant pixels, in (0, 1).
  double false_discovery_rate = 0.01;
};

/// Cost O(pixels (log pixels + noise_px²)).
PixelDiagnosis diagnose(const Comparison& comparison, const DiagnosisParams& params = {});

}  // namespace interglow::cross_check
