// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/transport.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "diagnostics/error.h"
#include "radiosity/transport_assembly.h"
#include "tests/radiosity/scenes.h"

namespace interglow::radiosity {
namespace {

using testing::box_with_two_cubes;
using testing::cube;
using testing::object;

scene::Scene closed_cube(int n) {
  scene::Scene scene;
  scene.objects.push_back(object("cube", cube(1.0, n, true)));
  return scene;
}

Eigen::MatrixXd dense(const Transport& transport) {
  return transport.apply(RowMatrix::Identity(transport.size(), transport.size()));
}

TEST(Transport, FacesOfACubeHaveTheTabulatedFactors) {
  const Transport transport = Transport::build(make_elements(closed_cube(1)), {.tolerance = 1e-10});
  // Opposite unit squares at distance 1 and unit squares with a shared edge at 90 degrees (Howell, C-11 and C-14).
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) {
      const double expected = i == j ? 0.0 : i / 2 == j / 2 ? 0.19982489569838737 : 0.20004377607540316;
      EXPECT_NEAR(transport.form_factor(i, j), expected, 1e-10) << i << ", " << j;
    }
  }
}

TEST(Transport, AFinerCubeAddsUpToItsFaces) {
  const int n = 4;
  const Transport transport = Transport::build(make_elements(closed_cube(n)), {.tolerance = 1e-8});
  RowMatrix second_face = RowMatrix::Zero(transport.size(), 1);
  second_face.block(n * n, 0, n * n, 1).setOnes();
  EXPECT_NEAR(transport.apply(second_face).block(0, 0, n * n, 1).mean(), 0.19982489569838737, 1e-9);
  EXPECT_EQ(transport.report().blocked_pairs, 0);
  EXPECT_EQ(transport.report().partially_visible_pairs, 0);
  EXPECT_LT(transport.report().closure_max, 1e-8);
}

TEST(Transport, AClosedBoxWithObstaclesClosesWithinTheErrorEstimate) {
  const Elements elements = make_elements(box_with_two_cubes(6, 2));
  for (const double tolerance : {1e-3, 1e-4}) {
    const Transport transport = Transport::build(elements, {.tolerance = tolerance});
    const TransportReport& report = transport.report();
    EXPECT_LT(report.closure_max, tolerance);
    EXPECT_LT(report.closure_max, report.error_estimate_max) << tolerance;
    EXPECT_GT(report.partially_visible_pairs, 1000);
    EXPECT_GT(report.blocked_pairs, 100);
  }
}

/// By row: |sum of the factors - 1| over the row's error estimate.
Eigen::VectorXd closure_over_estimate(const Elements& elements, double tolerance) {
  const Assembly assembly = assemble(elements, {.tolerance = tolerance}, {});
  const RowMatrix sums = assembly.exchange.multiply(RowMatrix::Ones(elements.size(), 1));
  return (sums.col(0).cwiseQuotient(elements.area_mm2).array() - 1.0).abs() / assembly.error_estimate.array();
}

// Rules err in one direction; lines stay within all rows' estimates with a probability of 99 %, and their seeds are
// fixed.
TEST(Transport, EveryRowOfClosedScenesClosesWithinItsEstimate) {
  for (const double tolerance : {1e-2, 1e-3, 1e-4, 1e-5}) {
    const Eigen::VectorXd few = closure_over_estimate(make_elements(box_with_two_cubes(6, 2)), tolerance);
    EXPECT_LE(few.maxCoeff(), 1.0) << tolerance;
  }
  for (const double tolerance : {1e-2, 1e-3}) {
    const Eigen::VectorXd many = closure_over_estimate(make_elements(testing::lumpy_solid_in_box(4, 4)), tolerance);
    EXPECT_LE(many.maxCoeff(), 1.0) << tolerance;
    // Nor is the estimate far above what there is.
    EXPECT_GE(many.maxCoeff(), 0.05) << tolerance;
  }
}

TEST(Transport, ClosureMeetsTheToleranceAmongManySmallBlockers) {
  const TransportReport report =
      Transport::build(make_elements(testing::lumpy_solid_in_box(4, 4)), {.tolerance = 1e-3}).report();
  EXPECT_LE(report.closure_max, 1e-3);
  EXPECT_GT(report.partially_visible_pairs, 3000);
}

