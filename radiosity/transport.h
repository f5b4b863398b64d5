// SPDX-License-Identifier: GPL-3.0-or-later
/// The form factors of a whole scene as an operator: computed once per geometry, applied to every light and bounce.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "diagnostics/progress.h"
#include "radiosity/elements.h"

namespace interglow::radiosity {

/// One row per element, one column per spectral channel: row-major, so that a product walks memory forwards.
using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

struct TransportParams {
  /// Wanted error of a row of form factors: of the sum of one element's factors, and of any part of it. Smaller costs
  /// more quadrature points and visibility tests. In [1e-12, 0.1].
  double tolerance = 1e-4;
  /// Whether objects hide one another. Off only for scenes known to be convex cavities: it saves the search for
  /// blockers.
  bool occlusion = true;
  /// Least-squares correction of the factors of a closed scene towards row sums of 1, keeping reciprocity. Off: raw
  /// values.
  bool smooth_closure = false;
  /// Whether black sides (backs of one-sided sheets) take part. They matter for row sums alone, and so for how much of
  /// the sky is seen; without a sky, light that ends on them may as well count as escaped, which saves their pairs.
  bool black_sides = true;
};

void validate(const TransportParams& params);

/// What assembly measured.
struct TransportReport {
  std::int64_t elements = 0;
  std::int64_t pairs = 0;         ///< N (N - 1) / 2
  std::int64_t facing_pairs = 0;  ///< pairs that face one another at least in part
  std::int64_t stored_pairs = 0;  ///< pairs with a factor above 0
  std::int64_t partially_visible_pairs = 0;
  std::int64_t blocked_pairs = 0;                 ///< provably hidden, alone or with their clusters
  std::array<std::int64_t, 8> pairs_by_method{};  ///< indexed by FormFactorMethod
  double max_row_sum = 0.0;
  double closure_max = 0.0;  ///< max_i |Σ_j F_ij - 1|; meaningful for closed scenes only
  double closure_rms = 0.0;
  /// Largest row error estimate. A row's estimate is the sum of the error bounds of its factors, whose signs may agree,
  /// and, where lines tell what is visible, so many standard deviations of them that no row of the scene exceeds its
  /// own with a probability of 99 %.
  double error_estimate_max = 0.0;
  double error_estimate_rms = 0.0;    ///< of the row error estimates, weighted with the areas; without black sides
  double smoothing_change_max = 0.0;  ///< largest change of a form factor by closure smoothing
  double seconds_search = 0.0;        ///< culling and blocker search
  double seconds_factors = 0.0;
  std::size_t bytes = 0;
};

/// Symmetric exchange areas A_i F_ij in sparse storage; memory grows with the interacting pairs.
class Transport {
 public:
  /// Cost: culling O(N log N) + one form factor per facing pair. Same bits for any number of threads.
  static Transport build(const Elements& elements, const TransportParams& params, const Progress& progress = {});

  /// From a given matrix of form factors (closed-form test cases).
  /// @throws InvalidParams unless square, finite, in [0, 1] and A_i F_ij = A_j F_ji to 1e-10 of the larger.
  static Transport from_form_factors(const Eigen::MatrixXd& form_factors, const Eigen::VectorXd& area_mm2);

  Eigen::Index size() const;

  /// Areas of the elements [mm²]; A_i F_ij is symmetric.
  const Eigen::VectorXd& area_mm2() const;

  /// Y = F X, all channels at once: H = F B. Cost O(stored pairs × columns); same bits for any number of threads.
  RowMatrix apply(const RowMatrix& x) const;

  /// Σ_j F_ij.
  Eigen::VectorXd row_sums() const;

  /// F_ij; 0 if nothing is stored.
  double form_factor(Eigen::Index i, Eigen::Index j) const;

  /// The factors of row i that are not 0, in increasing order of the columns. Cost O(those).
  void row(Eigen::Index i, std::vector<int>& columns, std::vector<double>& factors) const;

  const TransportReport& report() const;

  ~Transport();
  Transport(Transport&&) noexcept;
  Transport& operator=(Transport&&) noexcept;

 private:
  struct Impl;
  explicit Transport(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace interglow::radiosity
