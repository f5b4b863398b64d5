// SPDX-License-Identifier: GPL-3.0-or-later
#include "cli/registration_report.h"

#include <fmt/format.h>

#include <cstdio>
#include <nlohmann/json.hpp>

#include "diagnostics/error.h"

namespace interglow::cli {

void print_registration(const fitting::AffineRegistration& found) {
  const Eigen::Matrix2d& a = found.moving_from_fixed.linear;
  const Eigen::Vector2d& t = found.moving_from_fixed.shift;
  fmt::print("{:<18} x' = {:.6f} x {:+.6f} y {:+.4f}, y' = {:.6f} x {:+.6f} y {:+.4f}\n", "registered", a(0, 0),
             a(0, 1), t.x(), a(1, 0), a(1, 1), t.y());
  fmt::print("{:<18} ±{:.2g} px at the corners (statistical), correlation {:.6f} over {:.1f} % of the reference\n", "",
             found.corner_sd_px, found.correlation, 100.0 * found.overlap_share);
  fmt::print("{:<18} reference = {:.6g} × image {:+.4g} (reported, not applied)\n", "", found.gain, found.offset);
}

nlohmann::json registration_json(const fitting::AffineRegistration& found) {
  const Eigen::Matrix2d& a = found.moving_from_fixed.linear;
  const Eigen::Vector2d& t = found.moving_from_fixed.shift;
  nlohmann::json covariance = nlohmann::json::array();
  for (Eigen::Index row = 0; row < 6; ++row) {
    const Eigen::Matrix<double, 1, 6> values = found.covariance.row(row);
    covariance.push_back(std::vector<double>(values.begin(), values.end()));
  }
  return {{"image_from_reference", {{a(0, 0), a(0, 1), t.x()}, {a(1, 0), a(1, 1), t.y()}}},
          {"covariance_at_middle", covariance},
          {"corner_sd_px", found.corner_sd_px},
          {"gain", found.gain},
          {"offset", found.offset},
          {"residual_sd", found.residual_sd},
          {"correlation", found.correlation},
          {"overlap_share", found.overlap_share},
          {"iterations", found.iterations},
          {"converged", found.converged}};
}

RegisteredImage register_on(const image::SpectralImage& image, const image::SpectralImage& reference,
                            const fitting::AffineParams& params) {
  RegisteredImage result;
  result.found = fitting::register_affine(fitting::mean_over_bands(reference), fitting::mean_over_bands(image), params);
  if (!result.found.converged) {
    throw NumericalFailure(
        fmt::format("the registration did not converge in {} steps (correlation {:.4f}). Check that both images show "
                    "the same scene.",
                    result.found.iterations, result.found.correlation));
  }
  result.warped =
      fitting::warp(image, result.found.moving_from_fixed, reference.width, reference.height, params.spline_order);
  return result;
}

}  // namespace interglow::cli
