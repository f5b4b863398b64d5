// SPDX-License-Identifier: GPL-3.0-or-later
#include "spectral/wavelength_grid.h"

#include <gtest/gtest.h>

#include "diagnostics/error.h"

namespace interglow::spectral {
namespace {

TEST(WavelengthGrid, UniformGridHas71BandsOf5Nm) {
  const WavelengthGrid grid = WavelengthGrid::uniform(350, 700, 5);
  ASSERT_EQ(grid.size(), 71);
  EXPECT_DOUBLE_EQ(grid.center_nm(10), 400.0);
  EXPECT_DOUBLE_EQ(grid.lower_edge_nm(0), 347.5);
  EXPECT_DOUBLE_EQ(grid.widths_nm().sum(), 355.0);
}

TEST(WavelengthGrid, NeighboursShareAnEdge) {
  const WavelengthGrid grid = WavelengthGrid::from_centers(Eigen::Vector3d(400, 410, 440));
  EXPECT_DOUBLE_EQ(grid.upper_edge_nm(1), 425.0);
  EXPECT_DOUBLE_EQ(grid.width_nm(2), 30.0);
}

TEST(WavelengthGrid, RefusesWhatIsNoGrid) {
  EXPECT_THROW(WavelengthGrid::uniform(400, 700, 7), InvalidParams);
  EXPECT_THROW(WavelengthGrid::uniform(700, 400, 5), InvalidParams);
  EXPECT_THROW(WavelengthGrid::from_centers(Eigen::Vector2d(500, 500)), InvalidParams);
}

}  // namespace
}  // namespace interglow::spectral
