// SPDX-License-Identifier: GPL-3.0-or-later
/// Small scenes to fit: the paper's two, and some that do not determine everything.
#pragma once

#include "scene/scene.h"

namespace interglow::test {

struct FitSceneParams {
  int around = 16;  ///< faces around a half cylinder
  int along = 8;    ///< faces along it
  int bands = 8;    ///< on 400-700 nm; the grid begins one band lower
  int side_px = 64;
  bool fluorescent = true;
};

/// Two half cylinders of radius 20 mm and length 50 mm, red and yellow, that touch along the y axis; camera above.
scene::Scene half_cylinders(const FitSceneParams& params = {});

/// A half cylinder of radius 20 mm as an arch over a plane of 110 mm by 110 mm; camera from the side.
scene::Scene arch_on_plane(const FitSceneParams& params = {});

/// Only the plane.
scene::Scene single_plane(const FitSceneParams& params = {});

}  // namespace interglow::test
