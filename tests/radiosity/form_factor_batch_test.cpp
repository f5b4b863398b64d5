// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/form_factor_batch.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

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

TEST(FormFactorBatch, AgreesWithTheContourIntegralWithinItsEstimate) {
  // Random patches at all distances, quads that are no parallelograms included; the contour integral is good to 1e-14.
  const std::vector<Polygon> patches = test::random_patches(120, 5);
  const FormFactorBatch batch(patches);
  int far = 0;
  for (std::uint32_t i = 0; i < 24; ++i) {
    const std::vector<std::uint32_t> others = all_but(patches.size(), i);
    std::vector<FormFactor> results(others.size()), reference(others.size());
    for (std::size_t k = 0; k < others.size(); ++k) reference[k] = exchange_area(patches[i], patches[others[k]], 0.0);
    for (const double tolerance : {1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12}) {
      batch.exchange_areas(i, others, tolerance, results);
      for (std::size_t k = 0; k < others.size(); ++k) {
        const FormFactor& exact = reference[k];
        const double least_area = std::min(batch.area(i), batch.area(others[k]));
        EXPECT_LE(std::abs(results[k].value - exact.value), results[k].error_estimate + exact.error_estimate)
            << i << ',' << others[k] << " at " << tolerance << ' ' << name(results[k].method) << ' ' << exact.value;
        EXPECT_LE(results[k].error_estimate, 1.001 * tolerance * least_area)
            << i << ',' << others[k] << " at " << tolerance;
        far += results[k].method == FormFactorMethod::kFarQuadrature;
      }
    }
  }
  EXPECT_GT(far, 1000);  // or the test would compare the contour integral with itself
}

TEST(FormFactorBatch, OrderAndNeighboursChangeNoBit) {
  const std::vector<Polygon> patches = test::random_patches(60, 6);
  const FormFactorBatch batch(patches);
  for (std::uint32_t i = 0; i < 60; ++i) {
    const std::vector<std::uint32_t> others = all_but(patches.size(), i);
    std::vector<FormFactor> together(others.size());
    batch.exchange_areas(i, others, 1e-6, together);
    for (std::size_t k = 0; k < others.size(); ++k) {
      FormFactor alone;
      batch.exchange_areas(others[k], {&i, 1}, 1e-6, {&alone, 1});
      EXPECT_EQ(alone.value, together[k].value) << i << ',' << others[k];
      EXPECT_EQ(alone.error_estimate, together[k].error_estimate);
      EXPECT_EQ(alone.method, together[k].method);
    }
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
