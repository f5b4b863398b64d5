// SPDX-License-Identifier: GPL-3.0-or-later
/// The light between elements on a few spectral modes, for one light after another on the same geometry.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "fitting/spectral_reduction.h"
#include "radiosity/elements.h"
#include "radiosity/transport.h"

namespace interglow::fitting {

/// Solves B = E + S F B by conjugate residuals on two grids. Each round multiplies once with the form factors of all
/// elements; what then is missing is solved between cells of some 16 elements, whose form factors are summed up once.
/// Light that comes from the others varies little within a cell, so that a round leaves a few hundredths of the error,
/// where one more bounce would leave a third.
class IndirectSolve {
 public:
  /// Keeps references to all. Cost O(pairs that exchange light).
  IndirectSolve(const radiosity::Elements& elements, const radiosity::Transport& transport,
                const SpectralReduction& spectra);

  /// What the elements send out, for several sources at once, in blocks of `modes` columns.
  /// @param first   E, elements x (sources × modes); 0 where an element is black
  /// @param reflection  of each material: what leaves it per unit of each mode that arrives, modes x modes
  /// @param bounces of the light that the result sends on, at least 1: the sum of that many terms; empty: all
  /// @param tolerance  largest value that B lacks to fulfil its equation, relative to the largest of E, for each source
  /// @throws NumericalFailure if it does not settle
  radiosity::RowMatrix radiosity(const radiosity::RowMatrix& first, const std::vector<Eigen::MatrixXd>& reflection,
                                 std::optional<int> bounces, double tolerance) const;

  Eigen::Index cells() const { return between_cells_.rows(); }

 private:
  radiosity::RowMatrix reflected(const radiosity::RowMatrix& arriving, const std::vector<int>& material,
                                 const std::vector<Eigen::MatrixXd>& reflection) const;
  /// T (1 - T)⁻¹ of what cells send out, T = S F between cells.
  radiosity::RowMatrix later_between_cells(const radiosity::RowMatrix& sent,
                                           const std::vector<Eigen::MatrixXd>& reflection) const;

  const radiosity::Elements& elements_;
  const radiosity::Transport& transport_;
  const SpectralReduction& spectra_;
  std::vector<int> cell_;           ///< of each element; -1: black
  std::vector<double> share_;       ///< of each element in its cell's area
  std::vector<int> cell_material_;  ///< of each cell
  Eigen::MatrixXd between_cells_;   ///< form factors
};

}  // namespace interglow::fitting
