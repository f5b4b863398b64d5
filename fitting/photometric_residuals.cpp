// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/photometric_residuals.h"

#include <tbb/parallel_for.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>

namespace interglow::fitting {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using radiosity::RowMatrix;

/// Side of the square tiles that are compressed at once [px].
constexpr int kTile = 16;
/// Squares whose scores make the sandwich: at least this many across the picture, unless they were below 2 px.
constexpr int kSquaresAcross = 12;
/// Pixels whose sums are taken together; the blocks' sums are added in their order.
constexpr Index kBlock = 256;
constexpr int kMostRounds = 50;
constexpr double kStill = 1e-3;  ///< movement of gain and offset that ends the rounds, in standard deviations

int own_count(const FitParams& params) { return (params.gain ? 1 : 0) + (params.offset ? 1 : 0); }

double huber_weight(double residual, double limit) {
  const double size = std::abs(residual);
  return size <= limit ? 1.0 : limit / size;
}

double huber_cost(double residual, double limit) {
  const double size = std::abs(residual);
  return size <= limit ? residual * residual : limit * (2.0 * size - limit);
}

/// Columns of a band's sums.
enum Sum : int { kWeight, kPrediction, kSquare, kValue, kProduct, kCost, kSums };

/// Weighted sums of every band over all pixels, bands x kSums.
MatrixXd band_sums(const ForwardModel& model, const FitData& data, const Evaluation& evaluation,
                   const FitParams& params, const FitState& state, bool weighted) {
  const Index bands = model.spectra().bands();
  const Index pixels = evaluation.channels.rows();
  const Index blocks = (pixels + kBlock - 1) / kBlock;
  std::vector<MatrixXd> sums(static_cast<std::size_t>(blocks));
  tbb::parallel_for(Index{0}, blocks, [&](Index block) {
    const Index begin = block * kBlock;
    const Index count = std::min(kBlock, pixels - begin);
    const RowMatrix prediction = evaluation.channels.middleRows(begin, count) * model.palette();
    MatrixXd sum = MatrixXd::Zero(bands, kSums);
    for (Index i = 0; i < count; ++i) {
      if (!data.use[static_cast<std::size_t>(begin + i)]) continue;
      for (Index b = 0; b < bands; ++b) {
        const auto at = static_cast<std::size_t>((begin + i) * bands + b);
        const double inverse = 1.0 / static_cast<double>(data.sigma[at]);
        const double y = static_cast<double>(data.image.value[at]);
        const double p = prediction(i, b);
        const double residual = (y - state.gain[b] * p - state.offset[b]) * inverse;
        const double weight = inverse * inverse * (weighted ? huber_weight(residual, params.huber_sigmas) : 1.0);
        sum(b, kWeight) += weight;
        sum(b, kPrediction) += weight * p;
        sum(b, kSquare) += weight * p * p;
        sum(b, kValue) += weight * y;
        sum(b, kProduct) += weight * p * y;
        sum(b, kCost) += huber_cost(residual, params.huber_sigmas);
      }
    }
    sums[static_cast<std::size_t>(block)] = std::move(sum);
  });
  MatrixXd total = MatrixXd::Zero(bands, kSums);
  for (const MatrixXd& sum : sums) total += sum;
  return total;
}

/// Weighted least squares of one band. A prediction that is even over the picture leaves both as they are.
Eigen::Vector2d solved_band(const Eigen::RowVectorXd& sum, const FitParams& params, double gain, double offset) {
  Eigen::Matrix2d normal;
  normal << sum[kSquare], sum[kPrediction], sum[kPrediction], sum[kWeight];
  const Eigen::Vector2d right(sum[kProduct], sum[kValue]);
  if (params.gain && params.offset) {
    if (!(normal.determinant() > 1e-12 * normal(0, 0) * normal(1, 1))) return {gain, offset};
    return normal.inverse() * right;
  }
  if (params.gain) {
    if (normal(0, 0) > 0.0) gain = (right[0] - normal(0, 1) * offset) / normal(0, 0);
  } else if (normal(1, 1) > 0.0) {
    offset = (right[1] - normal(0, 1) * gain) / normal(1, 1);
  }
  return {gain, offset};
}

/// The pixels of a tile that take part.
std::vector<Index> pixels_of(const FitData& data, int row0, int column0) {
  std::vector<Index> pixels;
  for (int row = row0; row < std::min(data.image.height, row0 + kTile); ++row) {
    for (int column = column0; column < std::min(data.image.width, column0 + kTile); ++column) {
      const Index p = static_cast<Index>(row) * data.image.width + column;
      if (data.use[static_cast<std::size_t>(p)]) pixels.push_back(p);
    }
  }
  return pixels;
}

/// Squares of the picture, of 2, 4, 8 or 16 px: whole numbers of them make a tile.
struct Squares {
  int side = kTile;
  int across = 0;
  int down = 0;

