// SPDX-License-Identifier: GPL-3.0-or-later
// Shares of far starts that arrive, and of 95 % intervals that hold the truth, with their binomial errors.
//   fit_study_benchmark [--starts 200] [--captures 200] [--turn 10] [--distance 0.1] [--light 5] [--quiet]
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
  double turn_deg = 10.0;
  double distance_share = 0.1;
  double light_deg = 5.0;
  bool quiet = false;
  test::StudyParams params;
  app.add_option("--starts", starts);
  app.add_option("--captures", captures);
  app.add_option("--turn", turn_deg);
  app.add_option("--distance", distance_share);
  app.add_option("--light", light_deg);
  app.add_option("--around", params.scene.around);
  app.add_option("--along", params.scene.along);
  app.add_option("--most-turn", params.mesh.most_turn_deg);
  app.add_option("--contact-halvings", params.mesh.contact_halvings);
  app.add_option("--captured-around", params.captured_around);
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
  fmt::print("turns up to {}°, {} halvings at contacts; captured twice as fine; {} px, {} bands\n",
             params.mesh.most_turn_deg, params.mesh.contact_halvings, params.scene.side_px, params.scene.bands);
  if (starts > 0) {
    const test::StartStudy study = test::study_starts(params, starts, turn_deg, distance_share, light_deg);
    fmt::print("{:.0f}° and {:.0f} % off: {} arrive\n", turn_deg, 100.0 * distance_share,
               share(study.reached, study.tried));
  }
  if (captures > 0) {
    int covered = 0;
    int determined = 0;
    for (const test::Covered& one : test::study_intervals(params, captures)) {
      fmt::print("{}: {} determined", one.name, one.determined);
      if (one.determined > 0) {
        fmt::print(", {} in the interval, rms of error / deviation {:.2f}", share(one.covered, one.determined),
                   std::sqrt(one.z_square / one.determined));
      }
      fmt::print("\n");
      covered += one.covered;
      determined += one.determined;
    }
    if (determined > 0) fmt::print("all: {}\n", share(covered, determined));
  }
  fmt::print("{:.0f} s CPU\n", static_cast<double>(std::clock()) / CLOCKS_PER_SEC);
}
