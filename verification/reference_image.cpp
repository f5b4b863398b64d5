// SPDX-License-Identifier: GPL-3.0-or-later
#include "verification/reference_image.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "cross_check/agreement.h"
#include "diagnostics/error.h"
#include "image/spectral_exr.h"
#include "spectral/observer.h"
#include "spectral/wavelength_grid.h"

namespace interglow::verification {
namespace {

using image::SpectralImage;

/// Mean over blocks of factor × factor pixels; of squares, and the root of it over the block's side, for errors.
SpectralImage block_means(const SpectralImage& image, int factor, bool errors) {
  SpectralImage small;
  small.width = image.width / factor;
  small.height = image.height / factor;
  small.wavelength_nm = image.wavelength_nm;
  const auto bands = static_cast<std::size_t>(image.bands());
  small.value.resize(static_cast<std::size_t>(small.width) * static_cast<std::size_t>(small.height) * bands);
  const double count = static_cast<double>(factor) * factor;
  for (int row = 0; row < small.height; ++row) {
    for (int column = 0; column < small.width; ++column) {
      for (std::size_t b = 0; b < bands; ++b) {
        double sum = 0.0;
        for (int r = row * factor; r < (row + 1) * factor; ++r) {
          for (int c = column * factor; c < (column + 1) * factor; ++c) {
            const auto value = static_cast<double>(image.pixel(r, c)[b]);
            sum += errors ? value * value : value;
          }
        }
        small.pixel(row, column)[b] = static_cast<float>(errors ? std::sqrt(sum) / count : sum / count);
      }
    }
  }
  return small;
}

int block_side(const SpectralImage& image, std::optional<int> largest_side_px, const std::filesystem::path& path) {
  if (!largest_side_px) return 1;
  const int factor = (std::max(image.width, image.height) + *largest_side_px - 1) / *largest_side_px;
  if (image.width % factor != 0 || image.height % factor != 0) {
    throw InvalidInput(
        fmt::format("{}: {} x {} pixels cannot be averaged over blocks of {} x {} to have at most {} a side; choose "
                    "a size that divides it, or none.",
                    path.string(), image.width, image.height, factor, factor, *largest_side_px));
  }
  return factor;
}

}  // namespace

ReferenceImage read_reference(const std::filesystem::path& mean, const std::filesystem::path& standard_error,
                              std::optional<int> largest_side_px) {
  ReferenceImage reference;
  reference.mean = image::read_spectral_exr(mean).image;
  reference.grey = reference.mean.bands() == 1;
  const int factor = block_side(reference.mean, largest_side_px, mean);
  if (!standard_error.empty()) {
    SpectralImage error = image::read_spectral_exr(standard_error).image;
    if (error.width != reference.mean.width || error.height != reference.mean.height ||
        error.bands() != reference.mean.bands()) {
      throw InvalidInput(fmt::format("{}: {} x {} with {} bands, but {} has {} x {} with {}; they must be the same.",
                                     standard_error.string(), error.width, error.height, error.bands(), mean.string(),
                                     reference.mean.width, reference.mean.height, reference.mean.bands()));
    }
    reference.standard_error = block_means(error, factor, true);
  }
  if (factor > 1) reference.mean = block_means(reference.mean, factor, false);
  return reference;
}

Eigen::MatrixXd band_conversion(const ReferenceImage& reference, const Eigen::VectorXd& wavelength_nm) {
  const Eigen::Index bands = wavelength_nm.size();
  if (bands == 1 && reference.grey) return Eigen::MatrixXd::Ones(1, 1);
  if (reference.grey) {
    const auto grid = spectral::WavelengthGrid::from_centers(wavelength_nm);
    const Eigen::VectorXd y = spectral::cie1931_weights(grid).col(1);
    return y.transpose() / y.sum();
  }
  Eigen::MatrixXd conversion = Eigen::MatrixXd::Zero(reference.mean.bands(), bands);
  for (Eigen::Index k = 0; k < conversion.rows(); ++k) {
    const double wanted = reference.mean.wavelength_nm[k];
    constexpr double kRounding_nm = 0.01;  // channel names carry a few digits
    if (wanted < wavelength_nm[0] - kRounding_nm || wanted > wavelength_nm[bands - 1] + kRounding_nm) {
      throw InvalidInput(
          fmt::format("reference image: band {:g} nm lies outside the camera's {:g} to {:g} nm. Widen "
                      "camera.first_nm and camera.last_nm of the scene.",
                      wanted, wavelength_nm[0], wavelength_nm[bands - 1]));
    }
    Eigen::Index right = 1;
    while (right < bands - 1 && wavelength_nm[right] < wanted) ++right;
    if (bands == 1) {
      conversion(k, 0) = 1.0;
      continue;
    }
    const double t =
        std::clamp((wanted - wavelength_nm[right - 1]) / (wavelength_nm[right] - wavelength_nm[right - 1]), 0.0, 1.0);
    conversion(k, right - 1) = 1.0 - t;
    conversion(k, right) = t;
  }
  return conversion;
}

SpectralImage convert_bands(const SpectralImage& image, const Eigen::MatrixXd& conversion,
                            const Eigen::VectorXd& wavelength_nm) {
  SpectralImage converted{image.width, image.height, wavelength_nm, {}};
  const Eigen::Index pixels = Eigen::Index{image.width} * image.height;
  converted.value.resize(static_cast<std::size_t>(pixels * conversion.rows()));
  using Rows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Eigen::Map<const Rows> from(image.value.data(), pixels, image.bands());
  Eigen::Map<Rows>(converted.value.data(), pixels, conversion.rows()) =
      (from.cast<double>() * conversion.transpose()).cast<float>();
  return converted;
}

cross_check::Estimate convert_bands(const cross_check::Estimate& estimate, const Eigen::MatrixXd& conversion,
                                    const Eigen::VectorXd& wavelength_nm, const Eigen::VectorXd& band_width_nm) {
  return cross_check::estimate_from_images(convert_bands(estimate.mean, conversion, wavelength_nm),
                                           convert_bands(estimate.standard_error, conversion, wavelength_nm),
                                           band_width_nm);
}

}  // namespace interglow::verification
