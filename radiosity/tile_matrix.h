// SPDX-License-Identifier: GPL-3.0-or-later
/// A symmetric matrix of exchange areas kept in small dense tiles between clusters of elements.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "radiosity/transport.h"

namespace interglow::radiosity {

/// G_ij = A_i F_ij = G_ji. Elements are numbered by `order` so that clusters are contiguous; a tile holds the dense
/// block between two clusters that exchange light, once for both directions. Values need no index, and products run at
/// the speed of small dense products.
class TileMatrix {
 public:
  struct Tile {
    int row = 0;                    ///< cluster
    int column = 0;                 ///< cluster, >= row; a tile on the diagonal holds the full square block
    const double* value = nullptr;  ///< row-major, rows of cluster `row`
  };
  /// Tiles and what they point to, made by one piece of work.
  struct Chunk {
    std::vector<Tile> tiles;
    std::vector<std::vector<double>> values;  ///< one a tile
  };

  TileMatrix() = default;
  /// @param order          element at each position, a permutation
  /// @param cluster_first  first position of each cluster, and the number of elements at the end
  TileMatrix(std::vector<int> order, std::vector<int> cluster_first, std::vector<Chunk> chunks);

  Eigen::Index size() const { return static_cast<Eigen::Index>(order_.size()); }

  /// Y = G X, every row summed by one thread in a fixed order. Cost O(stored values × columns).
  RowMatrix multiply(const RowMatrix& x) const;

  double at(Eigen::Index i, Eigen::Index j) const;

  /// Values of row i that are not 0, in increasing order of the columns.
  void row(Eigen::Index i, std::vector<int>& columns, std::vector<double>& values) const;

  /// G_ij *= 1 + x_i + x_j. Returns the largest |change| of G_ij over the smaller of weight_i and weight_j.
  double scale_symmetrically(const Eigen::VectorXd& x, const Eigen::VectorXd& weight);

  std::int64_t nonzeros() const;  ///< pairs i < j with G_ij > 0
  std::size_t bytes() const;

 private:
  struct Link {
    int other;  ///< cluster on the other side
    int tile;
    bool transposed;  ///< this cluster's rows are the tile's columns
  };
  int cluster_size(int c) const {
    return cluster_first_[static_cast<std::size_t>(c) + 1] - cluster_first_[static_cast<std::size_t>(c)];
  }

  std::vector<int> order_, position_, cluster_first_, cluster_of_position_;
  std::vector<Chunk> chunks_;
  std::vector<Tile> tiles_;
  std::vector<std::int64_t> link_first_;
  std::vector<Link> links_;  ///< by cluster, then by other cluster
};

}  // namespace interglow::radiosity
