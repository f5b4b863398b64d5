// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/tile_matrix.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

namespace interglow::radiosity {
namespace {

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
#define INTERGLOW_CLONES __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define INTERGLOW_CLONES
#endif

constexpr int kLanes = 8;  ///< of a vector: one AVX-512 register, two of AVX2, four of SSE2
using Lanes = double __attribute__((vector_size(kLanes * sizeof(double))));

/// Y += T X for a tile of `rows` x `inner` values at the given strides; X and Y row-major with `columns` columns.
/// Four rows and sixteen columns at a time stay in registers; every element of Y is summed in order of the inner index.
INTERGLOW_CLONES void add_product(const double* __restrict tile, std::ptrdiff_t row_stride, std::ptrdiff_t inner_stride,
                                  int rows, int inner, const double* __restrict x, double* __restrict y,
                                  std::ptrdiff_t columns) {
  constexpr int kTogether = 4;
  int r = 0;
  for (; r + kTogether <= rows; r += kTogether) {
    const double* t = tile + r * row_stride;
    std::ptrdiff_t c = 0;
    for (; c + 2 * kLanes <= columns; c += 2 * kLanes) {
      Lanes sum[kTogether][2];
      for (int k = 0; k < kTogether; ++k) {
        std::memcpy(&sum[k], y + (r + k) * columns + c, sizeof(sum[k]));
      }
      for (int j = 0; j < inner; ++j) {
        Lanes from[2];
        std::memcpy(&from, x + j * columns + c, sizeof(from));
        for (int k = 0; k < kTogether; ++k) {
          const double factor = t[k * row_stride + j * inner_stride];
          sum[k][0] += factor * from[0];
          sum[k][1] += factor * from[1];
        }
      }
      for (int k = 0; k < kTogether; ++k) {
        std::memcpy(y + (r + k) * columns + c, &sum[k], sizeof(sum[k]));
      }
    }
    for (; c + kLanes <= columns; c += kLanes) {
      Lanes sum[kTogether];
      for (int k = 0; k < kTogether; ++k) std::memcpy(&sum[k], y + (r + k) * columns + c, sizeof(Lanes));
      for (int j = 0; j < inner; ++j) {
        Lanes from;
        std::memcpy(&from, x + j * columns + c, sizeof(Lanes));
        for (int k = 0; k < kTogether; ++k) sum[k] += t[k * row_stride + j * inner_stride] * from;
      }
      for (int k = 0; k < kTogether; ++k) std::memcpy(y + (r + k) * columns + c, &sum[k], sizeof(Lanes));
    }
    for (; c < columns; ++c) {
      double sum[kTogether] = {};
      for (int j = 0; j < inner; ++j) {
        const double from = x[j * columns + c];
        for (int k = 0; k < kTogether; ++k) sum[k] += t[k * row_stride + j * inner_stride] * from;
      }
      for (int k = 0; k < kTogether; ++k) y[(r + k) * columns + c] += sum[k];
    }
  }
  for (; r < rows; ++r) {
    for (int j = 0; j < inner; ++j) {
      const double factor = tile[r * row_stride + j * inner_stride];
      for (std::ptrdiff_t c = 0; c < columns; ++c) y[r * columns + c] += factor * x[j * columns + c];
    }
  }
}

}  // namespace

TileMatrix::TileMatrix(std::vector<int> order, std::vector<int> cluster_first, std::vector<Chunk> chunks)
    : order_(std::move(order)), cluster_first_(std::move(cluster_first)), chunks_(std::move(chunks)) {
  position_.resize(order_.size());
  for (std::size_t p = 0; p < order_.size(); ++p) position_[static_cast<std::size_t>(order_[p])] = static_cast<int>(p);
  const std::size_t clusters = cluster_first_.empty() ? 0 : cluster_first_.size() - 1;
  cluster_of_position_.resize(order_.size());
  for (std::size_t c = 0; c < clusters; ++c) {
    for (int p = cluster_first_[c]; p < cluster_first_[c + 1]; ++p)
      cluster_of_position_[static_cast<std::size_t>(p)] = static_cast<int>(c);
  }
  for (const Chunk& chunk : chunks_) tiles_.insert(tiles_.end(), chunk.tiles.begin(), chunk.tiles.end());
  std::vector<std::vector<Link>> links(clusters);
  for (std::size_t t = 0; t < tiles_.size(); ++t) {
    const Tile& tile = tiles_[t];
    links[static_cast<std::size_t>(tile.row)].push_back({tile.column, static_cast<int>(t), false});
    if (tile.column != tile.row)
      links[static_cast<std::size_t>(tile.column)].push_back({tile.row, static_cast<int>(t), true});
  }
  link_first_.push_back(0);
  for (std::vector<Link>& of_cluster : links) {
    std::sort(of_cluster.begin(), of_cluster.end(), [](const Link& a, const Link& b) { return a.other < b.other; });
    links_.insert(links_.end(), of_cluster.begin(), of_cluster.end());
    link_first_.push_back(static_cast<std::int64_t>(links_.size()));
  }
}

RowMatrix TileMatrix::multiply(const RowMatrix& x) const {
  RowMatrix y(x.rows(), x.cols());
  if (x.cols() == 0 || x.rows() == 0) return y;
  // Whole vectors: rows are filled up with zeros, unless that would be most of the work.
  const Eigen::Index columns = x.cols() < kLanes / 2 ? x.cols() : (x.cols() + kLanes - 1) / kLanes * kLanes;
  RowMatrix sorted = RowMatrix::Zero(x.rows(), columns);
  const auto row_bytes = static_cast<std::size_t>(x.cols()) * sizeof(double);
  for (std::size_t p = 0; p < order_.size(); ++p) {
    std::memcpy(sorted.data() + static_cast<Eigen::Index>(p) * columns, x.data() + order_[p] * x.cols(), row_bytes);
  }
  const auto clusters = static_cast<int>(cluster_first_.size()) - 1;
  tbb::parallel_for(tbb::blocked_range<int>(0, clusters), [&](const tbb::blocked_range<int>& range) {
    std::vector<double> sum;
    for (int c = range.begin(); c < range.end(); ++c) {
      const int rows = cluster_size(c);
      sum.assign(static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns), 0.0);
      for (std::int64_t l = link_first_[static_cast<std::size_t>(c)]; l < link_first_[static_cast<std::size_t>(c) + 1];
           ++l) {
        const Link& link = links_[static_cast<std::size_t>(l)];
        const int inner = cluster_size(link.other);
        add_product(tiles_[static_cast<std::size_t>(link.tile)].value, link.transposed ? 1 : inner,
                    link.transposed ? rows : 1, rows, inner,
                    sorted.data() + cluster_first_[static_cast<std::size_t>(link.other)] * columns, sum.data(),
                    columns);
      }
      for (int r = 0; r < rows; ++r) {
        const int element = order_[static_cast<std::size_t>(cluster_first_[static_cast<std::size_t>(c)] + r)];
        std::memcpy(y.data() + element * x.cols(), sum.data() + r * columns, row_bytes);
      }
    }
  });
  return y;
}

