// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/assembly_problem.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "radiosity/row_error.h"

namespace interglow::radiosity {
namespace {

using Eigen::Vector3d;

/// Elements a side of a tile: small enough to stay in the first-level cache with its vectors, large enough for dense
/// products.
constexpr int kTileSize = 32;

/// Numbers the tile clusters in order of position and returns their first positions.
std::vector<int> mark_tiles(const ElementTree& tree, int node, std::vector<int>& tile_of_node,
                            std::vector<int>& first) {
  if (node < 0) return {0};
  std::vector<int> pending = {node};
  while (!pending.empty()) {
    const int n = pending.back();
    pending.pop_back();
    const Cluster& cluster = tree.cluster(n);
    if (cluster.count <= kTileSize) {
      tile_of_node[static_cast<std::size_t>(n)] = static_cast<int>(first.size());
      first.push_back(cluster.first);
    } else {
      pending.push_back(cluster.right);
      pending.push_back(cluster.left);
    }
  }
  first.push_back(tree.cluster(node).count);
  return first;
}

/// For every element, which objects stay below its plane; for every node, what holds for all of its members.
void mark_nodes(AssemblyProblem& problem) {
  const Elements& elements = problem.elements;
  const auto n = static_cast<std::size_t>(elements.size());
  const int objects = elements.faces.object.empty() ? 0 : std::min(64, elements.faces.object.back() + 1);
  std::vector<std::vector<const ConvexBody*>> bodies(static_cast<std::size_t>(objects));
  for (const ConvexBody& body : problem.blockers.body) {
    if (body.object < objects) bodies[static_cast<std::size_t>(body.object)].push_back(&body);
  }
  std::vector<std::uint64_t> hidden(n, 0);
  tbb::parallel_for(std::size_t{0}, n, [&](std::size_t e) {
    const Vector3d normal = elements.normal.row(static_cast<Eigen::Index>(e)).transpose();
    const Polygon& patch = problem.tree.polygon(static_cast<int>(e));
    // Coordinates of a convex object are rounded. Neighbours that stay below an angle θ take θ² of a patch's flux, and
    // of a border of height h around it 2 h / size: together less than a twentieth of the tolerance.
    const double slope = std::min(1e-5, 0.1 * std::sqrt(problem.params.tolerance));
    const double slack = std::max(problem.tree.flat(), std::sqrt(elements.area_mm2[static_cast<Eigen::Index>(e)]) *
                                                           std::min(1e-5, 0.02 * problem.params.tolerance));
    const double highest = normal.dot(patch.corner[0]) + problem.tree.flat();
    const auto below = [&](const ConvexBody* body) {
      return std::all_of(body->vertex.begin(), body->vertex.end(),
                         [&](const Vector3d& p) { return normal.dot(p) <= highest; }) ||
             lies_low(patch, normal, body->vertex, slope, slack);
    };
    for (int o = 0; o < objects; ++o) {
      const auto& all = bodies[static_cast<std::size_t>(o)];
      if (std::all_of(all.begin(), all.end(), below)) hidden[e] |= std::uint64_t{1} << o;
    }
  });
  const int nodes = problem.tree.size();
  problem.hidden_objects.assign(static_cast<std::size_t>(nodes), ~std::uint64_t{0});
  problem.black.assign(static_cast<std::size_t>(nodes), 1);
  // Children come after their parents.
  for (int node = nodes - 1; node >= 0; --node) {
    const Cluster& cluster = problem.tree.cluster(node);
    const auto at = static_cast<std::size_t>(node);
    if (cluster.count == 1) {
      const auto e = static_cast<std::size_t>(problem.tree.order()[static_cast<std::size_t>(cluster.first)]);
      problem.hidden_objects[at] = hidden[e];
      problem.black[at] = elements.material[e] < 0 ? 1 : 0;
      continue;
    }
    for (const int child : {cluster.left, cluster.right}) {
      problem.hidden_objects[at] &= problem.hidden_objects[static_cast<std::size_t>(child)];
      problem.black[at] = static_cast<char>(problem.black[at] & problem.black[static_cast<std::size_t>(child)]);
    }
  }
}

}  // namespace

AssemblyProblem::AssemblyProblem(const Elements& scene_elements, const TransportParams& transport_params)
    : elements(scene_elements), params(transport_params), tree(scene_elements) {
  const Eigen::Index n = elements.size();
  entry_tolerance = params.tolerance / std::sqrt(static_cast<double>(std::max<Eigen::Index>(n, 1)));
  // The bounds of a row's rules add up; they stay a few hundredths of what is asked for. A digit more costs little.
  unoccluded_tolerance =
      std::min(0.01 * entry_tolerance, 0.2 * params.tolerance / static_cast<double>(std::max<Eigen::Index>(n, 1)));
  deviations = deviations_of_all(n);
  tile_of_node.assign(static_cast<std::size_t>(2 * n), -1);
  mark_tiles(tree, tree.root(), tile_of_node, tile_first);
  if (params.occlusion) {
    blockers = make_blockers(elements, tree.flat());
    visibility.emplace(elements.faces);
  }
  std::vector<Polygon> polygons;
  for (int e = 0; e < static_cast<int>(n); ++e) polygons.push_back(tree.polygon(e));
  kernel.emplace(std::move(polygons));
  if (!few_blockers()) risen.emplace(elements, tree, blockers, tile_first, params.tolerance);
  mark_nodes(*this);
}

}  // namespace interglow::radiosity
