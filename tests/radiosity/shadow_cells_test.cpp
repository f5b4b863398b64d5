// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/shadow_cells.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>
#include <vector>

#include "radiosity/element_tree.h"
#include "radiosity/occluded_form_factor.h"
#include "tests/radiosity/scenes.h"

namespace interglow::radiosity {
namespace {

using testing::box_with_two_cubes;

/// Of the elements of the objects from `first_object` on.
std::vector<Polygon> polygons_of(const Elements& elements, int first_object) {
  std::vector<Polygon> polygons;
  for (int e = 0; e < static_cast<int>(elements.size()); ++e) {
    if (elements.object[static_cast<std::size_t>(e)] >= first_object) polygons.push_back(polygon_of(elements, e));
  }
  return polygons;
}

/// Pairs of patches of the box with two cubes, whose faces are cut into n x n and m x m quads.
class TwoCubes {
 public:
  TwoCubes(int n, int m)
      : elements_(make_elements(box_with_two_cubes(n, m))), tree_(elements_), patches_(polygons_of(elements_, 0)) {
    blockers_ = make_blockers(elements_, tree_.flat());
    for (const ConvexBody& body : blockers_.body) bodies_.push_back(&body);
  }

  std::size_t size() const { return patches_.size(); }

  /// How far what is visible [of the smaller area] is from the value of `form_factor` past the cubes' twelve faces: the
  /// same question asked of another method, which knows nothing of bodies, silhouettes or cells.
  double error(std::size_t i, std::size_t j, double tolerance) {
    const FormFactor whole = form_factor(patches_[i], patches_[j]);
    const FormFactor seen = form_factor(patches_[i], patches_[j], cube_faces_, 1e-3 * tolerance);
    const double smaller =
        std::min(elements_.area_mm2[static_cast<Eigen::Index>(i)], elements_.area_mm2[static_cast<Eigen::Index>(j)]);
    const ShadowResult shadow = cells_.integrate(patches_[i], patches_[j], bodies_, tolerance * smaller, tree_.flat());
    partial_ += shadow.touched && !shadow.covered ? 1 : 0;
    return std::abs((whole.value - seen.value) * elements_.area_mm2[static_cast<Eigen::Index>(i)] - shadow.hidden) /
           smaller;
  }

  int partial() const { return partial_; }

 private:
  Elements elements_;
  ElementTree tree_;
  std::vector<Polygon> patches_;
  Blockers blockers_;
  std::vector<const ConvexBody*> bodies_;
  std::vector<Polygon> cube_faces_ = polygons_of(make_elements(box_with_two_cubes(1, 1)), 1);
  ShadowCells cells_;
  int partial_ = 0;
};

// Between these, parallel edges of both cubes pass one another on the source; shadows cut the patch into a hundred
// pieces; cuts run through a common corner.
TEST(ShadowCells, EdgesThatPassOneAnotherAreSeen) {
  TwoCubes coarse(11, 5);
  TwoCubes fine(22, 10);
  for (const double tolerance : {3e-7, 3e-8}) {
    EXPECT_LE(fine.error(139, 1667, tolerance), tolerance);
    EXPECT_LE(fine.error(1667, 139, tolerance), tolerance);
    EXPECT_LE(fine.error(185, 822, tolerance), tolerance);
    EXPECT_LE(fine.error(822, 185, tolerance), tolerance);
    EXPECT_LE(coarse.error(147, 676, tolerance), tolerance);
    EXPECT_LE(coarse.error(676, 147, tolerance), tolerance);
    EXPECT_LE(coarse.error(533, 655, tolerance), tolerance);
  }
}

TEST(ShadowCells, WhatIsHiddenIsWithinTheToleranceForRandomPairs) {
  TwoCubes scene(9, 4);
  std::mt19937 random(20);
  double worst = 0.0;
  while (scene.partial() < 200) {
    const auto i = static_cast<std::size_t>(random() % scene.size());
    const auto j = static_cast<std::size_t>(random() % scene.size());
    for (const double tolerance : {1e-5, 1e-6}) {
      const double ratio = scene.error(i, j, tolerance) / tolerance;
      EXPECT_LE(ratio, 1.0) << i << " and " << j << " at " << tolerance;
      worst = std::max(worst, ratio);
    }
  }
  EXPECT_GT(worst, 1e-3);  // the estimate does not ask for far too much
}

}  // namespace
}  // namespace interglow::radiosity
