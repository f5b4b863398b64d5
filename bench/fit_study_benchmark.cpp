// SPDX-License-Identifier: GPL-3.0-or-later
// Shares of far starts that arrive, and of 95 % intervals that hold the truth, with their binomial errors.
//   fit_study_benchmark [--starts 200] [--captures 200] [--turn 10] [--distance 0.1] [--light 5] [--quiet]
//   fit_study_benchmark --starts 0 --paths 2048 --keep FOLDER [--arch]     path-traced captures; what is traced is kept
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <ctime>

#include "tests/fitting/fit_study.h"

namespace {

std::string share(int good, int of) {
  const double p = static_cast<double>(good) / of;
  return fmt::format("{} of {} = {:.1f} % ± {:.1f}", good, of, 100.0 * p, 100.0 * std::sqrt(p * (1.0 - p) / of));
}

}  // namespace

int main(int argc, char** argv) {
  using namespace interglow;
  CLI::App app("Far starts and coverage of intervals");
  int starts = 200;
  int captures = 200;
  int first = 0;
  double turn_deg = 10.0;
  double distance_share = 0.1;
  double light_deg = 5.0;
  bool quiet = false;
  test::StudyParams params;
  app.add_option("--starts", starts);
  app.add_option("--captures", captures);
  app.add_option("--first", first, "number of the first capture, for runs in pieces");
  app.add_flag("--arch", params.arch, "the arch on a plane, not the half cylinders");
  app.add_option("--paths", params.paths, "of each pixel of a path-traced capture");
  app.add_option("--traced-around", params.traced_around);
  app.add_option("--keep", params.keep, "folder for traced pictures");
  app.add_option("--turn", turn_deg);
  app.add_option("--distance", distance_share);
  app.add_option("--light", light_deg);
  app.add_option("--around", params.scene.around);
  app.add_option("--along", params.scene.along);
  app.add_option("--most-turn", params.mesh.most_turn_deg);
  app.add_option("--contact-halvings", params.mesh.contact_halvings);
  app.add_option("--captured-around", params.captured_around);
  app.add_option("--most-faces", params.mesh.most_faces);
  app.add_option("--bands", params.scene.bands);
  app.add_option("--side", params.scene.side_px);
  app.add_option("--seed", params.seed);
  app.add_flag("--quiet", quiet);
  CLI11_PARSE(app, argc, argv);
  if (!quiet) {
    params.report = [](const std::string& line) {
      fmt::print("{}  [{:.0f} s CPU]\n", line, static_cast<double>(std::clock()) / CLOCKS_PER_SEC);
      std::fflush(stdout);
    };
  }
  fmt::print("{}, turns up to {}°, {} halvings at contacts; {}; {} px, {} bands\n",
             params.arch ? "arch on plane" : "half cylinders", params.mesh.most_turn_deg, params.mesh.contact_halvings,
             params.paths > 0 ? fmt::format("{} paths, {} faces around", params.paths, params.traced_around)
                              : "captured twice as fine",
             params.scene.side_px, params.scene.bands);
  if (starts > 0) {
    const test::StartStudy study = test::study_starts(params, starts, turn_deg, distance_share, light_deg);
    fmt::print("{:.0f}° and {:.0f} % off: {} arrive\n", turn_deg, 100.0 * distance_share,
               share(study.reached, study.tried));
  }
  if (captures > 0) {
    int covered = 0;
    int determined = 0;
    const test::IntervalStudy study = test::study_intervals(params, first, captures);
    if (params.paths > 0) {
      fmt::print("tracer's noise: {:.1f} % of the captures' variance; {:.2f} % of the values have more than that\n",
                 100.0 * study.tracer_share, 100.0 * study.too_noisy);
    }
    for (const test::Covered& one : study.parameters) {
      fmt::print("{}: {} determined", one.name, one.determined);
      if (one.determined > 0) {
        const double of = one.determined;
        fmt::print(
            ", {} in the interval; error {:+.2g}, deviation {:.2g}, their ratio {:+.2f} on the average, rms {:.2f}",
            share(one.covered, one.determined), one.error_sum / of, one.sd_sum / of, one.z_sum / of,
            std::sqrt(one.z_square / of));
      }
      fmt::print("\n");
      covered += one.covered;
      determined += one.determined;
    }
    if (determined > 0) fmt::print("all: {}\n", share(covered, determined));
  }
  fmt::print("{:.0f} s CPU\n", static_cast<double>(std::clock()) / CLOCKS_PER_SEC);
}
