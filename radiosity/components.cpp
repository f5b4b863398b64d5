// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "diagnostics/error.h"
#include "radiosity/row_chunks.h"
#include "radiosity/solution.h"

namespace interglow::radiosity {
namespace {

void check(const RowMatrix& irradiance, const std::vector<spectral::Material>& materials,
           const std::vector<int>& element_material) {
  if (static_cast<Eigen::Index>(element_material.size()) != irradiance.rows()) {
    throw InvalidParams(fmt::format("irradiance: {} rows for {} elements; expected one row an element.",
                                    irradiance.rows(), element_material.size()));
  }
  for (const int material : element_material) {
    if (material >= static_cast<int>(materials.size())) {
      throw InvalidParams(fmt::format("element material {}; expected an index below {}.", material, materials.size()));
    }
  }
  for (const spectral::Material& material : materials) {
    if (material.donaldson.bands() != irradiance.cols()) {
      throw InvalidParams(fmt::format("material {}: {} bands for an irradiance of {} bands.", material.name,
                                      material.donaldson.bands(), irradiance.cols()));
    }
  }
}

/// D_L(λ, μ) = α(λ) β(μ) for λ > μ, 0 elsewhere: applied with running sums.
struct StokesRankOne {
  Eigen::VectorXd emission;
  Eigen::VectorXd excitation;
};

/// The factors if the matrix has that form to rounding.
std::optional<StokesRankOne> stokes_rank_one(const Eigen::MatrixXd& luminescence) {
  const Eigen::Index bands = luminescence.rows();
  Eigen::Index row = 0;
  Eigen::Index column = 0;
  const double largest = luminescence.cwiseAbs().maxCoeff(&row, &column);
  if (!(largest > 0.0) || row <= column) return std::nullopt;
  // A row reaches the excitations below it and a column the emissions above it, so the factors are read along a
  // staircase: the lowest row reaches most; where it is 0 nothing can be read and the matrix is taken as it is.
  Eigen::Index first_column = 0;
  while ((luminescence.col(first_column).array() == 0.0).all()) ++first_column;
  Eigen::Index last_row = bands - 1;
  while ((luminescence.row(last_row).array() == 0.0).all()) --last_row;
  const double corner = luminescence(last_row, first_column);
  if (corner == 0.0) return std::nullopt;
  StokesRankOne factors{luminescence.col(first_column), luminescence.row(last_row).transpose()};
  factors.excitation /= corner;
  for (Eigen::Index mu = 0; mu < bands; ++mu) {
    for (Eigen::Index lambda = 0; lambda < bands; ++lambda) {
      const double product = lambda > mu ? factors.emission[lambda] * factors.excitation[mu] : 0.0;
      // A few roundings: the entries were products themselves.
      if (std::abs(luminescence(lambda, mu) - product) > 1e-14 * std::abs(product)) return std::nullopt;
    }
  }
  return factors;
}

/// D_L ready for many irradiances: rank one where it is, else its rows and columns that are not 0.
class LuminescenceOperator {
 public:
  explicit LuminescenceOperator(const Eigen::MatrixXd& luminescence) : rank_one_(stokes_rank_one(luminescence)) {
    const auto lit_rows = (luminescence.array() != 0.0).rowwise().any().eval();
    const auto lit_columns = (luminescence.array() != 0.0).colwise().any().eval();
    for (Eigen::Index b = 0; b < luminescence.rows(); ++b) {
      if (lit_rows[b]) last_emission_ = b, first_emission_ = first_emission_ < 0 ? b : first_emission_;
      if (lit_columns[b]) last_excitation_ = b, first_excitation_ = first_excitation_ < 0 ? b : first_excitation_;
    }
    if (first_emission_ < 0 || rank_one_) return;
    transposed_ = luminescence.block(first_emission_, first_excitation_, emissions(), excitations()).transpose();
  }

