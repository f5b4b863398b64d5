// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/weld_points.h"

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <unordered_map>

namespace interglow::mesh {
namespace {

std::uint64_t mixed(std::uint64_t x) {
  x ^= x >> 32;
  x *= 0xd6e8feb86659fd93ULL;
  x ^= x >> 32;
  return x;
}

std::uint64_t hash_of(const std::array<std::int64_t, 3>& key) {
  std::uint64_t hash = 0;
  for (const std::int64_t k : key) hash = mixed(hash * 0x9e3779b97f4a7c15ULL + static_cast<std::uint64_t>(k));
  return hash;
}

struct KeyHash {
  std::size_t operator()(const std::array<std::int64_t, 3>& key) const { return hash_of(key); }
};

}  // namespace

WeldedPoints weld_equal_points(const std::vector<Eigen::Vector3d>& points) {
  WeldedPoints welded;
  welded.index_of.reserve(points.size());
  // Open addressing, at most half full.
  std::vector<int> slots(std::bit_ceil(2 * points.size() + 2), -1);
  const std::size_t mask = slots.size() - 1;
  for (const Eigen::Vector3d& point : points) {
    const int next = static_cast<int>(welded.points.size());
    if (!point.allFinite()) {
      welded.index_of.push_back(next);
      welded.points.push_back(point);
      continue;
    }
    std::array<std::int64_t, 3> key;
    for (int axis = 0; axis < 3; ++axis) key[axis] = std::bit_cast<std::int64_t>(point[axis] + 0.0);  // -0 + 0 = 0
    std::size_t slot = hash_of(key) & mask;
    while (slots[slot] >= 0 && welded.points[slots[slot]] != point) slot = (slot + 1) & mask;
    if (slots[slot] < 0) {
      slots[slot] = next;
      welded.points.push_back(point);
    }
    welded.index_of.push_back(slots[slot]);
  }
  return welded;
}

WeldedPoints weld_near_points(const std::vector<Eigen::Vector3d>& points, double distance) {
  WeldedPoints welded;
  welded.index_of.reserve(points.size());
  if (points.empty()) return welded;
  Eigen::Vector3d lowest = points.front();
  for (const Eigen::Vector3d& point : points) lowest = lowest.cwiseMin(point);
  // Cells as wide as the distance: a near point is in the same cell or a neighbouring one.
  std::unordered_multimap<std::array<std::int64_t, 3>, int, KeyHash> cells;
  for (const Eigen::Vector3d& point : points) {
    std::array<std::int64_t, 3> cell;
    for (int axis = 0; axis < 3; ++axis) {
      cell[axis] = static_cast<std::int64_t>(std::floor(std::min((point[axis] - lowest[axis]) / distance, 9e18)));
    }
    int found = -1;
    for (int neighbour = 0; neighbour < 27; ++neighbour) {
      const std::array<std::int64_t, 3> near_cell{cell[0] + neighbour % 3 - 1, cell[1] + neighbour / 3 % 3 - 1,
                                                  cell[2] + neighbour / 9 - 1};
      const auto [first, last] = cells.equal_range(near_cell);
      for (auto candidate = first; candidate != last; ++candidate) {
        const int index = candidate->second;
        const bool near_enough = (welded.points[index] - point).squaredNorm() <= distance * distance;
        if (near_enough && (found < 0 || index < found)) found = index;
      }
    }
    if (found < 0) {
      found = static_cast<int>(welded.points.size());
      welded.points.push_back(point);
      cells.emplace(cell, found);
    }
    welded.index_of.push_back(found);
  }
  return welded;
}

}  // namespace interglow::mesh
