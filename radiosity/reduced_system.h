// SPDX-License-Identifier: GPL-3.0-or-later
/// The radiosity system projected on the selected sources: as small as their number, for all bands.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "radiosity/source_space.h"
#include "spectral/donaldson_matrix.h"

namespace interglow::radiosity {

/// Amplitudes of the sources, sources x bands. Reflected: y = S (e + T y). Luminescent: y = D_L (e + T (y_R + y)) + S T
/// y + given.
struct Amplitudes {
  Eigen::MatrixXd reflected;
  Eigen::MatrixXd luminescent;  ///< 0 columns if nothing luminesces
};

/// Solves for all bands, keeping the Cholesky factors of I - √S T √S (T = exchange) as the space grows. Bands in which
/// all materials reflect alike share one factor.
class ReducedSystem {
 public:
  /// @param materials  those of the space, in its order
  ReducedSystem(const SourceSpace& space, std::vector<const spectral::DonaldsonMatrix*> materials);

  /// Extends the factors to all sources of the space and solves.
  ///
  /// @param reflected_input, luminescent_input  given sources, sources x bands
  /// @param tolerance  relative change at which sweeps over bands coupled both ways end
  /// @param amplitudes  in: earlier solution, where sweeps start; out: the solution
  /// @throws NumericalFailure if the system is singular or luminescence excites itself without end
  void solve(const Eigen::MatrixXd& reflected_input, const Eigen::MatrixXd& luminescent_input, double tolerance,
             Amplitudes& amplitudes);

  bool luminesces() const { return luminesces_; }
  /// Number of different sets of reflectances.
  Eigen::Index distinct_bands() const { return static_cast<Eigen::Index>(factors_.size()); }
  /// Forgets the factors.
  void restart();

 private:
  struct Factor {
    Eigen::VectorXd reflectance;  ///< one value a material of the space
    Eigen::Index first_band = 0;
    Eigen::MatrixXd lower;
  };

  void extend_factor(Factor& factor) const;
  Eigen::VectorXd per_source(const Eigen::VectorXd& per_material) const;
  /// y = c + S T y, one factor, all columns of c.
  Eigen::MatrixXd scatter(const Factor& factor, const Eigen::MatrixXd& c) const;
  void sweep_luminescence(const Eigen::MatrixXd& input, double tolerance, Amplitudes& amplitudes) const;

  const SourceSpace& space_;
  std::vector<const spectral::DonaldsonMatrix*> materials_;
  std::vector<Factor> factors_;
  std::vector<std::size_t> factor_of_band_;
  bool luminesces_ = false;
  bool stokes_only_ = true;
};

}  // namespace interglow::radiosity
