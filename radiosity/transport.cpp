// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/transport.h"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "diagnostics/error.h"
#include "radiosity/tile_matrix.h"
#include "radiosity/transport_assembly.h"

namespace interglow::radiosity {

struct Transport::Impl {
  Eigen::VectorXd area_mm2;
  TileMatrix exchange;  ///< A_i F_ij
  TransportReport report;

  Eigen::VectorXd row_sums() const {
    return exchange.multiply(RowMatrix::Ones(area_mm2.size(), 1)).col(0).cwiseQuotient(area_mm2);
  }
  void finish_report();
};

void Transport::Impl::finish_report() {
  report.stored_pairs = exchange.nonzeros();
  report.bytes = exchange.bytes();
  if (area_mm2.size() == 0) return;
  const Eigen::ArrayXd sums = row_sums().array();
  report.max_row_sum = sums.maxCoeff();
  report.closure_max = (sums - 1.0).abs().maxCoeff();
  report.closure_rms = std::sqrt((sums - 1.0).square().mean());
}

namespace {

/// Least squares of the relative changes, weighted by the exchange: G_ij (1 + x_i + x_j) with row sums A_i, that is
/// (diag(Σ_j G_ij) + G) x = A - Σ_j G_ij, solved by conjugate gradients.
double smooth(TileMatrix& exchange, const Eigen::VectorXd& area, const std::vector<int>& material) {
  const Eigen::Index n = area.size();
  const Eigen::VectorXd sums = exchange.multiply(RowMatrix::Ones(n, 1)).col(0);
  Eigen::VectorXd residual = area - sums;
  for (Eigen::Index i = 0; i < n; ++i) {
    const bool black = material[static_cast<std::size_t>(i)] < 0;  // their exchange with one another was not computed
    if (black) residual[i] = 0.0;
    // Half: nothing that assembly gets wrong is as much; an opening is.
    if (!black && std::abs(residual[i]) > 0.5 * area[i]) {
      throw InvalidParams(
          fmt::format("TransportParams::smooth_closure: the form factors of element {} sum to {}; expected about 1: "
                      "only a closed scene can be smoothed.",
                      i, sums[i] / area[i]));
    }
  }
  const auto product = [&](const Eigen::VectorXd& x) {
    Eigen::VectorXd y = sums.cwiseProduct(x) + Eigen::VectorXd(exchange.multiply(x).col(0));
    for (Eigen::Index i = 0; i < n; ++i) {
      if (material[static_cast<std::size_t>(i)] < 0) y[i] = 0.0;
    }
    return y;
  };
  const auto precondition = [&](const Eigen::VectorXd& r) {
    return Eigen::VectorXd((sums.array() > 0.0).select(r.array() / sums.array(), 0.0));
  };
  Eigen::VectorXd x = Eigen::VectorXd::Zero(n);
  Eigen::VectorXd direction = precondition(residual);
  double energy = residual.dot(direction);
  const double start = energy;
  constexpr int kMostIterations = 200;
  for (int iteration = 0; iteration < kMostIterations && energy > 1e-28 * start && energy > 0.0; ++iteration) {
    const Eigen::VectorXd image = product(direction);
    const double step = energy / direction.dot(image);
    x += step * direction;
    residual -= step * image;
    const Eigen::VectorXd next = precondition(residual);
    const double next_energy = residual.dot(next);
    direction = next + (next_energy / energy) * direction;
    energy = next_energy;
  }
  return exchange.scale_symmetrically(x, area);
}

}  // namespace

void validate(const TransportParams& params) {
  if (!(params.tolerance >= 1e-12 && params.tolerance <= 0.1)) {
    throw InvalidParams(
        fmt::format("TransportParams::tolerance: {}; expected a value in [1e-12, 0.1].", params.tolerance));
  }
}

Transport::Transport(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Transport::~Transport() = default;
Transport::Transport(Transport&&) noexcept = default;
Transport& Transport::operator=(Transport&&) noexcept = default;

Transport Transport::build(const Elements& elements, const TransportParams& params, const Progress& progress) {
  validate(params);
  auto impl = std::make_unique<Impl>();
  impl->area_mm2 = elements.area_mm2;
  Assembly assembly = assemble(elements, params, progress);
  impl->exchange = std::move(assembly.exchange);
  impl->report = assembly.report;
  if (elements.size() > 0) {
    const Eigen::VectorXd& error = assembly.error_estimate;
    impl->report.error_estimate_max = error.maxCoeff();
    const Eigen::Map<const Eigen::VectorXi> material(elements.material.data(), elements.size());
    const Eigen::VectorXd area = (material.array() >= 0).select(elements.area_mm2, 0.0);
    if (area.sum() > 0.0) impl->report.error_estimate_rms = std::sqrt(area.dot(error.cwiseAbs2()) / area.sum());
  }
  if (params.smooth_closure)
    impl->report.smoothing_change_max = smooth(impl->exchange, elements.area_mm2, elements.material);
  impl->finish_report();
  return Transport(std::move(impl));
}

Transport Transport::from_form_factors(const Eigen::MatrixXd& form_factors, const Eigen::VectorXd& area_mm2) {
  const Eigen::Index n = area_mm2.size();
  if (form_factors.rows() != n || form_factors.cols() != n) {
    throw InvalidParams(
        fmt::format("form_factors: {} x {} for {} areas; expected a square matrix with one row an area.",
                    form_factors.rows(), form_factors.cols(), n));
  }
  auto impl = std::make_unique<Impl>();
  impl->area_mm2 = area_mm2;
  std::vector<double> exchange;
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
      exchange.push_back(there);
    }
  }
  std::vector<int> order(static_cast<std::size_t>(n));
  std::iota(order.begin(), order.end(), 0);
  std::vector<TileMatrix::Chunk> chunks(1);
  chunks[0].values.push_back(std::move(exchange));
  chunks[0].tiles.push_back({0, 0, chunks[0].values[0].data()});
  impl->exchange = TileMatrix(std::move(order), {0, static_cast<int>(n)}, std::move(chunks));
  impl->report.elements = n;
  impl->report.pairs = n * (n - 1) / 2;
  impl->finish_report();
  return Transport(std::move(impl));
}

Eigen::Index Transport::size() const { return impl_->area_mm2.size(); }

const Eigen::VectorXd& Transport::area_mm2() const { return impl_->area_mm2; }

RowMatrix Transport::apply(const RowMatrix& x) const {
  if (x.rows() != size())
    throw InvalidParams(fmt::format("x: {} rows; expected one for each of the {} elements.", x.rows(), size()));
  RowMatrix y = impl_->exchange.multiply(x);
  y.array().colwise() /= impl_->area_mm2.array();
  return y;
}

Eigen::VectorXd Transport::row_sums() const { return impl_->row_sums(); }

double Transport::form_factor(Eigen::Index i, Eigen::Index j) const {
  return impl_->exchange.at(i, j) / impl_->area_mm2[i];
}

void Transport::row(Eigen::Index i, std::vector<int>& columns, std::vector<double>& factors) const {
  impl_->exchange.row(i, columns, factors);
  for (double& factor : factors) factor /= impl_->area_mm2[i];
}

const TransportReport& Transport::report() const { return impl_->report; }

}  // namespace interglow::radiosity
