// SPDX-License-Identifier: GPL-3.0-or-later
#include "rendering/interpolation_error.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <vector>

#include "radiosity/transport.h"

namespace interglow::rendering {
namespace {

using Eigen::Vector3d;

constexpr int kSide = 9;       // points a side
constexpr double kStep = 0.5;  // mm

int at(int row, int column) { return row * kSide + column; }

struct Grid {
  std::vector<Vector3d> positions;
  std::vector<std::array<int, 3>> triangles;
};

/// Squares cut along one diagonal: every inner point has six neighbours, symmetric about it.
Grid grid() {
  Grid result;
  for (int r = 0; r < kSide; ++r) {
    for (int c = 0; c < kSide; ++c) result.positions.emplace_back(c * kStep, r * kStep, 1.0);
  }
  for (int r = 0; r + 1 < kSide; ++r) {
    for (int c = 0; c + 1 < kSide; ++c) {
      result.triangles.push_back({at(r, c), at(r, c + 1), at(r + 1, c + 1)});
      result.triangles.push_back({at(r, c), at(r + 1, c + 1), at(r + 1, c)});
    }
  }
  return result;
}

radiosity::RowMatrix sampled(const Grid& grid, const std::vector<std::function<double(double, double)>>& channels) {
  radiosity::RowMatrix values(static_cast<Eigen::Index>(grid.positions.size()),
                              static_cast<Eigen::Index>(channels.size()));
  for (std::size_t p = 0; p < grid.positions.size(); ++p) {
    for (std::size_t c = 0; c < channels.size(); ++c) {
      values(static_cast<Eigen::Index>(p), static_cast<Eigen::Index>(c)) =
          channels[c](grid.positions[p].x(), grid.positions[p].y());
    }
  }
  return values;
}

TEST(InterpolationError, OfALinearFunctionIsZero) {
  const Grid g = grid();
  const radiosity::RowMatrix values = sampled(g, {[](double x, double y) { return 3.0 - 2.0 * x + 0.7 * y; }});
  const InterpolationError error(g.positions, values, g.triangles, Eigen::VectorXd::Ones(1));
  for (int c = 1; c + 2 < kSide; ++c) EXPECT_NEAR(error.at_middle(at(4, c), at(4, c + 1)), 0.0, 1e-14) << c;
}

// On symmetric neighbours the fitted slopes of a quadratic are exact, and its error at the middle of an edge d is
// |dᵀ (second derivatives) d| / 8.
TEST(InterpolationError, OfAQuadraticIsExactAndChannelsAddWithTheirWeights) {
  const Grid g = grid();
  const radiosity::RowMatrix values =
      sampled(g, {[](double x, double y) { return 1.5 * x * x + y; }, [](double x, double y) { return -x * y; }});
  Eigen::VectorXd weight(2);
  weight << 2.0, 5.0;
  const InterpolationError error(g.positions, values, g.triangles, weight);
  for (int k = 2; k + 3 < kSide; ++k) {
    EXPECT_NEAR(error.at_middle(at(4, k), at(4, k + 1)), 2.0 * 3.0 * kStep * kStep / 8, 1e-13) << k;
    EXPECT_NEAR(error.at_middle(at(k, 4), at(k + 1, 4)), 0.0, 1e-13) << k;
    EXPECT_NEAR(error.at_middle(at(k, k), at(k + 1, k + 1)), (2.0 * 3.0 + 5.0 * 2.0) * kStep * kStep / 8, 1e-13) << k;
  }
}

// |x - k| between the points k - 1/2 and k + 1/2 steps: linear interpolation is half a step too high at the kink; the
// fitted slopes at its ends, which see both branches, explain a quarter of it.
TEST(InterpolationError, SeesAKinkBetweenTwoPoints) {
  const Grid g = grid();
  const double kink = 3.5 * kStep;
  const radiosity::RowMatrix values = sampled(g, {[&](double x, double) { return std::abs(x - kink); }});
  const InterpolationError error(g.positions, values, g.triangles, Eigen::VectorXd::Ones(1));
  const double actual = 0.5 * kStep;
  EXPECT_GT(error.at_middle(at(4, 3), at(4, 4)), 0.2 * actual);
  EXPECT_NEAR(error.at_middle(at(4, 6), at(4, 7)), 0.0, 1e-14);
}

TEST(InterpolationError, IsUnknownWhereTheSlopeWouldFollowFromTheEdgeItself) {
  const Grid g = grid();
  const radiosity::RowMatrix values = sampled(g, {[](double x, double y) { return x * y; }});
  const InterpolationError error(g.positions, values, g.triangles, Eigen::VectorXd::Ones(1));
  EXPECT_TRUE(std::isinf(error.at_middle(at(0, 0), at(0, 1))));
  EXPECT_TRUE(std::isinf(error.at_middle(at(0, kSide - 1), at(1, kSide - 1))));
}

}  // namespace
}  // namespace interglow::rendering
