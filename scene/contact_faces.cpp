// SPDX-License-Identifier: GPL-3.0-or-later
#include "scene/contact_faces.h"

#include <vector>

#include "mesh/finer_faces.h"

namespace interglow::scene {

mesh::PatchMesh follow_contacts(const Scene& scene, std::size_t object, int halvings) {
  std::vector<mesh::OtherSurface> others;
  for (std::size_t o = 0; o < scene.objects.size(); ++o) {
    if (o != object) others.push_back({&scene.objects[o].patches, scene.objects[o].sides == Sides::kTwo});
  }
  return mesh::follow_contacts(scene.objects[object].patches, others, halvings);
}

}  // namespace interglow::scene
