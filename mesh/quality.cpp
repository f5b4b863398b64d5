// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/quality.h"

#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace interglow::mesh {

AngleStatistics angle_statistics(const PatchMesh& patches) {
  AngleStatistics statistics;
  if (patches.faces.empty()) return statistics;
  statistics.minimum_deg = 180;
  int below = 0;
  for (const Face& face : patches.faces) {
    const int corners = corner_count(face);
    double smallest = 180;
    for (int k = 0; k < corners; ++k) {
      const Eigen::Vector3d& at = patches.points[face[k]];
      const Eigen::Vector3d a = patches.points[face[(k + 1) % corners]] - at;
      const Eigen::Vector3d b = patches.points[face[(k + corners - 1) % corners]] - at;
      const double angle = std::atan2(a.cross(b).norm(), a.dot(b)) * 180 / std::numbers::pi;
      smallest = std::min(smallest, angle);
      statistics.maximum_deg = std::max(statistics.maximum_deg, angle);
    }
    statistics.minimum_deg = std::min(statistics.minimum_deg, smallest);
    statistics.mean_minimum_deg += smallest;
    below += smallest < 20;
  }
  const double count = static_cast<double>(patches.faces.size());
  statistics.mean_minimum_deg /= count;
  statistics.share_below_20_deg = below / count;
  return statistics;
}

std::vector<std::array<int, 3>> triangles_of(const PatchMesh& patches) {
  std::vector<std::array<int, 3>> triangles;
  triangles.reserve(patches.faces.size());
  for (const Face& f : patches.faces) {
    triangles.push_back({f[0], f[1], f[2]});
    if (corner_count(f) == 4) triangles.push_back({f[0], f[2], f[3]});
  }
  return triangles;
}

SurfaceDistance two_sided_distance(const TriangleMesh& scan, const PatchMesh& patches) {
  SurfaceDistance result;
  if (scan.triangles.empty() || patches.faces.empty()) return result;
  std::vector<char> used(scan.points.size(), 0);
  for (const auto& t : scan.triangles)
    for (int vertex : t) used[vertex] = 1;
  std::vector<Eigen::Vector3d> scan_samples;
  for (std::size_t i = 0; i < used.size(); ++i)
    if (used[i]) scan_samples.push_back(scan.points[i]);
  std::vector<Eigen::Vector3d> patch_samples = patches.points;
  const auto triangles = triangles_of(patches);
  for (const auto& t : triangles)
    patch_samples.push_back((patches.points[t[0]] + patches.points[t[1]] + patches.points[t[2]]) / 3);

  double sum = 0;
  const auto measure = [&](const std::vector<Eigen::Vector3d>& samples, const SurfaceIndex& other) {
    std::vector<double> distances(samples.size());
    tbb::parallel_for(std::size_t{0}, samples.size(),
                      [&](std::size_t i) { distances[i] = (other.closest(samples[i]).point - samples[i]).norm(); });
    for (double d : distances) {
      sum += d * d;
      result.maximum_mm = std::max(result.maximum_mm, d);
    }
  };
  measure(scan_samples, SurfaceIndex(patches.points, triangles));
  measure(patch_samples, SurfaceIndex(scan.points, scan.triangles));
  result.rms_mm = std::sqrt(sum / static_cast<double>(scan_samples.size() + patch_samples.size()));
  return result;
}

}  // namespace interglow::mesh
