// SPDX-License-Identifier: GPL-3.0-or-later
/// The space in which the solver looks for the sources of all bands at once.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "radiosity/transport.h"

namespace interglow::radiosity {

/// Sources on the elements of one material, scaled by √area, in an orthonormal basis whose first `selected` vectors may
/// carry light; the others, the candidates, are where light arrives that the selected ones cannot send on.
struct MaterialSpace {
  int material = 0;
  std::vector<Eigen::Index> element;
  Eigen::MatrixXd basis;  ///< elements of the material x vectors, orthonormal columns
  Eigen::Index selected = 0;
  std::vector<Eigen::Index> source;  ///< number of each selected vector among the selected vectors of all materials
  Eigen::MatrixXd arriving;          ///< vectors x sources: column j is F̂ u_j on these elements, in the basis
  Eigen::MatrixXd input;             ///< vectors x input columns: the given light in the basis

  Eigen::Index vectors() const { return basis.cols(); }
  Eigen::Index candidates() const { return basis.cols() - selected; }
};

/// F̂ = √A F / √A is symmetric. Each selected vector u_j is multiplied by F̂ once; the irradiance it gives is kept for
/// all elements and expanded in the bases of the materials.
class SourceSpace {
 public:
  /// @param active  one flag a material: whether it sends light on; elements of other materials only receive
  SourceSpace(const Transport& transport, const std::vector<int>& element_material, const std::vector<char>& active);

  /// Forgets all vectors and expands new input (elements x columns, not scaled). @param tolerance relative to each
  /// column
  void start(const RowMatrix& input, double tolerance);

  /// Takes into the selected vectors, per material, the directions that dominate the columns of `missing`
  /// (candidates x columns, one matrix a material), as far as they exceed the threshold, and multiplies them by F.
  /// @returns number of new sources; 0 if nothing exceeds it
  Eigen::Index grow(const std::vector<Eigen::MatrixXd>& missing, double threshold, double relative_threshold);

  const std::vector<MaterialSpace>& materials() const { return materials_; }
  Eigen::Index sources() const { return arrivals_.cols(); }
  std::int64_t columns_multiplied() const { return columns_multiplied_; }

  /// Symmetric: u_iᵀ F̂ u_j.
  const Eigen::MatrixXd& exchange() const { return exchange_; }

  /// target += Σ_j u_j y_jᵀ / √A, elements x bands.
  void add_sources(const Eigen::MatrixXd& y, RowMatrix& target) const;
  /// target += F of the same.
  void add_arrivals(const Eigen::MatrixXd& y, RowMatrix& target) const;

 private:
  void expand_arrivals(Eigen::Index first);

  const Transport& transport_;
  Eigen::VectorXd sqrt_area_;
  std::vector<MaterialSpace> materials_;
  Eigen::MatrixXd arrivals_;  ///< elements x sources: irradiance F u_j / √A, not scaled
  Eigen::MatrixXd exchange_;
  std::int64_t columns_multiplied_ = 0;
};

}  // namespace interglow::radiosity
