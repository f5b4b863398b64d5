// SPDX-License-Identifier: GPL-3.0-or-later
/// The bispectral radiosity system and its solution, split by the history of the light.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "diagnostics/progress.h"
#include "radiosity/direct_light.h"
#include "radiosity/elements.h"
#include "radiosity/transport.h"
#include "spectral/donaldson_matrix.h"

namespace interglow::radiosity {

struct SolveParams {
  /// Number of indirect bounces; empty: all of them. 0 is direct light only.
  std::optional<int> bounces{};
  /// Relative residual of every band at which the infinite-bounce iteration stops, in [1e-15, 1e-2]. Where rounding is
  /// larger (nearly closed scenes with reflectances near 1) it stops at rounding.
  double tolerance = 1e-10;
  /// Most iterations (products with F) before the solve reports that it did not converge.
  int max_iterations = 10000;
};

void validate(const SolveParams& params);

/// B = M + S H + D_L H with H = E⁰ + H_R + H_L (DESIGN: H_R has only been reflected on its way, H_L was re-emitted at
/// least once). All fields elements x bands [W m^-2 nm^-1].
struct Solution {
  RowMatrix direct;       ///< E⁰, direct irradiance
  RowMatrix reflected;    ///< H_R
  RowMatrix luminescent;  ///< H_L; 0 x 0 if nothing luminesces
  /// The light that arrives last: sources such that a gather F_x · last_reflected_source = H_R(x) at any point x
  /// (for n bounces: the radiosity after n - 1), and the same for H_L. 0 x 0 with 0 bounces.
  RowMatrix reflected_source;
  RowMatrix luminescent_source;
  std::optional<int> bounces{};  ///< as asked for; empty: all
  int iterations = 0;            ///< products with F, each of a block of columns
  std::int64_t columns = 0;      ///< columns multiplied by F in all
  double relative_residual =
      0.0;  ///< largest over the bands: |D (E⁰ + F X) - X| / |D E⁰|, X the sources, area-weighted
  bool converged = true;
};

/// Solves H = E⁰ + F (S H + D_L H).
///
/// F does not depend on wavelength, so all bands and both histories share one space of sources: orthonormal vectors
/// u_j, each on the elements of one material, multiplied by F once. Infinite: Galerkin's solution in the space for
/// every band (optimal in the energy norm, at least as good as conjugate gradients on each band), where luminescence is
/// swept through the bands from short to long; the space grows by the directions in which the residual of the worst
/// bands points, until every band meets the tolerance. n bounces: n products with the space that holds the sources to
/// rounding. A grey scene under one lamp costs one column a product, whatever the number of bands; a band without light
/// costs nothing.
///
/// @param direct  E⁰, elements x bands
/// @throws InvalidParams    if sizes or indices disagree or a value is not finite
/// @throws NumericalFailure if the system is singular (a closed scene with reflectance 1), to rounding or to within the
///         error of the form factors, or if luminescence excites itself without end
/// Cost O(columns × pairs + elements × columns²). Same bits for any number of threads.
Solution solve(const Transport& transport, const std::vector<spectral::Material>& materials,
               const std::vector<int>& element_material, const RowMatrix& direct, const SolveParams& params,
               const Progress& progress = {});

/// Radiosity of one component: value × irradiance of its kind, elements x bands.
struct Components {
  RowMatrix re;  ///< (1) S E⁰, diffuse reflection of direct light
  RowMatrix rr;  ///< (2) S H_R, interreflection
  RowMatrix le;  ///< (3) D_L E⁰, luminescence excited by direct light
  RowMatrix lr;  ///< (4a) D_L H_R
  RowMatrix ll;  ///< (4b) D_L H_L; li = lr + ll
  RowMatrix rl;  ///< (5) S H_L, interreflection of fluorescent light
};

Components components(const Solution& solution, const std::vector<spectral::Material>& materials,
                      const std::vector<int>& element_material);

/// S ∘ H, row i with the reflectance of element i's material (black: 0).
RowMatrix reflect(const RowMatrix& irradiance, const std::vector<spectral::Material>& materials,
                  const std::vector<int>& element_material);
/// D_L H, row-wise.
RowMatrix luminesce(const RowMatrix& irradiance, const std::vector<spectral::Material>& materials,
                    const std::vector<int>& element_material);

/// Flux in = absorbed + escaped + Stokes loss, over all bands and elements [W, areas in m²], for the computed system.
struct EnergyBalance {
  double received = 0.0;  ///< Σ A_i E⁰_i Δλ of sources outside + emitted exitance
  double absorbed = 0.0;  ///< turned to heat by absorption without re-emission
  double stokes_loss =
      0.0;               ///< excitation that was re-emitted with less energy: absorbed minus emitted by luminescence
  double escaped = 0.0;  ///< leaves the scene: Σ A_i B_i (1 - Σ_j F_ij)
  double last_bounce = 0.0;  ///< still under way when the bounces end (0 for infinitely many)
  double relative_error = 0.0;
};

EnergyBalance energy_balance(const scene::Scene& scene, const Elements& elements, const Transport& transport,
                             const Solution& solution);

}  // namespace interglow::radiosity
