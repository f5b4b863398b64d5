// SPDX-License-Identifier: GPL-3.0-or-later
/// Where fitted surfaces touch: continuing both to their common contact line.
#pragma once

#include <vector>

#include "mesh/fitted_surface.h"

namespace interglow::mesh {

/// A fitted surface that may be continued to its neighbours.
struct ContactSurface {
  FittedSurface* surface = nullptr;
  double reach_mm = 0;    ///< widest strip to close; 0: this surface stays as it is
  double spacing_mm = 1;  ///< of the points of a contact line
  /// Filled by `close_contacts`: points of the surface on contact lines, bit-equal in both surfaces.
  std::vector<int> locked_points;
  double closed_mm = 0;  ///< length of the contact lines
};

/// Continues surfaces from their borders to contact lines.
///
/// From each border point near another surface the local quadratic is followed outwards and, up to 1.5 mm, inwards; the
/// contact is where it meets the other surface (or its continuation), or, where both are nearly parallel, where the
/// parabola through the gap has its minimum, if that is within `reach_mm` and the gap there is explained by noise. The
/// contact points of a border are smoothed along it; both surfaces are trimmed to the line and joined to it by a strip
/// of triangles. Cost: O(border points · log triangles).
void close_contacts(std::vector<ContactSurface>& surfaces);

}  // namespace interglow::mesh
