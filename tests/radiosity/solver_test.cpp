// SPDX-License-Identifier: GPL-3.0-or-later
// Properties of the solver on random systems, against dense elimination of the whole bispectral system.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <Eigen/LU>
#include <cmath>
#include <cstring>
#include <random>
#include <string>

#include "diagnostics/error.h"
#include "radiosity/solution.h"

namespace interglow::radiosity {
namespace {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

struct System {
  Matrix F;
  Vector area;
  std::vector<spectral::Material> materials;
  std::vector<int> element_material;
  RowMatrix direct;

  Transport transport() const { return Transport::from_form_factors(F, area); }
  Matrix donaldson(std::size_t element) const {
    const Eigen::Index bands = direct.cols();
    if (element_material[element] < 0) return Matrix::Zero(bands, bands);
    const spectral::DonaldsonMatrix& d = materials[static_cast<std::size_t>(element_material[element])].donaldson;
    Matrix D = d.reflectance.asDiagonal();
    if (d.luminesces()) D += d.luminescence;
    return D;
  }
};

/// Random areas, a random symmetric exchange with row sums up to `row_sum`, and light of rank two.
System random_system(Eigen::Index elements, Eigen::Index bands, int materials, double row_sum,
                     std::mt19937_64& random) {
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  System system;
  system.area = Vector::NullaryExpr(elements, [&] { return 0.2 + uniform(random); });
  Matrix G = Matrix::Zero(elements, elements);
  for (Eigen::Index i = 0; i < elements; ++i) {
    for (Eigen::Index j = 0; j < i; ++j) {
      // A third of the pairs see one another, few of them well.
      if (uniform(random) < 1.0 / 3.0)
        G(i, j) = G(j, i) = std::pow(uniform(random), 4.0) * std::min(system.area[i], system.area[j]);
    }
  }
  const double largest = (G.rowwise().sum().array() / system.area.array()).maxCoeff();
  system.F = system.area.cwiseInverse().asDiagonal() * G * (row_sum / largest);
  for (int m = 0; m < materials; ++m) {
    const Vector reflectance = Vector::NullaryExpr(bands, [&] { return 0.95 * uniform(random); });
    system.materials.push_back({"m" + std::to_string(m), {reflectance, {}}});
  }
  for (Eigen::Index i = 0; i < elements; ++i)
    system.element_material.push_back(static_cast<int>(i % (materials + 1)) - 1);
  const auto random_matrix = [&](Eigen::Index rows, Eigen::Index columns) {
    return Matrix::NullaryExpr(rows, columns, [&] { return uniform(random); }).eval();
  };
  system.direct = random_matrix(elements, 2) * random_matrix(2, bands);
  return system;
}

/// Full-rank luminescence with noise below zero and anti-Stokes entries; every column emits at most `share`.
Matrix noisy_luminescence(Eigen::Index bands, double share, std::mt19937_64& random) {
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  Matrix D = Matrix::NullaryExpr(bands, bands, [&] { return uniform(random) - 0.05; });
  for (Eigen::Index r = 0; r < bands; ++r) {
    for (Eigen::Index c = r; c < bands; ++c) D(r, c) = r == c ? 0.0 : 0.2 * D(r, c);
  }
  return D * (share / D.cwiseAbs().colwise().sum().maxCoeff());
}

/// H of the whole system (I - F D) H = E by elimination; unknowns ordered element by element.
RowMatrix eliminate(const System& system) {
  const Eigen::Index n = system.direct.rows(), bands = system.direct.cols();
  Matrix A = Matrix::Identity(n * bands, n * bands);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      if (system.F(i, j) != 0.0)
        A.block(i * bands, j * bands, bands, bands) -= system.F(i, j) * system.donaldson(static_cast<std::size_t>(j));
    }
  }
  const Vector H = A.partialPivLu().solve(Eigen::Map<const Vector>(system.direct.data(), n * bands));
  return Eigen::Map<const RowMatrix>(H.data(), n, bands);
}

RowMatrix whole(const Solution& solution) {
  RowMatrix sum = solution.direct + solution.reflected;
  if (solution.luminescent.size() > 0) sum += solution.luminescent;
  return sum;
}

double largest_difference(const RowMatrix& a, const RowMatrix& b) { return (a - b).cwiseAbs().maxCoeff(); }

