// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/form_factor_batch.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "diagnostics/error.h"
#include "radiosity/form_factor.h"
#include "tests/radiosity/form_factor_shapes.h"

namespace interglow::radiosity {
namespace {

using Eigen::Vector3d;

std::vector<std::uint32_t> all_but(std::size_t size, std::uint32_t one) {
  std::vector<std::uint32_t> others;
  for (std::uint32_t i = 0; i < size; ++i)
    if (i != one) others.push_back(i);
  return others;
}

/// Largest |row sum - 1|, each pair computed once and used for both of its rows.
double closure(const FormFactorBatch& batch, double tolerance) {
  std::vector<double> row(batch.size(), 0.0);
  std::vector<std::uint32_t> others;
  std::vector<FormFactor> results(batch.size());
  for (std::uint32_t i = 0; i < batch.size(); ++i) {
    batch.exchange_areas(i, others, tolerance, {results.data(), others.size()});
    for (std::uint32_t j = 0; j < i; ++j) {
      row[i] += results[j].value;
      row[j] += results[j].value;
    }
    others.push_back(i);
  }
  double worst = 0;
  for (std::size_t i = 0; i < row.size(); ++i) worst = std::max(worst, std::abs(row[i] / batch.area(i) - 1));
  return worst;
}

TEST(FormFactorBatch, RowsOfACubeOfSixteenPatchesPerEdgeAddUpToOne) {
  // Every row of a closed scene sums to 1; 1280 entries, each asked to 1e-14.
  EXPECT_LE(closure(FormFactorBatch(test::cube(16, false)), 1e-14), 1e-12);
}

TEST(FormFactorBatch, RowsOfACubeOfTrianglesAddUpToOne) {
  EXPECT_LE(closure(FormFactorBatch(test::cube(6, true)), 1e-14), 1e-12);
}

/// Errors of the batch over its estimates, against the contour integral at round-off, whose own estimate is granted.
struct Assessment {
  double worst = 0;  ///< largest error over estimate among errors above 1e-15 of the smaller patch
  int by_centres = 0, by_edges = 0, by_contour = 0;
};

void assess(const std::vector<Polygon>& patches, std::uint32_t step, Assessment& assessment) {
  // What the processor lacks comes out as a lesser set, and is looked at twice.
  const std::array<FormFactorBatch, 3> batches{FormFactorBatch(patches, InstructionSet::kSse2),
                                               FormFactorBatch(patches, InstructionSet::kAvx2),
                                               FormFactorBatch(patches, InstructionSet::kAvx512)};
  for (std::uint32_t i = 0; i < patches.size(); i += step) {
    const std::vector<std::uint32_t> others = all_but(patches.size(), i);
    std::vector<FormFactor> results(others.size()), reference(others.size());
    for (std::size_t k = 0; k < others.size(); ++k) reference[k] = exchange_area(patches[i], patches[others[k]], 0.0);
    for (int digits = 2; digits <= 14; ++digits) {
      const FormFactorBatch& batch = batches[(digits + i) % batches.size()];
      const double tolerance = std::pow(10.0, -digits);
      batch.exchange_areas(i, others, tolerance, results);
      for (std::size_t k = 0; k < others.size(); ++k) {
        const FormFactor& exact = reference[k];
        const double least_area = std::min(batch.area(i), batch.area(others[k]));
        const double error = std::abs(results[k].value - exact.value);
        EXPECT_LE(error, results[k].error_estimate + exact.error_estimate)
            << i << ',' << others[k] << " at " << tolerance << ' ' << name(results[k].method) << ' ' << exact.value
            << ' ' << batch.instruction_set();
        // No better than the contour integral in extended precision, and a rounding of the result may come on top.
        const double rounded = 1.001 * tolerance * least_area + std::numeric_limits<double>::epsilon() * exact.value;
        EXPECT_LE(results[k].error_estimate, std::max(rounded, 4 * exact.error_estimate))
            << i << ',' << others[k] << " at " << tolerance << ' ' << batch.instruction_set();
        if (error > 1e-15 * least_area && error > 10 * exact.error_estimate)
          assessment.worst = std::max(assessment.worst, error / results[k].error_estimate);
        assessment.by_centres += results[k].method == FormFactorMethod::kFarQuadrature;
        assessment.by_edges += results[k].method == FormFactorMethod::kEdgeQuadrature;
        assessment.by_contour += results[k].method == FormFactorMethod::kContourQuadrature;
      }
    }
  }
}

void expect_all_rules(const Assessment& assessment) {
  testing::Test::RecordProperty("largest_error_over_estimate", std::to_string(assessment.worst));
  EXPECT_GT(assessment.by_centres, 500);
  EXPECT_GT(assessment.by_edges, 5000);
  EXPECT_GT(assessment.by_contour, 500);
}

TEST(FormFactorBatch, ErrorsOfRandomPairsStayBelowTheirEstimates) {
  // At all distances, areas up to 1e4 apart, quads that are no parallelograms included. Fixed seeds: no false alarms.
  Assessment assessment;
  for (const std::uint64_t seed : {5u, 15u, 25u}) assess(test::random_patches(150, seed), 5, assessment);
  expect_all_rules(assessment);
}

TEST(FormFactorBatch, ErrorsInsideATurnedCubeStayBelowTheirEstimates) {
  // No edges at right angles to axes; all distances from touching to the far wall; of triangles and of quads.
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.7, Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  Assessment assessment;
  for (const bool triangles : {false, true})
    assess(test::transformed(test::cube(triangles ? 5 : 7, triangles),
                             [&](const Vector3d& x) -> Vector3d { return turn * x; }),
           triangles ? 11 : 9, assessment);
  expect_all_rules(assessment);
}

TEST(FormFactorBatch, ErrorsOfSmallPatchesInALargeSceneStayBelowTheirEstimates) {
  // Patches of 1e-4 ... 1e-2 of the scene's size: coordinates lose digits that the form factors need.
  Assessment assessment;
  std::vector<Polygon> patches = test::random_patches(150, 35);
  for (Polygon& patch : patches) {
    Vector3d centre = Vector3d::Zero();
    for (int k = 0; k < patch.corners; ++k) centre += patch.corner[k] / patch.corners;
    for (int k = 0; k < patch.corners; ++k) patch.corner[k] = 0.03 * centre + 0.01 * (patch.corner[k] - centre);
  }
  patches.push_back(test::quad({5, 5, 5}, {5, 6, 5}, {6, 6, 5}, {6, 5, 5}));
  assess(patches, 5, assessment);
  testing::Test::RecordProperty("largest_error_over_estimate", std::to_string(assessment.worst));
  EXPECT_GT(assessment.by_centres, 500);
  EXPECT_GT(assessment.by_edges, 500);
}

TEST(FormFactorBatch, PatchesOfAnyShapeThatStandApartTakeNoContour) {
  // Four diameters apart and more: points on edges meet every tolerance above rounding.
  std::vector<Polygon> patches;
  for (int i = 0; i < 2; ++i) {
    const auto at = [i](double u, double v) -> Vector3d { return i == 0 ? Vector3d(u, v, 0) : Vector3d(v, u, 4); };
    patches.push_back(test::triangle(at(0, 0), at(1, 0), at(0.2, 0.8)));
    patches.push_back(test::quad(at(0, 0), at(0.8, 0), at(1, 0.6), at(0.2, 0.6)));
    patches.push_back(test::quad(at(0, 0), at(1, 0), at(0.8, 0.7), at(0.1, 0.5)));
  }
  const FormFactorBatch batch(patches);
  const std::array<std::uint32_t, 3> others{3, 4, 5};
  for (std::uint32_t i = 0; i < 3; ++i)
    for (const double tolerance : {1e-4, 1e-8, 1e-12}) {
      std::array<FormFactor, 3> results;
      batch.exchange_areas(i, others, tolerance, results);
      for (const FormFactor& result : results)
        EXPECT_THAT(result.method, testing::AnyOf(FormFactorMethod::kFarQuadrature, FormFactorMethod::kEdgeQuadrature))
            << i << " at " << tolerance;
    }
}

void expect_the_same_alone(const std::vector<Polygon>& patches, double tolerance, InstructionSet most) {
  const FormFactorBatch batch(patches, most);
  for (std::uint32_t i = 0; i < patches.size(); ++i) {
    const std::vector<std::uint32_t> others = all_but(patches.size(), i);
    std::vector<FormFactor> together(others.size());
    batch.exchange_areas(i, others, tolerance, together);
    for (std::size_t k = 0; k < others.size(); ++k) {
      FormFactor alone;
      batch.exchange_areas(others[k], {&i, 1}, tolerance, {&alone, 1});
      EXPECT_EQ(alone.value, together[k].value) << i << ',' << others[k];
      EXPECT_EQ(alone.error_estimate, together[k].error_estimate);
      EXPECT_EQ(alone.method, together[k].method);
    }
  }
}

TEST(FormFactorBatch, OrderAndNeighboursChangeNoBit) {
  for (const InstructionSet most : {InstructionSet::kSse2, InstructionSet::kAvx2, InstructionSet::kAvx512}) {
    for (const double tolerance : {1e-3, 1e-6, 1e-10})
      expect_the_same_alone(test::random_patches(40, 6), tolerance, most);
    // Vectors of pairs that all take the same rule, and others.
    for (const double tolerance : {1e-4, 1e-8}) expect_the_same_alone(test::cube(4, false), tolerance, most);
  }
}

TEST(FormFactorBatch, PowerOfTwoScaleChangesNoBitAndOffsetNoDigit) {
  const std::vector<Polygon> patches = test::random_patches(40, 7);
  const FormFactorBatch batch(patches);
  const double scale = 0x1p-20;
  const FormFactorBatch small(test::transformed(patches, [&](const Vector3d& x) -> Vector3d { return scale * x; }));
  for (std::uint32_t i = 0; i < 40; ++i) {
    const std::vector<std::uint32_t> others = all_but(patches.size(), i);
    std::vector<FormFactor> as_given(others.size()), scaled(others.size());
    batch.exchange_areas(i, others, 1e-8, as_given);
    small.exchange_areas(i, others, 1e-8, scaled);
    for (std::size_t k = 0; k < others.size(); ++k)
      EXPECT_EQ(scaled[k].value, as_given[k].value * scale * scale) << i << ',' << others[k];
  }
}

TEST(FormFactorBatch, RefusesCoordinatesThatAreNotFinite) {
  std::vector<Polygon> patches = test::random_patches(3, 8);
  patches[1].corner[2].y() = std::numeric_limits<double>::quiet_NaN();
  try {
    const FormFactorBatch batch(patches);
    FAIL() << "a NaN was taken";
  } catch (const InvalidParams& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("corner 2 of polygon 1"));
  }
}

}  // namespace
}  // namespace interglow::radiosity
