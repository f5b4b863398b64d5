// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/indirect_solve.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <numeric>
#include <tuple>

#include "diagnostics/error.h"

namespace interglow::fitting {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using radiosity::RowMatrix;

constexpr std::ptrdiff_t kCellElements = 16;
constexpr std::ptrdiff_t kMostCells = 800;  ///< their form factors are a full matrix
constexpr double kCellTolerance = 1e-4;     ///< of the solve between cells: it is a correction
constexpr int kMostRounds = 10000;
constexpr std::size_t kMostWays = 20;  ///< directions kept
/// A normal's way across the unit ball counts as this share of the scene's size: cells of round bodies are patches.
constexpr double kNormalWeight = 0.3;

/// Gives all of first to last one cell, or halves them across the widest of place and normal.
void make_cells(const radiosity::Elements& elements, double size_mm, std::ptrdiff_t most,
                std::vector<int>::iterator first, std::vector<int>::iterator last, std::vector<int>& cell, int& cells) {
  if (last - first <= most) {
    for (auto e = first; e != last; ++e) cell[static_cast<std::size_t>(*e)] = cells;
    ++cells;
    return;
  }
  const auto coordinate = [&](int element, int axis) {
    return axis < 3 ? elements.centroid(element, axis) / size_mm : kNormalWeight * elements.normal(element, axis - 3);
  };
  int widest = 0;
  double width = -1.0;
  for (int axis = 0; axis < 6; ++axis) {
    double low = coordinate(*first, axis);
    double high = low;
    for (auto e = first; e != last; ++e) {
      low = std::min(low, coordinate(*e, axis));
      high = std::max(high, coordinate(*e, axis));
    }
    if (high - low > width) {
      width = high - low;
      widest = axis;
    }
  }
  const auto middle = first + (last - first) / 2;
  std::nth_element(first, middle, last, [&](int a, int b) {
    return std::pair(coordinate(a, widest), a) < std::pair(coordinate(b, widest), b);
  });
  make_cells(elements, size_mm, most, first, middle, cell, cells);
  make_cells(elements, size_mm, most, middle, last, cell, cells);
}

/// Largest value in each block of `modes` columns.
VectorXd sizes(const RowMatrix& of, Index modes) {
  VectorXd result(of.cols() / modes);
  for (Index s = 0; s < result.size(); ++s) result[s] = of.middleCols(s * modes, modes).cwiseAbs().maxCoeff();
  return result;
}

}  // namespace

IndirectSolve::IndirectSolve(const radiosity::Elements& elements, const radiosity::Transport& transport,
                             const SpectralReduction& spectra)
    : elements_(elements), transport_(transport), spectra_(spectra) {
  std::vector<int> order;
  for (Index e = 0; e < elements.size(); ++e) {
    if (elements.material[static_cast<std::size_t>(e)] >= 0) order.push_back(static_cast<int>(e));
  }
  // Cells hold one material, and one side of one object.
  const auto kind = [&](int element) {
    const auto e = static_cast<std::size_t>(element);
    return std::tuple(elements.object[e], static_cast<bool>(elements.back[e]), elements.material[e]);
  };
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return kind(a) < kind(b); });
  const double size_mm =
      (elements.centroid.colwise().maxCoeff() - elements.centroid.colwise().minCoeff()).maxCoeff() + 1e-300;
  const std::ptrdiff_t most = std::max(kCellElements, static_cast<std::ptrdiff_t>(order.size()) / kMostCells + 1);
  cell_.assign(static_cast<std::size_t>(elements.size()), -1);
  int cells = 0;
  for (auto first = order.begin(); first != order.end();) {
    const auto last = std::find_if(first, order.end(), [&](int e) { return kind(e) != kind(*first); });
    make_cells(elements, size_mm, most, first, last, cell_, cells);
    cell_material_.resize(static_cast<std::size_t>(cells), elements.material[static_cast<std::size_t>(*first)]);
    first = last;
  }
  std::vector<double> area(static_cast<std::size_t>(cells), 0.0);
  for (const int e : order) area[static_cast<std::size_t>(cell_[static_cast<std::size_t>(e)])] += elements.area_mm2[e];
  share_.assign(cell_.size(), 0.0);
  for (const int e : order)
    share_[static_cast<std::size_t>(e)] =
        elements.area_mm2[e] / area[static_cast<std::size_t>(cell_[static_cast<std::size_t>(e)])];

  std::vector<std::vector<int>> members(static_cast<std::size_t>(cells));
  for (const int e : order) members[static_cast<std::size_t>(cell_[static_cast<std::size_t>(e)])].push_back(e);
  between_cells_ = MatrixXd::Zero(cells, cells);
  tbb::parallel_for(0, cells, [&](int c) {
    std::vector<int> columns;
    std::vector<double> factors;
    for (const int e : members[static_cast<std::size_t>(c)]) {
      transport.row(e, columns, factors);
      for (std::size_t k = 0; k < columns.size(); ++k) {
        const int to = cell_[static_cast<std::size_t>(columns[k])];
        if (to >= 0) between_cells_(c, to) += share_[static_cast<std::size_t>(e)] * factors[k];
      }
    }
  });
}

