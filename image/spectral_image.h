// SPDX-License-Identifier: GPL-3.0-or-later
/// A picture with a spectrum in every pixel.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <vector>

namespace interglow::image {

/// Radiance [W m^-2 sr^-1 nm^-1] per pixel and band; row 0 is the top. Values of one pixel are adjacent.
struct SpectralImage {
  int width = 0;
  int height = 0;
  Eigen::VectorXd wavelength_nm;  ///< band centres, increasing
  std::vector<float> value;       ///< height × width × bands

  int bands() const { return static_cast<int>(wavelength_nm.size()); }
  std::size_t offset(int row, int column) const {
    return (static_cast<std::size_t>(row) * static_cast<std::size_t>(width) + static_cast<std::size_t>(column)) *
           static_cast<std::size_t>(bands());
  }
  const float* pixel(int row, int column) const { return value.data() + offset(row, column); }
  float* pixel(int row, int column) { return value.data() + offset(row, column); }
};

}  // namespace interglow::image
