// SPDX-License-Identifier: GPL-3.0-or-later
/// Faces of a scene's object, cut where other objects touch it.
#pragma once

#include <cstddef>

#include "scene/scene.h"

namespace interglow::scene {

/// mesh::follow_contacts of one object among all others of the scene.
/// @pre object < scene.objects.size(); halvings >= 0
mesh::PatchMesh follow_contacts(const Scene& scene, std::size_t object, int halvings);

}  // namespace interglow::scene
