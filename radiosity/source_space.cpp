// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/source_space.h"

#include <Eigen/QR>

#include <cmath>

#include "radiosity/row_chunks.h"

namespace interglow::radiosity {
namespace {

/// What is left of a vector after projection is noise below this share of it: rounding of products with F and of the
/// projections, each about 1e-16.
constexpr double kNoise = 1e-14;

Eigen::MatrixXd product_of_transposed(const Eigen::MatrixXd& a, Eigen::Index columns, const Eigen::MatrixXd& b) {
  return sum_over_row_chunks(a.rows(), columns, b.cols(),
                             [&](Eigen::Index first, Eigen::Index rows) -> Eigen::MatrixXd {
                               return a.block(first, 0, rows, columns).transpose() * b.middleRows(first, rows);
                             });
}

void subtract_product(const Eigen::MatrixXd& a, Eigen::Index columns, const Eigen::MatrixXd& coefficients,
                      Eigen::MatrixXd& b) {
  for_row_chunks(a.rows(), [&](Eigen::Index first, Eigen::Index rows) {
    b.middleRows(first, rows).noalias() -= a.block(first, 0, rows, columns) * coefficients;
  });
}

Eigen::VectorXd column_norms(const Eigen::MatrixXd& columns) {
  return sum_over_row_chunks(columns.rows(), columns.cols(), 1,
                             [&](Eigen::Index first, Eigen::Index rows) -> Eigen::MatrixXd {
                               return columns.middleRows(first, rows).colwise().squaredNorm().transpose();
                             })
      .cwiseSqrt();
}

/// Extends the orthonormal basis by what `columns` have outside it, strongest first, until every column is represented
/// to `tolerance` (one absolute value a column). @returns coefficients of the columns in the extended basis.
Eigen::MatrixXd extend_basis(Eigen::MatrixXd& basis, Eigen::MatrixXd columns, const Eigen::VectorXd& tolerance) {
  const Eigen::Index old = basis.cols();
  Eigen::MatrixXd coefficients = Eigen::MatrixXd::Zero(old, columns.cols());
  for (int pass = 0; pass < 2 && old > 0; ++pass) {  // twice is enough for orthogonality to rounding
    const Eigen::MatrixXd part = product_of_transposed(basis, old, columns);
    subtract_product(basis, old, part, columns);
    coefficients += part;
  }
  Eigen::VectorXd norm = column_norms(columns);
  const Eigen::Index most = std::min(columns.cols(), columns.rows() - old);
  for (Eigen::Index step = 0; step < most; ++step) {
    // Excess of each column over its tolerance; a tolerance of 0 marks a column of zeros.
    Eigen::Index worst = -1;
    double excess = 1.0;
    for (Eigen::Index c = 0; c < columns.cols(); ++c) {
      if (norm[c] > 0.0 && norm[c] > tolerance[c] * excess) {
        worst = c;
        excess = tolerance[c] > 0.0 ? norm[c] / tolerance[c] : excess;
      }
    }
    if (worst < 0) break;
    const Eigen::Index count = basis.cols();
    Eigen::MatrixXd vector = columns.col(worst) / norm[worst];
    subtract_product(basis, count, product_of_transposed(basis, count, vector), vector);
    const double length = column_norms(vector)[0];
    if (length < 0.5) {  // what was left of it was rounding
      norm[worst] = 0.0;
      continue;
    }
    vector /= length;
    basis.conservativeResize(Eigen::NoChange, count + 1);
    basis.col(count) = vector;
    const Eigen::MatrixXd row = product_of_transposed(vector, 1, columns);
    subtract_product(vector, 1, row, columns);
    coefficients.conservativeResize(coefficients.rows() + 1, Eigen::NoChange);
    coefficients.bottomRows(1) = row;
    norm = column_norms(columns);
  }
  return coefficients;
}

void append_zero_rows(Eigen::MatrixXd& matrix, Eigen::Index rows) {
  const Eigen::Index old = matrix.rows();
  if (rows <= old) return;
  matrix.conservativeResize(rows, Eigen::NoChange);
  matrix.bottomRows(rows - old).setZero();
}

}  // namespace

SourceSpace::SourceSpace(const Transport& transport, const std::vector<int>& element_material,
                         const std::vector<char>& active)
    : transport_(transport), sqrt_area_(transport.area_mm2().cwiseSqrt()) {
  std::vector<int> space_of(active.size(), -1);
  for (std::size_t i = 0; i < element_material.size(); ++i) {
    const int material = element_material[i];
    if (material < 0 || active[static_cast<std::size_t>(material)] == 0) continue;
    int& space = space_of[static_cast<std::size_t>(material)];
    if (space < 0) {
      space = static_cast<int>(materials_.size());
      materials_.emplace_back().material = material;
    }
    materials_[static_cast<std::size_t>(space)].element.push_back(static_cast<Eigen::Index>(i));
  }
}

void SourceSpace::start(const RowMatrix& input, double tolerance) {
  arrivals_.resize(transport_.size(), 0);
  exchange_.resize(0, 0);
  for (MaterialSpace& space : materials_) {
    const auto rows = static_cast<Eigen::Index>(space.element.size());
    Eigen::MatrixXd columns(rows, input.cols());
    for (Eigen::Index r = 0; r < rows; ++r) {
      const Eigen::Index e = space.element[static_cast<std::size_t>(r)];
      columns.row(r) = sqrt_area_[e] * input.row(e);
    }
    space.basis.resize(rows, 0);
    space.selected = 0;
    space.source.clear();
    const Eigen::VectorXd allowed = tolerance * column_norms(columns);
    space.input = extend_basis(space.basis, std::move(columns), allowed);
    space.arriving.resize(space.basis.cols(), 0);
  }
}

Eigen::Index SourceSpace::grow(const std::vector<Eigen::MatrixXd>& missing, double threshold,
                               double relative_threshold) {
  std::vector<Eigen::ColPivHouseholderQR<Eigen::MatrixXd>> factors(materials_.size());
  double largest = 0.0;
  for (std::size_t m = 0; m < materials_.size(); ++m) {
    if (missing[m].size() == 0) continue;
    factors[m].compute(missing[m]);
    largest = std::max(largest, std::abs(factors[m].matrixQR()(0, 0)));
  }
  threshold = std::max(threshold, relative_threshold * largest);

  const Eigen::Index first = sources();
  Eigen::Index count = first;
  for (std::size_t m = 0; m < materials_.size(); ++m) {
    MaterialSpace& space = materials_[m];
    if (missing[m].size() == 0) continue;
    const auto& diagonal = factors[m].matrixQR().diagonal();
    Eigen::Index taken = 0;
    while (taken < diagonal.size() && std::abs(diagonal[taken]) > threshold) ++taken;
    if (taken == 0) continue;
    // Turn the candidates so that the first ones span the missing columns; the reflectors of the others do nothing.
    auto turn = factors[m].householderQ();
    turn.setLength(taken);
    const Eigen::Index candidates = space.candidates();
    for_row_chunks(space.basis.rows(), [&](Eigen::Index row, Eigen::Index rows) {
      Eigen::MatrixXd block = space.basis.block(row, space.selected, rows, candidates);
      block.applyOnTheRight(turn);
      space.basis.block(row, space.selected, rows, candidates) = block;
    });
    const auto turn_rows = [&](Eigen::MatrixXd& matrix) {
      Eigen::MatrixXd block = matrix.bottomRows(candidates);
      block.applyOnTheLeft(turn.adjoint());
      matrix.bottomRows(candidates) = block;
    };
    turn_rows(space.input);
    turn_rows(space.arriving);
    for (Eigen::Index t = 0; t < taken; ++t) space.source.push_back(count++);
    space.selected += taken;
  }
  if (count > first) {
    arrivals_.conservativeResize(Eigen::NoChange, count);
    expand_arrivals(first);
  }
  return count - first;
}

void SourceSpace::expand_arrivals(Eigen::Index first) {
  const Eigen::Index added = arrivals_.cols() - first;
  RowMatrix sent = RowMatrix::Zero(transport_.size(), added);
  for (const MaterialSpace& space : materials_) {
    for (Eigen::Index s = 0; s < space.selected; ++s) {
      const Eigen::Index j = space.source[static_cast<std::size_t>(s)] - first;
      if (j < 0) continue;
      for (std::size_t r = 0; r < space.element.size(); ++r) {
        const Eigen::Index e = space.element[r];
        sent(e, j) = space.basis(static_cast<Eigen::Index>(r), s) / sqrt_area_[e];
      }
    }
  }
  const RowMatrix received = transport_.apply(sent);
  columns_multiplied_ += added;
  arrivals_.rightCols(added) = received;

  Eigen::VectorXd noise = kNoise * column_norms(sqrt_area_.asDiagonal() * received);
  for (MaterialSpace& space : materials_) {
    const auto rows = static_cast<Eigen::Index>(space.element.size());
    Eigen::MatrixXd columns(rows, added);
    for (Eigen::Index r = 0; r < rows; ++r) {
      const Eigen::Index e = space.element[static_cast<std::size_t>(r)];
      columns.row(r) = sqrt_area_[e] * received.row(e);
    }
    const Eigen::MatrixXd coefficients = extend_basis(space.basis, std::move(columns), noise);
    append_zero_rows(space.input, space.basis.cols());
    append_zero_rows(space.arriving, space.basis.cols());
    space.arriving.conservativeResize(Eigen::NoChange, first + added);
    space.arriving.rightCols(added) = coefficients;
  }

  exchange_.conservativeResize(first + added, first + added);
  for (const MaterialSpace& space : materials_) {
    for (Eigen::Index s = 0; s < space.selected; ++s) {
      const Eigen::Index i = space.source[static_cast<std::size_t>(s)];
      // New rows whole, old rows only their new columns; symmetric from the part below the diagonal.
      for (Eigen::Index j = 0; j <= i; ++j) {
        if (i < first) continue;
        exchange_(i, j) = space.arriving(s, j);
        exchange_(j, i) = exchange_(i, j);
      }
    }
  }
}

void SourceSpace::add_sources(const Eigen::MatrixXd& y, RowMatrix& target) const {
  for (const MaterialSpace& space : materials_) {
    if (space.selected == 0) continue;
    Eigen::MatrixXd rows_of_y(space.selected, y.cols());
    for (Eigen::Index s = 0; s < space.selected; ++s)
      rows_of_y.row(s) = y.row(space.source[static_cast<std::size_t>(s)]);
    for_row_chunks(space.basis.rows(), [&](Eigen::Index first, Eigen::Index rows) {
      const RowMatrix part = space.basis.block(first, 0, rows, space.selected) * rows_of_y;
      for (Eigen::Index r = 0; r < rows; ++r) {
        const Eigen::Index e = space.element[static_cast<std::size_t>(first + r)];
        target.row(e) += part.row(r) / sqrt_area_[e];
      }
    });
  }
}

void SourceSpace::add_arrivals(const Eigen::MatrixXd& y, RowMatrix& target) const {
  for_row_chunks(arrivals_.rows(), [&](Eigen::Index first, Eigen::Index rows) {
    target.middleRows(first, rows).noalias() += arrivals_.middleRows(first, rows) * y;
  });
}

}  // namespace interglow::radiosity