  Squares(int width, int height) {
    while (side > 2 && std::max(width, height) < kSquaresAcross * side) side /= 2;
    across = (width + side - 1) / side;
    down = (height + side - 1) / side;
  }
  Index of(Index pixel, int width) const { return pixel / width / side * across + pixel % width / side; }
};

/// Covariance of the sum of the squares' scores, s_shared + responseᵀ s_own, by sums over windows of 2 × 2 squares, of
/// which every square is in four. @param scores  per band, (own + shared) x squares
MatrixXd scatter(const std::vector<MatrixXd>& scores, const CompressedBands& all, const Squares& squares,
                 double& freedom) {
  MatrixXd score = MatrixXd::Zero(all.shared, static_cast<Index>(squares.across) * squares.down);
  for (std::size_t band = 0; band < scores.size(); ++band)
    score += scores[band].bottomRows(all.shared) + all.own_response(band).transpose() * scores[band].topRows(all.own);
  MatrixXd sum = MatrixXd::Zero(all.shared, all.shared);
  for (int row = -1; row < squares.down; ++row) {
    for (int column = -1; column < squares.across; ++column) {
      VectorXd window = VectorXd::Zero(all.shared);
      for (int r = std::max(row, 0); r <= std::min(row + 1, squares.down - 1); ++r) {
        for (int c = std::max(column, 0); c <= std::min(column + 1, squares.across - 1); ++c)
          window += score.col(static_cast<Index>(r) * squares.across + c);
      }
      sum += 0.25 * window * window.transpose();
    }
  }
  const auto lit = static_cast<double>((score.colwise().squaredNorm().array() > 0.0).count());
  // Σ of the squared weights 1, 1/2 twice, in each direction.
  freedom = lit / (1.5 * 1.5);
  return sum;
}

}  // namespace

double fit_bands(const ForwardModel& model, const FitData& data, const Evaluation& evaluation, const FitParams& params,
                 FitState& state) {
  const bool moves = params.gain || params.offset;
  // The first round is without weights, so that the result does not depend on where the state was.
  for (int round = moves ? 0 : 1;; ++round) {
    const MatrixXd sums = band_sums(model, data, evaluation, params, state, round > 0);
    double movement = 0.0;
    for (Index b = 0; moves && b < sums.rows(); ++b) {
      const Eigen::Vector2d solution = solved_band(sums.row(b), params, state.gain[b], state.offset[b]);
      const double d_gain = solution[0] - state.gain[b];
      const double d_offset = solution[1] - state.offset[b];
      movement =
          std::max(movement, sums(b, kSquare) * d_gain * d_gain + 2.0 * sums(b, kPrediction) * d_gain * d_offset +
                                 sums(b, kWeight) * d_offset * d_offset);
      state.gain[b] = solution[0];
      state.offset[b] = solution[1];
    }
    if (round > 0 && (movement <= kStill * kStill || round == kMostRounds)) return sums.col(kCost).sum();
  }
}

