// SPDX-License-Identifier: GPL-3.0-or-later
/// Pixel by pixel: where do a picture and an estimate of it differ, and are the differences what chance would make?
/// For diagnosis; claims of agreement are made on regions (`judge`).
#pragma once

#include <vector>

#include "cross_check/agreement.h"

namespace interglow::cross_check {

struct PixelDiagnosis {
  /// (candidate - reference) / standard error of the band integrals, or over the rounding of single precision (1e-5 of
  /// the reference) where that is larger; 0 where both are 0.
  std::vector<double> z;
  /// Pixels within `silhouette_px` of an edge of what the reference shows; left out of the figures below.
  std::vector<char> near_silhouette;
  /// Pixels whose difference is significant with the false-discovery rate held (Benjamini and Hochberg 1995).
  std::vector<char> significant;
  int judged_pixels = 0;
  int significant_pixels = 0;
  double z_rms = 0.0;
  /// What z_rms would be by chance: the standard deviation of Student's t with the reference's batches.
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
  /// Expected share of false alarms among the significant pixels, in (0, 1).
  double false_discovery_rate = 0.01;
};

/// Cost O(pixels log pixels).
PixelDiagnosis diagnose(const Comparison& comparison, const DiagnosisParams& params = {});

}  // namespace interglow::cross_check
