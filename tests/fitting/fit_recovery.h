// SPDX-License-Identifier: GPL-3.0-or-later
/// How far fits of coarse meshes to captures traced on fine ones are from the truth.
#pragma once

#include "fit_scenes.h"

namespace interglow::test {

enum class ReflectanceError { kNone, kScale, kOffset };

struct RecoveryParams {
  bool arch = false;  ///< the arch on the plane; otherwise the two half cylinders
  FitSceneParams scene{.around = 20, .along = 10, .bands = 6, .side_px = 64, .fluorescent = true};
  int truth_around = 256;  ///< faces around in the capture, half as many along
  int paths = 2048;        ///< of each pixel
  /// Blur 1 px, 3 % glare, 0.5 % offset, gains ± 10 % from band to band.
  bool spoilt = false;
  /// The capture's reflectances are 2 % higher and lower than the model's, or 0.02 higher.
  ReflectanceError reflectance = ReflectanceError::kNone;
  double start_deg = 0.4;  ///< of turns and light; the distance starts off by 1 % for each
  unsigned seed = 1;
};

struct Recovery {
  double reprojection_px = 0.0;   ///< root mean square over the points of the patches
  double fov_share = 0.0;         ///< error of the field of view, relative
  double light_deg = 0.0;         ///< of the light's direction
  double light_across_deg = 0.0;  ///< of its part across the cylinders' axes: along them light trades with the gains
  double w_share = 0.0;           ///< error of w/w', relative; the truth is 1.3
  double fov_sd = 0.0;            ///< of fov_share by noise alone
  double w_sd = 0.0;
  double chi_square = 0.0;
  bool converged = false;
};

Recovery recover(const RecoveryParams& params);

}  // namespace interglow::test