  /// Rows of irradiance to rows of luminescence; `out` is zero.
  void apply(const RowMatrix& irradiance, RowMatrix& out) const {
    if (first_emission_ < 0) return;
    if (!rank_one_) {
      out.middleCols(first_emission_, emissions()).noalias() =
          irradiance.middleCols(first_excitation_, excitations()) * transposed_;
      return;
    }
    for (Eigen::Index r = 0; r < irradiance.rows(); ++r) {
      double excited = 0.0;
      Eigen::Index mu = first_excitation_;
      for (Eigen::Index lambda = first_emission_; lambda <= last_emission_; ++lambda) {
        for (; mu < lambda; ++mu) excited += rank_one_->excitation[mu] * irradiance(r, mu);
        out(r, lambda) = rank_one_->emission[lambda] * excited;
      }
    }
  }

 private:
  Eigen::Index emissions() const { return last_emission_ - first_emission_ + 1; }
  Eigen::Index excitations() const { return last_excitation_ - first_excitation_ + 1; }

  std::optional<StokesRankOne> rank_one_;
  RowMatrix transposed_;
  Eigen::Index first_emission_ = -1;
  Eigen::Index last_emission_ = -1;
  Eigen::Index first_excitation_ = -1;
  Eigen::Index last_excitation_ = -1;
};

}  // namespace

RowMatrix reflect(const RowMatrix& irradiance, const std::vector<spectral::Material>& materials,
                  const std::vector<int>& element_material) {
  check(irradiance, materials, element_material);
  RowMatrix result(irradiance.rows(), irradiance.cols());
  for_row_chunks(irradiance.rows(), [&](Eigen::Index first, Eigen::Index rows) {
    for (Eigen::Index i = first; i < first + rows; ++i) {
      const int material = element_material[static_cast<std::size_t>(i)];
      if (material < 0) {
        result.row(i).setZero();
      } else {
        const Eigen::VectorXd& reflectance = materials[static_cast<std::size_t>(material)].donaldson.reflectance;
        result.row(i) = irradiance.row(i).cwiseProduct(reflectance.transpose());
      }
    }
  });
  return result;
}

RowMatrix luminesce(const RowMatrix& irradiance, const std::vector<spectral::Material>& materials,
                    const std::vector<int>& element_material) {
  check(irradiance, materials, element_material);
  RowMatrix result = RowMatrix::Zero(irradiance.rows(), irradiance.cols());
  std::vector<std::vector<Eigen::Index>> elements(materials.size());
  for (std::size_t i = 0; i < element_material.size(); ++i) {
    if (element_material[i] >= 0)
      elements[static_cast<std::size_t>(element_material[i])].push_back(static_cast<Eigen::Index>(i));
  }
  for (std::size_t m = 0; m < materials.size(); ++m) {
    if (!materials[m].donaldson.luminesces() || elements[m].empty()) continue;
    const LuminescenceOperator luminescence(materials[m].donaldson.luminescence);
    for_row_chunks(static_cast<Eigen::Index>(elements[m].size()), [&](Eigen::Index first, Eigen::Index rows) {
      RowMatrix in(rows, irradiance.cols());
      RowMatrix out = RowMatrix::Zero(rows, irradiance.cols());
      for (Eigen::Index r = 0; r < rows; ++r)
        in.row(r) = irradiance.row(elements[m][static_cast<std::size_t>(first + r)]);
      luminescence.apply(in, out);
      for (Eigen::Index r = 0; r < rows; ++r) result.row(elements[m][static_cast<std::size_t>(first + r)]) = out.row(r);
    });
  }
  return result;
}

Components components(const Solution& solution, const std::vector<spectral::Material>& materials,
                      const std::vector<int>& element_material) {
  Components parts;
  parts.re = reflect(solution.direct, materials, element_material);
  parts.rr = reflect(solution.reflected, materials, element_material);
  parts.le = luminesce(solution.direct, materials, element_material);
  parts.lr = luminesce(solution.reflected, materials, element_material);
  if (solution.luminescent.size() > 0) {
    parts.ll = luminesce(solution.luminescent, materials, element_material);
    parts.rl = reflect(solution.luminescent, materials, element_material);
  } else {
    parts.ll = parts.rl = RowMatrix::Zero(solution.direct.rows(), solution.direct.cols());
  }
  return parts;
}

}  // namespace interglow::radiosity
