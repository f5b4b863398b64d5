// SPDX-License-Identifier: GPL-3.0-or-later
/// Wavelength bands: centres, edges and widths.
#pragma once

#include <Eigen/Core>

namespace interglow::spectral {

/// Bands in order of increasing wavelength. Neighbouring bands share an edge half-way between their centres;
/// the first and the last band are symmetric about their centre.
class WavelengthGrid {
 public:
  WavelengthGrid() = default;

  /// Bands centred at first, first + step, ..., last.
  /// @throws InvalidParams unless 0 < first <= last, step > 0 and (last - first) / step is whole to 1e-9.
  static WavelengthGrid uniform(double first_nm, double last_nm, double step_nm);

  /// @param centers_nm  strictly increasing, finite, positive; at least one.
  /// @throws InvalidParams naming the offending entry.
  static WavelengthGrid from_centers(const Eigen::VectorXd& centers_nm);

  Eigen::Index size() const { return centers_nm_.size(); }
  const Eigen::VectorXd& centers_nm() const { return centers_nm_; }
  const Eigen::VectorXd& widths_nm() const { return widths_nm_; }
  double center_nm(Eigen::Index band) const { return centers_nm_[band]; }
  double width_nm(Eigen::Index band) const { return widths_nm_[band]; }
  double lower_edge_nm(Eigen::Index band) const { return edges_nm_[band]; }
  double upper_edge_nm(Eigen::Index band) const { return edges_nm_[band + 1]; }

  bool operator==(const WavelengthGrid& other) const {
    return centers_nm_.size() == other.centers_nm_.size() && centers_nm_ == other.centers_nm_;
  }

 private:
  Eigen::VectorXd centers_nm_;
  Eigen::VectorXd edges_nm_;  ///< size() + 1
  Eigen::VectorXd widths_nm_;
};

}  // namespace interglow::spectral
