// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/fit_mesh.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <vector>

#include "diagnostics/error.h"
#include "mesh/finer_faces.h"
#include "scene/contact_faces.h"

namespace interglow::fitting {

void validate(const FitMeshParams& params) {
  if (!(params.most_turn_deg >= 0.5 && params.most_turn_deg <= 90.0))
    throw InvalidParams(fmt::format("most_turn_deg is {}, expected a value in [0.5, 90].", params.most_turn_deg));
  if (params.contact_halvings < 0 || params.contact_halvings > 6)
    throw InvalidParams(fmt::format("contact_halvings is {}, expected 0 to 6.", params.contact_halvings));
  if (params.most_faces < 1)
    throw InvalidParams(fmt::format("most_faces is {}, expected at least 1.", params.most_faces));
}

scene::Scene fit_mesh(const scene::Scene& scene, const FitMeshParams& params) {
  validate(params);
  scene::Scene round = scene;
  const auto most_of = [&](std::size_t o) {
    return std::max(static_cast<std::size_t>(params.most_faces), scene.objects[o].patches.faces.size());
  };
  tbb::parallel_for(std::size_t{0}, round.objects.size(), [&](std::size_t o) {
    const mesh::PatchMesh& patches = scene.objects[o].patches;
    // Half of them, as contacts need some.
    const std::size_t most = std::max(most_of(o) / 2, patches.faces.size());
    for (double limit = params.most_turn_deg; limit < 180.0; limit *= 1.25) {
      mesh::PatchMesh finer = mesh::halve_turns(patches, limit);
      if (finer.faces.size() > most) continue;
      round.objects[o].patches = std::move(finer);
      break;
    }
  });
  scene::Scene result = round;
  tbb::parallel_for(std::size_t{0}, result.objects.size(), [&](std::size_t o) {
    for (int halvings = params.contact_halvings; halvings >= 0; --halvings) {
      mesh::PatchMesh graded = scene::follow_contacts(round, o, halvings);
      if (halvings > 0 && graded.faces.size() > most_of(o)) continue;
      result.objects[o].patches = std::move(graded);
      break;
    }
  });
  return result;
}

}  // namespace interglow::fitting
