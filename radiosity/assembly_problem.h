// SPDX-License-Identifier: GPL-3.0-or-later
/// What every pair of clusters is asked about while form factors are assembled: the tree, its tiles, the blockers.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "radiosity/blockers.h"
#include "radiosity/element_tree.h"
#include "radiosity/elements.h"
#include "radiosity/form_factor_batch.h"
#include "radiosity/risen_blockers.h"
#include "radiosity/transport.h"
#include "radiosity/visibility.h"

namespace interglow::radiosity {

struct AssemblyProblem {
  /// Keeps references to both. Cost O(N log N), and O(N x vertices of the blockers) for what stays below every plane.
  AssemblyProblem(const Elements& scene_elements, const TransportParams& transport_params);

  const Elements& elements;
  const TransportParams& params;
  ElementTree tree;
  Blockers blockers;
  std::vector<int> tile_of_node;              ///< number of the tile cluster a node is, -1 if it is none
  std::vector<int> tile_first;                ///< first position of each tile, and the end
  std::vector<std::uint64_t> hidden_objects;  ///< by node: bit o: nothing of object o rises above any member's plane
  std::vector<char> black;                    ///< by node: all members are black
  double entry_tolerance = 0.0;               ///< of one form factor
  double unoccluded_tolerance = 0.0;          ///< of one form factor as if nothing hid it
  double deviations = 0.0;                    ///< standard deviations that a row's estimate takes of its lines
  std::optional<FormFactorBatch> kernel;
  std::optional<Visibility> visibility;  ///< with occlusion
  std::optional<RisenBlockers> risen;    ///< with many blockers

  const Cluster& cluster(int node) const { return tree.cluster(node); }
  int element(int position) const { return tree.order()[static_cast<std::size_t>(position)]; }
  bool is_tile(int node) const { return tile_of_node[static_cast<std::size_t>(node)] >= 0; }
  bool is_black(int node) const { return black[static_cast<std::size_t>(node)] != 0; }
  /// Few bodies are handed down the tree of clusters; many are searched for each pair of tiles.
  bool few_blockers() const { return blockers.body.size() <= kMostHandedDown; }
  /// Two black sides exchange nothing that anybody asks for, nor does one where black sides do not take part.
  bool idle(bool black_a, bool black_b) const { return params.black_sides ? black_a && black_b : black_a || black_b; }
  bool may_exchange(int a, int b) const {
    return !idle(is_black(a), is_black(b)) && may_face(cluster(a), cluster(b).box) &&
           may_face(cluster(b), cluster(a).box);
  }

 private:
  static constexpr std::size_t kMostHandedDown = 64;
};

}  // namespace interglow::radiosity
