// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/transport.h"

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "diagnostics/error.h"

namespace interglow::radiosity {

/// Rows of F in compressed sparse storage: row i holds the columns j with F_ij > 0 in increasing order.
struct Transport::Impl {
  Eigen::VectorXd area_mm2;
  std::vector<std::int64_t> row_start;
  std::vector<int> column;
  std::vector<double> factor;
  TransportReport report;
};

Transport::Transport(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Transport::~Transport() = default;
Transport::Transport(Transport&&) noexcept = default;
Transport& Transport::operator=(Transport&&) noexcept = default;

Transport Transport::from_form_factors(const Eigen::MatrixXd& form_factors, const Eigen::VectorXd& area_mm2) {
  const Eigen::Index n = area_mm2.size();
  if (form_factors.rows() != n || form_factors.cols() != n) {
    throw InvalidParams(
        fmt::format("form_factors: {} x {} for {} areas; expected a square matrix with one row an area.",
                    form_factors.rows(), form_factors.cols(), n));
  }
  auto impl = std::make_unique<Impl>();
  impl->area_mm2 = area_mm2;
  impl->row_start.push_back(0);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      const double f = form_factors(i, j);
      if (!(f >= 0.0 && f <= 1.0))
        throw InvalidParams(fmt::format("form_factors({}, {}): {}; expected a value in [0, 1].", i, j, f));
      const double there = area_mm2[i] * f;
      const double back = area_mm2[j] * form_factors(j, i);
      // 1e-10: decimal tables of form factors are rounded; a wrong convention (rows for columns) is off by far more.
      if (!(std::abs(there - back) <= 1e-10 * std::max(there, back))) {
        throw InvalidParams(fmt::format("form_factors({}, {}): A_i F_ij = {} but A_j F_ji = {}; expected them equal.",
                                        i, j, there, back));
      }
      if (f == 0.0) continue;
      impl->column.push_back(static_cast<int>(j));
      impl->factor.push_back(f);
    }
    impl->row_start.push_back(static_cast<std::int64_t>(impl->column.size()));
  }
  impl->report.elements = n;
  impl->report.pairs = n * (n - 1) / 2;
  impl->report.stored_pairs = static_cast<std::int64_t>(impl->column.size()) / 2;
  impl->report.bytes = impl->column.size() * (sizeof(int) + sizeof(double));
  Transport transport(std::move(impl));
  const Eigen::VectorXd sums = transport.row_sums();
  TransportReport& report = transport.impl_->report;
  if (n > 0) {
    report.max_row_sum = sums.maxCoeff();
    report.closure_max = (sums.array() - 1.0).abs().maxCoeff();
    report.closure_rms = std::sqrt((sums.array() - 1.0).square().mean());
  }
  return transport;
}

Eigen::Index Transport::size() const { return impl_->area_mm2.size(); }

const Eigen::VectorXd& Transport::area_mm2() const { return impl_->area_mm2; }

RowMatrix Transport::apply(const RowMatrix& x) const {
  if (x.rows() != size())
    throw InvalidParams(fmt::format("x: {} rows; expected one for each of the {} elements.", x.rows(), size()));
  RowMatrix y = RowMatrix::Zero(x.rows(), x.cols());
  // Every row is summed by one thread in column order: the same bits for any number of threads.
  tbb::parallel_for(tbb::blocked_range<Eigen::Index>(0, size(), 16), [&](const tbb::blocked_range<Eigen::Index>& rows) {
    for (Eigen::Index i = rows.begin(); i < rows.end(); ++i) {
      const auto row = static_cast<std::size_t>(i);
      for (std::int64_t k = impl_->row_start[row]; k < impl_->row_start[row + 1]; ++k) {
        const auto entry = static_cast<std::size_t>(k);
        y.row(i) += impl_->factor[entry] * x.row(impl_->column[entry]);
      }
    }
  });
  return y;
}

Eigen::VectorXd Transport::row_sums() const { return apply(RowMatrix::Ones(size(), 1)).col(0); }

double Transport::form_factor(Eigen::Index i, Eigen::Index j) const {
  const auto begin = impl_->column.begin() + impl_->row_start[static_cast<std::size_t>(i)];
  const auto end = impl_->column.begin() + impl_->row_start[static_cast<std::size_t>(i) + 1];
  const auto found = std::lower_bound(begin, end, static_cast<int>(j));
  if (found == end || *found != static_cast<int>(j)) return 0.0;
  return impl_->factor[static_cast<std::size_t>(found - impl_->column.begin())];
}

const TransportReport& Transport::report() const { return impl_->report; }

}  // namespace interglow::radiosity