TEST(Transport, IsReciprocalToTheBit) {
  const Elements elements = make_elements(box_with_two_cubes(3, 1));
  const Transport transport = Transport::build(elements, {.tolerance = 0.1});
  const Eigen::MatrixXd f = dense(transport);
  for (Eigen::Index i = 0; i < f.rows(); ++i) {
    for (Eigen::Index j = 0; j < f.rows(); ++j) {
      EXPECT_NEAR(f(i, j), transport.form_factor(i, j), 1e-16);
      // The same exchange area divided by each area: two roundings a side.
      EXPECT_LE(std::abs(elements.area_mm2[i] * f(i, j) - elements.area_mm2[j] * f(j, i)),
                4.5e-16 * elements.area_mm2[i] * f(i, j));
    }
  }
}

TEST(Transport, HasTheSameBitsForAnyNumberOfThreads) {
  const Elements elements = make_elements(box_with_two_cubes(4, 1));
  const RowMatrix x = RowMatrix::Random(elements.size(), 19);
  const auto run = [&](std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return Transport::build(elements, {.tolerance = 0.1}).apply(x);
  };
  const RowMatrix one = run(1);
  EXPECT_TRUE(one == run(2));
  EXPECT_TRUE(one == run(2));
}

TEST(Transport, DoesNotDependOnTheUnitOfLength) {
  scene::Scene scene = box_with_two_cubes(3, 1);
  const Eigen::MatrixXd expected = dense(Transport::build(make_elements(scene), {.tolerance = 1e-4}));
  for (const double scale : {1e-6, 1e6}) {
    scene::Scene scaled = scene;
    for (scene::Object& each : scaled.objects) {
      for (Eigen::Vector3d& p : each.patches.points) p *= scale;
    }
    const Eigen::MatrixXd found = dense(Transport::build(make_elements(scaled), {.tolerance = 1e-4}));
    // Powers of ten round the corners, so a cell may be cut once more or less: both are within the tolerance of an
    // entry.
    EXPECT_LT((found - expected).cwiseAbs().maxCoeff(), 2.0 * 1e-4 / std::sqrt(66.0)) << scale;
  }
}

TEST(Transport, BothSidesOfASheetTakePart) {
  // A square sheet between two unit squares hides them from one another, and each side of it sees its own.
  scene::Scene scene;
  const auto square = [](double z, bool up) {
    mesh::PatchMesh patches;
    testing::add_grid(patches, {0, 0, z}, up ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY(),
                      up ? Eigen::Vector3d::UnitY() : Eigen::Vector3d::UnitX(), 1, 1);
    return patches;
  };
  scene.objects = {object("floor", square(0, true)), object("sheet", square(1, true)),
                   object("ceiling", square(2, false))};
  scene.objects[1].sides = scene::Sides::kTwo;
  const Elements elements = make_elements(scene);
  const Transport transport = Transport::build(elements, {.tolerance = 1e-8});
  const int sheet_back = elements.back_element[1];
  EXPECT_NEAR(transport.form_factor(0, sheet_back), 0.19982489569838737, 1e-9);
  EXPECT_NEAR(transport.form_factor(2, 1), 0.19982489569838737, 1e-9);
  EXPECT_EQ(transport.form_factor(0, 2), 0.0);
  EXPECT_EQ(transport.form_factor(0, 1), 0.0);
}

// However low it lies, what is over a patch hides it; with few blockers, and with so many that they are searched.
TEST(Transport, AFoilThatNearlyTouchesAFloorHidesIt) {
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX(), y = Eigen::Vector3d::UnitY();
  const auto rectangle = [](const Eigen::Vector3d& corner, const Eigen::Vector3d& u, const Eigen::Vector3d& v) {
    mesh::PatchMesh made;
    testing::add_grid(made, corner, u, v, 1, 1);
    return made;
  };
  const double whole = 0.19982489569838737;  // opposite unit squares at distance 1 (Howell, C-11)
  struct Case {
    int others;
    double tolerance;
    std::vector<double> gaps;
  };
  // Lines know no gaps below single precision.
  for (const auto& [others, tolerance, gaps] : {Case{0, 1e-4, {1e-3, 4e-6, 1e-8, 1e-11}}, Case{70, 1e-3, {1e-3, 1e-4}}})
    for (const double gap : gaps) {
      scene::Scene scene;
      scene.objects = {object("floor", rectangle({0, 0, 0}, x, y)), object("ceiling", rectangle({0, 0, 1}, y, x)),
                       object("foil", rectangle({0.1, 0.2, gap}, 0.5 * x, 0.6 * y))};
      scene.objects[2].sides = scene::Sides::kTwo;
      for (int k = 0; k < others; ++k)  // below the floor, each a body
        scene.objects.push_back(object("other", rectangle({0.1 * k, 0.0, -2.0 - 0.1 * k}, 0.05 * y, 0.05 * x)));
      const Transport part = Transport::build(make_elements(scene), {.tolerance = tolerance});
      // The shadow's border moves by no more than twice the gap.
      EXPECT_NEAR(part.form_factor(1, 0), whole - part.form_factor(1, 2), tolerance + 2 * gap) << gap << ' ' << others;
      // Its corners lie beside the floor.
      scene.objects[2].patches = rectangle({-0.4, -0.3, gap}, 1.6 * x, 1.7 * y);
      const Transport all = Transport::build(make_elements(scene), {.tolerance = tolerance});
      EXPECT_NEAR(all.form_factor(1, 0), 0.0, tolerance) << gap << ' ' << others;
    }
}