CompressedAt compress(const ForwardModel& model, const FitData& data, const FitState& state,
                      const Evaluation& evaluation, const std::vector<int>& free, const FitParams& params,
                      const std::vector<RowMatrix>& right_sides, bool with_halves) {
  const Index bands = model.spectra().bands();
  const Index own = own_count(params);
  const auto shared = static_cast<Index>(free.size());
  const Index columns = own + shared + 1 + static_cast<Index>(right_sides.size());
  const RowMatrix& palette = model.palette();
  std::vector<TileQr> all(static_cast<std::size_t>(bands), TileQr(columns));
  std::vector<std::vector<TileQr>> half(with_halves ? 2 : 0, all);
  std::vector<double> cost(static_cast<std::size_t>(bands), 0.0);
  std::vector<double> square(static_cast<std::size_t>(bands), 0.0);
  std::vector<std::size_t> robust(static_cast<std::size_t>(bands), 0);
  const Squares squares(data.image.width, data.image.height);
  std::vector<MatrixXd> scores(with_halves ? static_cast<std::size_t>(bands) : 0,
                               MatrixXd::Zero(own + shared, static_cast<Index>(squares.across) * squares.down));
  const int tiles_across = (data.image.width + kTile - 1) / kTile;
  const int tiles = tiles_across * ((data.image.height + kTile - 1) / kTile);
  for (int tile = 0; tile < tiles; ++tile) {
    const std::vector<Index> pixels = pixels_of(data, tile / tiles_across * kTile, tile % tiles_across * kTile);
    if (pixels.empty()) continue;
    const auto count = static_cast<Index>(pixels.size());
    const auto in_bands = [&](const RowMatrix& channels) -> RowMatrix {
      return channels(pixels, Eigen::all) * palette;
    };
    const RowMatrix prediction = in_bands(evaluation.channels);
    std::vector<RowMatrix> slope(static_cast<std::size_t>(shared) + right_sides.size());
    tbb::parallel_for(std::size_t{0}, slope.size(), [&](std::size_t k) {
      slope[k] = k < static_cast<std::size_t>(shared)
                     ? in_bands(evaluation.derivative[static_cast<std::size_t>(free[k])])
                     : in_bands(right_sides[k - static_cast<std::size_t>(shared)]);
    });
    tbb::parallel_for(Index{0}, bands, [&](Index b) {
      const auto band = static_cast<std::size_t>(b);
      MatrixXd rows(count, columns);
      for (Index i = 0; i < count; ++i) {
        const auto at = static_cast<std::size_t>(pixels[static_cast<std::size_t>(i)] * bands + b);
        const double sigma = static_cast<double>(data.sigma[at]);
        const double residual =
            (static_cast<double>(data.image.value[at]) - state.gain[b] * prediction(i, b) - state.offset[b]) / sigma;
        const double weight = huber_weight(residual, params.huber_sigmas);
        cost[band] += huber_cost(residual, params.huber_sigmas);
        square[band] += residual * residual;
        robust[band] += weight < 1.0 ? 1 : 0;
        const double root = std::sqrt(weight) / sigma;
        Index column = 0;
        if (params.gain) rows(i, column++) = root * prediction(i, b);
        if (params.offset) rows(i, column++) = root;
        for (Index k = 0; k < shared; ++k)
          rows(i, column++) = root * state.gain[b] * slope[static_cast<std::size_t>(k)](i, b);
        rows(i, column++) = std::sqrt(weight) * residual;
        for (std::size_t k = static_cast<std::size_t>(shared); k < slope.size(); ++k)
          rows(i, column++) = root * state.gain[b] * slope[k](i, b);
      }
      all[band].add(rows);
      if (with_halves) {
        half[static_cast<std::size_t>((tile / tiles_across + tile % tiles_across) % 2)][band].add(rows);
        for (Index i = 0; i < count; ++i) {
          scores[band].col(squares.of(pixels[static_cast<std::size_t>(i)], data.image.width)) +=
              rows(i, own + shared) * rows.row(i).head(own + shared).transpose();
        }
      }
    });
  }

  const auto triangles = [](const std::vector<TileQr>& of) {
    std::vector<MatrixXd> result;
    for (const TileQr& qr : of) result.push_back(qr.triangle());
    return result;
  };
  CompressedAt result;
  result.all = join_bands(triangles(all), own, shared);
  const auto residuals = static_cast<double>(data.residuals);
  result.cost = std::accumulate(cost.begin(), cost.end(), 0.0);
  result.chi_square = std::accumulate(square.begin(), square.end(), 0.0) / residuals;
  result.robust_share = static_cast<double>(std::accumulate(robust.begin(), robust.end(), std::size_t{0})) / residuals;
  if (!with_halves) return result;
  for (const auto& one : half) result.half_triangle.push_back(join_bands(triangles(one), own, shared).shared_triangle);
  result.score_scatter = scatter(scores, result.all, squares, result.score_freedom);
  const MatrixXd prior = prior_rows(state, state.camera, free, params);
  result.score_scatter += prior.leftCols(shared).transpose() * prior.leftCols(shared);
  return result;
}

}  // namespace interglow::fitting
