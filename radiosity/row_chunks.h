// SPDX-License-Identifier: GPL-3.0-or-later
/// Work on the rows of tall matrices, in parallel and with the same bits for any number of threads.
#pragma once

#include <tbb/parallel_for.h>
#include <Eigen/Core>

#include <algorithm>
#include <vector>

namespace interglow::radiosity {

/// Rows that one task works on; fixed, because sums are formed chunk by chunk.
inline constexpr Eigen::Index kChunkRows = 512;

/// Calls work(first_row, rows) for consecutive chunks of [0, rows).
template <typename Work>
void for_row_chunks(Eigen::Index rows, const Work& work) {
  const Eigen::Index chunks = (rows + kChunkRows - 1) / kChunkRows;
  tbb::parallel_for(Eigen::Index{0}, chunks, [&](Eigen::Index chunk) {
    const Eigen::Index first = chunk * kChunkRows;
    work(first, std::min(kChunkRows, rows - first));
  });
}

/// Σ over chunks, in order, of part(first_row, rows), a matrix of the given shape.
template <typename Part>
Eigen::MatrixXd sum_over_row_chunks(Eigen::Index rows, Eigen::Index part_rows, Eigen::Index part_columns,
                                    const Part& part) {
  const Eigen::Index chunks = (rows + kChunkRows - 1) / kChunkRows;
  std::vector<Eigen::MatrixXd> parts(static_cast<std::size_t>(chunks));
  tbb::parallel_for(Eigen::Index{0}, chunks, [&](Eigen::Index chunk) {
    const Eigen::Index first = chunk * kChunkRows;
    parts[static_cast<std::size_t>(chunk)] = part(first, std::min(kChunkRows, rows - first));
  });
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(part_rows, part_columns);
  for (const Eigen::MatrixXd& p : parts) sum += p;
  return sum;
}

}  // namespace interglow::radiosity