TEST(Transport, SmoothingClosesTheRowsKeepsReciprocityAndSaysWhatItChanged) {
  const Elements elements = make_elements(box_with_two_cubes(3, 1));
  const Transport raw = Transport::build(elements, {.tolerance = 1e-2});
  const Transport smooth = Transport::build(elements, {.tolerance = 1e-2, .smooth_closure = true});
  ASSERT_GT(raw.report().closure_max, 1e-6);
  EXPECT_LT(smooth.report().closure_max, 1e-12);
  EXPECT_EQ(raw.report().smoothing_change_max, 0.0);
  const Eigen::MatrixXd f = dense(smooth);
  const Eigen::MatrixXd exchange = elements.area_mm2.asDiagonal() * f;
  EXPECT_LT((exchange - exchange.transpose()).cwiseAbs().maxCoeff(), 1e-12 * exchange.maxCoeff());
  EXPECT_GE(f.minCoeff(), 0.0);
  EXPECT_NEAR((f - dense(raw)).cwiseAbs().maxCoeff(), smooth.report().smoothing_change_max, 1e-15);
}

TEST(Transport, AnOpenSceneIsNotSmoothed) {
  scene::Scene scene = closed_cube(1);
  scene.objects[0].patches.faces.resize(2);
  scene.objects[0].patches.closed = false;
  try {
    Transport::build(make_elements(scene), {.smooth_closure = true});
    FAIL();
  } catch (const InvalidParams& error) {
    EXPECT_NE(std::string(error.what()).find("smooth_closure"), std::string::npos) << error.what();
  }
}

// The two sides of a face see nothing of one another, and that is known exactly, although rounding puts each in front
// of the other where the face is oblique.
TEST(Transport, SidesOfAnObliqueFaceAddNoError) {
  scene::Scene scene;
  scene.materials = {{"grey", {Eigen::VectorXd::Constant(1, 0.5), {}}}};
  mesh::PatchMesh sheet;
  const Eigen::Vector3d u(-0.83, 0.11, 1.31);
  const Eigen::Vector3d v(0.17, 0.71, -0.29);
  for (int row = 0; row <= 6; ++row) {
    for (int column = 0; column <= 6; ++column) sheet.points.push_back(row * u + column * v);
  }
  for (int row = 0; row < 6; ++row) {
    for (int column = 0; column < 6; ++column) {
      const int corner = 7 * row + column;
      sheet.faces.push_back({corner, corner + 7, corner + 8, corner + 1});
    }
  }
  scene.objects.push_back({.name = "sheet", .patches = sheet});
  const auto transport = Transport::build(make_elements(scene), {.tolerance = 1e-6});
  EXPECT_LE(transport.report().error_estimate_max, 1e-6);
  EXPECT_LE(transport.report().max_row_sum, 1e-6);
}

TEST(Transport, RefusesAToleranceOutOfRange) {
  try {
    Transport::build(make_elements(closed_cube(1)), {.tolerance = 0.5});
    FAIL();
  } catch (const InvalidParams& error) {
    EXPECT_NE(std::string(error.what()).find("tolerance: 0.5"), std::string::npos) << error.what();
  }
}

TEST(Transport, AnEmptySceneIsAnEmptyOperator) {
  const Transport transport = Transport::build(make_elements(scene::Scene{}), {});
  EXPECT_EQ(transport.size(), 0);
  EXPECT_EQ(transport.apply(RowMatrix(0, 3)).rows(), 0);
}

}  // namespace
}  // namespace interglow::radiosity