TEST(Solver, MeetsEliminationForAnyDonaldsonMatrix) {
  std::mt19937_64 random(1);
  for (const int materials : {1, 2, 5}) {
    System system = random_system(150, 6, materials, 0.95, random);
    for (std::size_t m = 0; m < system.materials.size(); m += 2) {
      spectral::DonaldsonMatrix& d = system.materials[m].donaldson;
      d.luminescence = noisy_luminescence(6, 1.0, random);
      d.reflectance *= 0.5;
    }
    const RowMatrix exact = eliminate(system);
    const Solution solution =
        solve(system.transport(), system.materials, system.element_material, system.direct, {.tolerance = 1e-13});
    EXPECT_TRUE(solution.converged);
    EXPECT_LE(largest_difference(whole(solution), exact), 1e-11 * exact.maxCoeff()) << materials << " materials";

    System dark = system;  // the reflected history is the solution without luminescence
    for (spectral::Material& material : dark.materials) material.donaldson.luminescence.resize(0, 0);
    EXPECT_LE(largest_difference(solution.direct + solution.reflected, eliminate(dark)), 1e-11 * exact.maxCoeff());
  }
}

TEST(Solver, ErrorFollowsTheToleranceAskedFor) {
  std::mt19937_64 random(2);
  System system = random_system(300, 4, 3, 0.99, random);
  for (spectral::Material& material : system.materials) material.donaldson.reflectance.array() += 0.04;
  const RowMatrix exact = eliminate(system);
  // |H - exact| <= |residual| / (1 - ρ) with ρ < 0.99, norms weighted by area and reflectance: a factor of 100 and the
  // spread of the weights, 10.
  for (const double tolerance : {1e-3, 1e-6, 1e-9, 1e-12}) {
    const Solution solution =
        solve(system.transport(), system.materials, system.element_material, system.direct, {.tolerance = tolerance});
    EXPECT_TRUE(solution.converged);
    EXPECT_LE(solution.relative_residual, tolerance);
    EXPECT_LE((whole(solution) - exact).norm(), 1e3 * tolerance * exact.norm()) << tolerance;
  }
}

TEST(Solver, BouncesAreProductsWithF) {
  std::mt19937_64 random(3);
  System system = random_system(120, 5, 3, 0.9, random);
  system.materials[1].donaldson.luminescence = noisy_luminescence(5, 0.6, random);
  const Transport transport = system.transport();
  RowMatrix H = system.direct;
  for (int n = 0; n <= 4; ++n) {
    const Solution solution =
        solve(transport, system.materials, system.element_material, system.direct, {.bounces = n});
    EXPECT_EQ(solution.iterations, n);
    EXPECT_LE(largest_difference(whole(solution), H), 1e-13 * H.maxCoeff()) << n << " bounces";
    RowMatrix source(H.rows(), H.cols());
    for (Eigen::Index i = 0; i < H.rows(); ++i)
      source.row(i) = H.row(i) * system.donaldson(static_cast<std::size_t>(i)).transpose();
    H = system.direct + system.F * source;
  }
}

TEST(Solver, SourcesGatheredGiveTheIrradianceOfTheirHistory) {
  std::mt19937_64 random(4);
  System system = random_system(200, 4, 2, 0.9, random);
  system.materials[0].donaldson.luminescence = noisy_luminescence(4, 0.5, random);
  for (const std::optional<int> bounces : {std::optional<int>(2), std::optional<int>()}) {
    const Solution solution =
        solve(system.transport(), system.materials, system.element_material, system.direct, {.bounces = bounces});
    EXPECT_LE(largest_difference(system.F * solution.reflected_source, solution.reflected),
              1e-14 * solution.reflected.maxCoeff());
    EXPECT_LE(largest_difference(system.F * solution.luminescent_source, solution.luminescent),
              1e-14 * solution.reflected.maxCoeff());
  }
}

TEST(Solver, ComponentsAddUpToTheRadiosity) {
  std::mt19937_64 random(5);
  System system = random_system(100, 7, 3, 0.9, random);
  system.materials[2].donaldson.luminescence = noisy_luminescence(7, 0.5, random);
  const Solution solution = solve(system.transport(), system.materials, system.element_material, system.direct, {});
  const Components parts = components(solution, system.materials, system.element_material);
  const RowMatrix H = whole(solution);
  RowMatrix B(H.rows(), H.cols());
  for (Eigen::Index i = 0; i < H.rows(); ++i)
    B.row(i) = H.row(i) * system.donaldson(static_cast<std::size_t>(i)).transpose();
  EXPECT_LE(largest_difference(parts.re + parts.rr + parts.le + parts.lr + parts.ll + parts.rl, B),
            4e-15 * B.maxCoeff());
}

