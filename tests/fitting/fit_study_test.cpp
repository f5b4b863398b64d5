// SPDX-License-Identifier: GPL-3.0-or-later
// The studies of bench/fit_study_benchmark at small size.
#include "fit_study.h"

#include <gtest/gtest.h>

namespace interglow::test {
namespace {

StudyParams small() {
  StudyParams params;
  params.scene = {.around = 8, .along = 2, .bands = 3, .side_px = 16, .fluorescent = false};
  params.mesh = {.most_turn_deg = 15.0, .contact_halvings = 1};
  params.captured_around = 10;
  return params;
}

// If 90 % of intervals hold the truth, 13 or fewer of 20 do with a chance of 0.24 %; if 95 %, of 3e-5.
TEST(FitStudy, IntervalsHoldTheTruth) {
  for (const Covered& one : study_intervals(small(), 0, 20).parameters) {
    if (one.name != "w/w'" && one.name != "light, across" && one.name != "camera turn about its viewing axis") continue;
    EXPECT_EQ(one.determined, 20) << one.name;
    EXPECT_GE(one.covered, 14) << one.name;
  }
}

// If 95 % of starts arrive, 3 or fewer of 6 do with a chance of 0.22 %.
TEST(FitStudy, FarStartsArrive) { EXPECT_GE(study_starts(small(), 6, 10.0, 0.1, 5.0).reached, 4); }

}  // namespace
}  // namespace interglow::test