RowMatrix IndirectSolve::reflected(const RowMatrix& arriving, const std::vector<int>& material,
                                   const std::vector<MatrixXd>& reflection) const {
  const Index modes = spectra_.modes();
  RowMatrix result = RowMatrix::Zero(arriving.rows(), arriving.cols());
  tbb::parallel_for(tbb::blocked_range<Index>(0, arriving.rows(), 64), [&](const tbb::blocked_range<Index>& range) {
    for (Index e = range.begin(); e < range.end(); ++e) {
      const int m = material[static_cast<std::size_t>(e)];
      if (m < 0) continue;
      for (Index s = 0; s < arriving.cols(); s += modes) {
        result.row(e).segment(s, modes).noalias() =
            arriving.row(e).segment(s, modes) * reflection[static_cast<std::size_t>(m)];
      }
    }
  });
  return result;
}

RowMatrix IndirectSolve::later_between_cells(const RowMatrix& sent, const std::vector<MatrixXd>& reflection) const {
  const auto next = [&](const RowMatrix& from) {
    RowMatrix arriving(from.rows(), from.cols());
    tbb::parallel_for(tbb::blocked_range<Index>(0, from.rows(), 64), [&](const tbb::blocked_range<Index>& range) {
      const auto count = static_cast<Index>(range.size());
      arriving.middleRows(range.begin(), count).noalias() = between_cells_.middleRows(range.begin(), count) * from;
    });
    return reflected(arriving, cell_material_, reflection);
  };
  RowMatrix term = next(sent);
  RowMatrix sum = term;
  const double size = sent.cwiseAbs().maxCoeff();
  for (int k = 1; k < kMostRounds && term.cwiseAbs().maxCoeff() > kCellTolerance * size; ++k) {
    term = next(term);
    sum += term;
  }
  return sum;
}

RowMatrix IndirectSolve::radiosity(const RowMatrix& first, const std::vector<MatrixXd>& reflection,
                                   std::optional<int> bounces, double tolerance) const {
  const auto bounced = [&](const RowMatrix& sent) {
    return reflected(transport_.apply(sent), elements_.material, reflection);
  };
  RowMatrix result = first;
  if (bounces) {
    RowMatrix term = first;
    for (int k = 1; k < *bounces; ++k) {
      term = bounced(term);
      result += term;
    }
    return result;
  }
  // Generalised conjugate residuals with the solve between cells as the preconditioner: what is missing never grows,
  // whatever the cells. Lengths are weighted with the areas.
  const Index modes = spectra_.modes();
  const VectorXd size = sizes(first, modes);
  const VectorXd& area = elements_.area_mm2;
  struct Way {
    RowMatrix step;
    RowMatrix gain;  ///< step - T step
    VectorXd square;
  };
  std::vector<Way> ways;
  RowMatrix missing = first;
  result.setZero();
  for (int round = 0; round < kMostRounds; ++round) {
    if ((sizes(missing, modes).array() <= tolerance * size.array()).all()) return result + missing;
    // missing + T missing + T² missing + …, all but the first term between cells.
    RowMatrix of_cells = RowMatrix::Zero(cells(), first.cols());
    for (Index e = 0; e < first.rows(); ++e) {
      const auto i = static_cast<std::size_t>(e);
      if (cell_[i] >= 0) of_cells.row(cell_[i]) += share_[i] * missing.row(e);
    }
    const RowMatrix later = later_between_cells(of_cells, reflection);
    Way way{missing, {}, VectorXd(size.size())};
    for (Index e = 0; e < first.rows(); ++e) {
      const int cell = cell_[static_cast<std::size_t>(e)];
      if (cell >= 0) way.step.row(e) += later.row(cell);
    }
    way.gain = way.step - bounced(way.step);
    if (ways.size() == kMostWays) ways.erase(ways.begin());
    tbb::parallel_for(Index{0}, size.size(), [&](Index s) {
      auto step = way.step.middleCols(s * modes, modes);
      auto gain = way.gain.middleCols(s * modes, modes);
      const auto product = [&](const auto& a, const auto& b) { return a.cwiseProduct(b).rowwise().sum().dot(area); };
      for (const Way& before : ways) {
        if (!(before.square[s] > 0.0)) continue;
        const auto other = before.gain.middleCols(s * modes, modes);
        const double part = product(gain, other) / before.square[s];
        gain -= part * other;
        step -= part * before.step.middleCols(s * modes, modes);
      }
      way.square[s] = product(gain, gain);
      auto rest = missing.middleCols(s * modes, modes);
      if (!(way.square[s] > 0.0)) return;
      const double length = product(gain, rest) / way.square[s];
      result.middleCols(s * modes, modes) += length * step;
      rest -= length * gain;
    });
    ways.push_back(std::move(way));
  }
  throw NumericalFailure(
      "The fit's light did not settle within 10000 bounces: the scene is closed and its reflectances are near 1.");
}

}  // namespace interglow::fitting