TEST(Solver, RankOneLuminescenceIsTheMatrixProduct) {
  // α β^T below the diagonal, given as a full matrix, and the same with one entry off: both against the plain product.
  const Eigen::Index bands = 9;
  Vector alpha = Vector::LinSpaced(bands, -0.1, 0.9), beta = Vector::LinSpaced(bands, 1.0, -0.2);
  alpha[3] = 0.0;
  Matrix D = Matrix::Zero(bands, bands);
  for (Eigen::Index r = 0; r < bands; ++r) D.row(r).head(r) = alpha[r] * beta.head(r).transpose();
  Matrix off = D;
  off(6, 2) *= 1.5;
  Matrix anti_stokes = D;
  anti_stokes(1, 5) = 0.25;
  std::mt19937_64 random(6);
  const RowMatrix H = random_system(30, bands, 1, 0.5, random).direct;
  for (const Matrix& L : {D, off, anti_stokes}) {
    const std::vector<spectral::Material> materials = {{"rank one", {Vector::Zero(bands), L}}};
    EXPECT_LE(largest_difference(luminesce(H, materials, std::vector<int>(30, 0)), H * L.transpose()), 1e-14);
  }
}

/// A closed scene of random areas in which every element sees the whole: F_ij = area share.
System closed_room(Eigen::Index elements, Eigen::Index bands, std::mt19937_64& random) {
  System system = random_system(elements, bands, 1, 0.9, random);
  system.area /= system.area.sum();
  system.F = Vector::Ones(elements) * system.area.transpose();
  system.element_material.assign(static_cast<std::size_t>(elements), 0);
  return system;
}

TEST(Solver, WhiteClosedBoxHasRadiosityMOverOneMinusRho) {
  std::mt19937_64 random(7);
  System system = closed_room(40, 3, random);
  system.materials[0].donaldson.reflectance << 0.2, 0.9, 0.999;
  // Uniform exitance M = 1 shines on everything with irradiance F M = 1.
  system.direct.setOnes();
  const Solution solution =
      solve(system.transport(), system.materials, system.element_material, system.direct, {.tolerance = 1e-14});
  for (Eigen::Index b = 0; b < 3; ++b) {
    const double rho = system.materials[0].donaldson.reflectance[b];
    const Vector B = Vector::Ones(40) + rho * whole(solution).col(b);
    EXPECT_LE((B.array() - 1.0 / (1.0 - rho)).abs().maxCoeff(), 1e-13 / ((1.0 - rho) * (1.0 - rho)));
  }
}

TEST(Solver, UniformClosedSceneSolvesTheSpectralSystem) {
  // Same D everywhere and uniform exitance M: B = (I - D)^-1 M, with full-rank D.
  std::mt19937_64 random(8);
  const Eigen::Index bands = 12;
  System system = closed_room(25, bands, random);
  system.materials[0].donaldson.luminescence = noisy_luminescence(bands, 0.4, random);
  system.materials[0].donaldson.reflectance *= 0.5;
  const Vector M = Vector::LinSpaced(bands, 0.5, 3.0);
  system.direct = Vector::Ones(25) * M.transpose();
  const Solution solution =
      solve(system.transport(), system.materials, system.element_material, system.direct, {.tolerance = 1e-14});
  const Matrix D = system.donaldson(0);
  const Vector exact = (Matrix::Identity(bands, bands) - D).partialPivLu().solve(M);
  for (Eigen::Index i = 0; i < 25; ++i) {
    const Vector B = M + D * whole(solution).row(i).transpose();
    EXPECT_LE((B - exact).cwiseAbs().maxCoeff(), 1e-12 * exact.maxCoeff()) << i;
  }
}

TEST(Solver, OneBounceIsAllWhereReflectedLightIsAbsorbed) {
  // Lit elements reflect to black ones only.
  std::mt19937_64 random(9);
  System system = random_system(80, 4, 1, 0.9, random);
  for (Eigen::Index i = 0; i < 80; ++i) {
    for (Eigen::Index j = 0; j < 80; ++j) {
      if (system.element_material[static_cast<std::size_t>(i)] == system.element_material[static_cast<std::size_t>(j)])
        system.F(i, j) = 0.0;
    }
  }
  const Solution one =
      solve(system.transport(), system.materials, system.element_material, system.direct, {.bounces = 1});
  const Solution all = solve(system.transport(), system.materials, system.element_material, system.direct, {});
  EXPECT_LE(largest_difference(one.reflected, all.reflected), 1e-15 * all.reflected.maxCoeff());
  EXPECT_GT(one.reflected.maxCoeff(), 0.0);
}