double TileMatrix::at(Eigen::Index i, Eigen::Index j) const {
  const int pi = position_[static_cast<std::size_t>(i)];
  const int pj = position_[static_cast<std::size_t>(j)];
  const int ci = cluster_of_position_[static_cast<std::size_t>(pi)];
  const int cj = cluster_of_position_[static_cast<std::size_t>(pj)];
  const auto begin = links_.begin() + link_first_[static_cast<std::size_t>(ci)];
  const auto end = links_.begin() + link_first_[static_cast<std::size_t>(ci) + 1];
  const auto found = std::lower_bound(begin, end, cj, [](const Link& link, int other) { return link.other < other; });
  if (found == end || found->other != cj) return 0.0;
  const int r = pi - cluster_first_[static_cast<std::size_t>(ci)];
  const int c = pj - cluster_first_[static_cast<std::size_t>(cj)];
  const double* value = tiles_[static_cast<std::size_t>(found->tile)].value;
  return found->transposed ? value[c * cluster_size(ci) + r] : value[r * cluster_size(cj) + c];
}

void TileMatrix::row(Eigen::Index i, std::vector<int>& columns, std::vector<double>& values) const {
  const int position = position_[static_cast<std::size_t>(i)];
  const auto c = static_cast<std::size_t>(cluster_of_position_[static_cast<std::size_t>(position)]);
  const int r = position - cluster_first_[c];
  const int rows = cluster_size(static_cast<int>(c));
  std::vector<std::pair<int, double>> found;
  for (std::int64_t l = link_first_[c]; l < link_first_[c + 1]; ++l) {
    const Link& link = links_[static_cast<std::size_t>(l)];
    const double* value = tiles_[static_cast<std::size_t>(link.tile)].value;
    const int inner = cluster_size(link.other);
    for (int k = 0; k < inner; ++k) {
      const double v = link.transposed ? value[k * rows + r] : value[r * inner + k];
      if (v != 0.0)
        found.emplace_back(order_[static_cast<std::size_t>(cluster_first_[static_cast<std::size_t>(link.other)] + k)],
                           v);
    }
  }
  std::sort(found.begin(), found.end());
  columns.clear();
  values.clear();
  for (const auto& [column, value] : found) {
    columns.push_back(column);
    values.push_back(value);
  }
}

double TileMatrix::scale_symmetrically(const Eigen::VectorXd& x, const Eigen::VectorXd& weight) {
  double largest = 0.0;
  for (Chunk& chunk : chunks_) {
    for (std::size_t t = 0; t < chunk.tiles.size(); ++t) {
      const Tile& tile = chunk.tiles[t];
      const int columns = cluster_size(tile.column);
      for (int r = 0; r < cluster_size(tile.row); ++r) {
        const int i = order_[static_cast<std::size_t>(cluster_first_[static_cast<std::size_t>(tile.row)] + r)];
        for (int c = 0; c < columns; ++c) {
          const int j = order_[static_cast<std::size_t>(cluster_first_[static_cast<std::size_t>(tile.column)] + c)];
          double& value = chunk.values[t][static_cast<std::size_t>(r * columns + c)];
          // The lower index first, so that both halves of a diagonal tile round alike.
          const double change = value * (x[std::min(i, j)] + x[std::max(i, j)]);
          largest = std::max(largest, std::abs(change) / std::min(weight[i], weight[j]));
          value += change;
        }
      }
    }
  }
  return largest;
}

std::int64_t TileMatrix::nonzeros() const {
  std::int64_t count = 0;
  for (const Tile& tile : tiles_) {
    const int rows = cluster_size(tile.row);
    const int columns = cluster_size(tile.column);
    for (int r = 0; r < rows; ++r) {
      for (int c = tile.row == tile.column ? r + 1 : 0; c < columns; ++c)
        count += tile.value[r * columns + c] > 0.0 ? 1 : 0;
    }
  }
  return count;
}

std::size_t TileMatrix::bytes() const {
  std::size_t sum = (order_.size() * 3 + cluster_first_.size()) * sizeof(int) + links_.size() * sizeof(Link) +
                    tiles_.size() * sizeof(Tile);
  for (const Chunk& chunk : chunks_) {
    for (const std::vector<double>& values : chunk.values) sum += values.size() * sizeof(double);
  }
  return sum;
}

}  // namespace interglow::radiosity
