// SPDX-License-Identifier: GPL-3.0-or-later
/// Fits of coarse meshes to captures traced on fine ones: errors of pose, field of view, light and w/w', as a table.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <ctime>
#include <string>

#include "tests/fitting/fit_recovery.h"

int main(int argc, char** argv) {
  using interglow::test::Recovery;
  using interglow::test::RecoveryParams;
  using interglow::test::ReflectanceError;
  RecoveryParams base;
  base.scene.side_px = 96;
  base.scene.bands = 8;
  base.paths = 4096;
  int seeds = 1;
  std::string only;
  CLI::App app("Fits of the half cylinders and the arch, 20 faces around, to captures traced on 256.");
  app.add_option("--side", base.scene.side_px, "pixels of a side")->capture_default_str();
  app.add_option("--bands", base.scene.bands, "bands")->capture_default_str();
  app.add_option("--around", base.scene.around, "faces around a half cylinder in the fit")->capture_default_str();
  app.add_option("--paths", base.paths, "paths of each pixel of the capture")->capture_default_str();
  app.add_option("--only", only, "captures whose name, or whose scene's, holds this text");
  app.add_option("--seeds", seeds, "captures of each kind")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  base.scene.along = base.scene.around / 2;

  fmt::print("{} x {} pixels, {} bands, {} paths; errors (and what noise alone would give, one standard deviation)\n",
             base.scene.side_px, base.scene.side_px, base.scene.bands, base.paths);
  fmt::print("{:<15} {:<30} {:>9} {:>18} {:>10} {:>10} {:>18} {:>7} {:>8}\n", "scene", "capture", "pose px",
             "field of view %", "light deg", "across", "w/w' %", "chi2", "s CPU");
  struct Kind {
    const char* name;
    bool spoilt;
    ReflectanceError reflectance;
    double start_deg;
  };
  for (const bool arch : {false, true}) {
    for (const Kind& kind : {Kind{"noise", false, ReflectanceError::kNone, 0.4},
                             {"noise, start 5 degrees off", false, ReflectanceError::kNone, 5.0},
                             {"spoilt", true, ReflectanceError::kNone, 5.0},
                             {"spoilt, reflectances +-2 %", true, ReflectanceError::kScale, 5.0},
                             {"spoilt, reflectances +0.02", true, ReflectanceError::kOffset, 5.0}}) {
      const std::string name = std::string(arch ? "arch on plane, " : "half cylinders, ") + kind.name;
      if (name.find(only) == std::string::npos) continue;
      for (int seed = 1; seed <= seeds; ++seed) {
        RecoveryParams params = base;
        params.arch = arch;
        params.spoilt = kind.spoilt;
        params.reflectance = kind.reflectance;
        params.start_deg = kind.start_deg;
        params.seed = static_cast<unsigned>(seed);
        const std::clock_t begin = std::clock();
        const Recovery found = interglow::test::recover(params);
        fmt::print(
            "{:<15} {:<30} {:>9.4f} {:>+9.3f} ({:.3f}) {:>10.3f} {:>+10.3f} {:>+9.3f} ({:.3f}) {:>7.3f} {:>8.1f}{}\n",
            arch ? "arch on plane" : "half cylinders", kind.name, found.reprojection_px, 100.0 * found.fov_share,
            100.0 * found.fov_sd, found.light_deg, found.light_across_deg, 100.0 * found.w_share, 100.0 * found.w_sd,
            found.chi_square, static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC,
            found.converged ? "" : "  did not converge");
        std::fflush(stdout);
      }
    }
  }
  return 0;
}