TEST(Solver, GreySceneCostsOneColumnAProductAndDarkBandsNothing) {
  std::mt19937_64 random(10);
  System system = random_system(200, 71, 2, 0.9, random);
  for (spectral::Material& material : system.materials)
    material.donaldson.reflectance.setConstant(material.donaldson.reflectance[0]);
  system.direct = (system.direct.col(0) * Vector::LinSpaced(71, 1.0, 2.0).transpose()).eval();
  const Solution grey =
      solve(system.transport(), system.materials, system.element_material, system.direct, {.bounces = 3});
  EXPECT_EQ(grey.columns, 3 * 2);  // one for each of the two materials
  system.direct.setZero();
  const Solution dark = solve(system.transport(), system.materials, system.element_material, system.direct, {});
  EXPECT_EQ(dark.columns, 0);
  EXPECT_TRUE(dark.converged);
  EXPECT_EQ(dark.reflected.cwiseAbs().maxCoeff(), 0.0);
}

TEST(Solver, RefusesLuminescenceThatFeedsItself) {
  // A closed room whose material turns each band into 1.1 times as much of the other.
  std::mt19937_64 random(11);
  System system = closed_room(10, 2, random);
  system.materials[0].donaldson.reflectance.setZero();
  system.materials[0].donaldson.luminescence = Matrix{{0.0, 1.1}, {1.1, 0.0}};
  try {
    solve(system.transport(), system.materials, system.element_material, system.direct, {});
    FAIL() << "a number came out of a diverging series";
  } catch (const NumericalFailure& failure) {
    EXPECT_NE(std::string(failure.what()).find("generation"), std::string::npos) << failure.what();
  }
}

TEST(Solver, SaysWhenItDidNotConverge) {
  std::mt19937_64 random(12);
  const System system = random_system(200, 5, 3, 0.99, random);
  const Solution solution = solve(system.transport(), system.materials, system.element_material, system.direct,
                                  {.tolerance = 1e-12, .max_iterations = 2});
  EXPECT_FALSE(solution.converged);
  EXPECT_GT(solution.relative_residual, 1e-12);
}

TEST(Solver, SameBitsForAnyNumberOfThreads) {
  std::mt19937_64 random(13);
  System system = random_system(1400, 5, 3, 0.9, random);
  system.materials[0].donaldson.luminescence = noisy_luminescence(5, 0.5, random);
  const Transport transport = system.transport();
  std::vector<Solution> solutions;
  for (const std::size_t threads : {1, 2, 3, 2}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    solutions.push_back(solve(transport, system.materials, system.element_material, system.direct, {}));
  }
  const auto same = [](const RowMatrix& a, const RowMatrix& b) {
    return a.size() == b.size() &&
           std::memcmp(a.data(), b.data(), static_cast<std::size_t>(a.size()) * sizeof(double)) == 0;
  };
  for (std::size_t k = 1; k < solutions.size(); ++k) {
    EXPECT_TRUE(same(solutions[0].reflected, solutions[k].reflected)) << k;
    EXPECT_TRUE(same(solutions[0].luminescent, solutions[k].luminescent)) << k;
    EXPECT_TRUE(same(solutions[0].reflected_source, solutions[k].reflected_source)) << k;
    EXPECT_TRUE(same(solutions[0].luminescent_source, solutions[k].luminescent_source)) << k;
  }
}

TEST(Solver, NamesWhatIsWrongWithItsInput) {
  std::mt19937_64 random(14);
  const System system = random_system(6, 3, 1, 0.9, random);
  const Transport transport = system.transport();
  const auto message = [&](const std::vector<int>& element_material, const RowMatrix& direct,
                           const SolveParams& params) -> std::string {
    try {
      solve(transport, system.materials, element_material, direct, params);
    } catch (const InvalidParams& error) {
      return error.what();
    }
    return "accepted";
  };
  RowMatrix broken = system.direct;
  broken(2, 1) = std::nan("");
  EXPECT_NE(message({0, 0, 0}, system.direct, {}).find("6 elements"), std::string::npos);
  EXPECT_NE(message({0, 0, 0, 0, 0, 7}, system.direct, {}).find("material 7"), std::string::npos);
  EXPECT_NE(message(system.element_material, broken, {}).find("finite"), std::string::npos);
  EXPECT_NE(message(system.element_material, system.direct.leftCols(2), {}).find("m0"), std::string::npos);
  EXPECT_NE(message(system.element_material, system.direct, {.bounces = -1}).find("bounces: -1"), std::string::npos);
  EXPECT_NE(message(system.element_material, system.direct, {.tolerance = 1.0}).find("tolerance: 1"),
            std::string::npos);
}

}  // namespace
}  // namespace interglow::radiosity
