// SPDX-License-Identifier: GPL-3.0-or-later
// The two-term model is exact where its assumptions hold: two objects that do not see themselves, one bounce, one
// light.
#include "radiosity/paper_model.h"

#include <gtest/gtest.h>

#include <random>
#include <string>

#include "diagnostics/error.h"

namespace interglow::radiosity {
namespace {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

constexpr Eigen::Index kBands = 9;
constexpr Eigen::Index kElements = 24;

struct TwoObjects {
  Transport transport;
  std::vector<spectral::Material> materials;
  std::vector<int> element_object;
  Vector illuminant;
  RowMatrix direct;
};

TwoObjects two_objects() {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  const auto draw = [&](Eigen::Index rows, Eigen::Index columns) {
    return Matrix::NullaryExpr(rows, columns, [&] { return uniform(random); }).eval();
  };
  std::vector<int> object;
  Matrix F = Matrix::Zero(kElements, kElements);
  for (Eigen::Index i = 0; i < kElements; ++i) object.push_back(i < kElements / 2 ? 0 : 1);
  for (Eigen::Index i = 0; i < kElements / 2; ++i) {
    for (Eigen::Index j = kElements / 2; j < kElements; ++j) F(i, j) = F(j, i) = 1.5 * uniform(random) / kElements;
  }
  std::vector<spectral::Material> materials;
  for (int m = 0; m < 2; ++m) {
    // Full-rank Stokes-shifted luminescence: the model needs no α and β.
    materials.push_back(
        {"m" + std::to_string(m), {draw(kBands, 1), draw(kBands, kBands).triangularView<Eigen::StrictlyLower>()}});
    materials.back().donaldson.luminescence *= 0.1;
  }
  Vector illuminant = draw(kBands, 1);
  RowMatrix direct = draw(kElements, 1) * illuminant.transpose();
  return {Transport::from_form_factors(F, Vector::Ones(kElements)), materials, object, illuminant, direct};
}

std::vector<PaperFunctions> functions_of(const TwoObjects& scene,
                                         PaperLuminescence kind = PaperLuminescence::kSeparate) {
  const auto& a = scene.materials[0].donaldson;
  const auto& b = scene.materials[1].donaldson;
  return {paper_functions(a, b, scene.illuminant, kind), paper_functions(b, a, scene.illuminant, kind)};
}

RowMatrix reflected_radiosity(const TwoObjects& scene, std::optional<int> bounces) {
  const auto materials = without_luminescence(scene.materials);
  const Solution solution = solve(scene.transport, materials, scene.element_object, scene.direct, {.bounces = bounces});
  return reflect(solution.direct + solution.reflected, materials, scene.element_object);
}

double largest(const RowMatrix& difference) { return difference.cwiseAbs().maxCoeff(); }

TEST(PaperModel, SynthesisOfOneBounceIsTheExactComponents) {
  const TwoObjects scene = two_objects();
  const ShadingTerms terms = shading_terms(reflected_radiosity(scene, 1), scene.element_object, functions_of(scene));
  EXPECT_LE(terms.relative_residual, 1e-14);
  const Components found = synthesize(terms, scene.element_object, functions_of(scene));
  const Solution solution = solve(scene.transport, scene.materials, scene.element_object, scene.direct, {.bounces = 1});
  const Components exact = components(solution, scene.materials, scene.element_object);
  EXPECT_LE(largest(found.re - exact.re), 1e-13);
  EXPECT_LE(largest(found.rr - exact.rr), 1e-13);
  EXPECT_LE(largest(found.le - exact.le), 1e-13);
  EXPECT_LE(largest(found.lr - exact.lr), 1e-13);
  EXPECT_LE(largest(found.ll - exact.ll), 1e-13);
  EXPECT_LE(largest(found.rl - exact.rl), 1e-13);
}

TEST(PaperModel, MoreBouncesLeaveAResidualThatTwoTermsCannotHold) {
  const TwoObjects scene = two_objects();
  const ShadingTerms terms =
      shading_terms(reflected_radiosity(scene, std::nullopt), scene.element_object, functions_of(scene));
  EXPECT_GT(terms.relative_residual, 1e-4);
}

TEST(PaperModel, LeastSquaresAgreesWithTheNormalEquations) {
  const TwoObjects scene = two_objects();
  const auto functions = functions_of(scene);
  RowMatrix y = reflected_radiosity(scene, std::nullopt);
  y(3, 4) += 0.5;  // off the model
  const ShadingTerms terms = shading_terms(y, scene.element_object, functions);
  for (Eigen::Index r = 0; r < kElements; ++r) {
    const PaperFunctions& of = functions[static_cast<std::size_t>(scene.element_object[static_cast<std::size_t>(r)])];
    const Vector left = y.row(r).transpose() - terms.re[r] * of.re - terms.rr[r] * of.rr;
    EXPECT_NEAR(left.dot(of.re), 0.0, 1e-13) << r;
    EXPECT_NEAR(left.dot(of.rr), 0.0, 1e-13) << r;
  }
}

TEST(PaperModel, RatioScalesIndirectLightOnly) {
  const TwoObjects scene = two_objects();
  const auto functions = functions_of(scene);
  const ShadingTerms terms = shading_terms(reflected_radiosity(scene, 1), scene.element_object, functions);
  const Components one = synthesize(terms, scene.element_object, functions);
  const Components more = synthesize(terms, scene.element_object, functions, 1.49);
  EXPECT_EQ(largest(more.re - one.re), 0.0);
  EXPECT_EQ(largest(more.le - one.le), 0.0);
  EXPECT_LE(largest(more.rr - 1.49 * one.rr), 1e-15);
  EXPECT_LE(largest(more.rl - 1.49 * one.rl), 1e-15);
  // A capture whose interreflection is 1.49 times the simulated one has that w / w'.
  const ShadingTerms captured = shading_terms(more.re + more.rr, scene.element_object, functions);
  std::vector<char> region(kElements, 0);
  for (std::size_t r = 5; r < 12; ++r) region[r] = 1;
  EXPECT_NEAR(interreflection_ratio(captured, region) / interreflection_ratio(terms, region), 1.49, 1e-12);
}

TEST(PaperModel, MergedFunctionsAreThoseOfEquationEleven) {
  const TwoObjects scene = two_objects();
  const auto separate = functions_of(scene), merged = functions_of(scene, PaperLuminescence::kMerged);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_LE((merged[i].le - (separate[i].le + separate[i].lr + separate[i].ll)).cwiseAbs().maxCoeff(), 1e-16);
    EXPECT_EQ(merged[i].lr, merged[i].le);
    EXPECT_EQ(merged[i].rl, separate[i].rl);
  }
}

TEST(PaperModel, BackgroundRowsStayDark) {
  const TwoObjects scene = two_objects();
  std::vector<int> objects = scene.element_object;
  objects[7] = -1;
  const ShadingTerms terms = shading_terms(reflected_radiosity(scene, 1), objects, functions_of(scene));
  EXPECT_EQ(terms.re[7], 0.0);
  EXPECT_EQ(synthesize(terms, objects, functions_of(scene)).le.row(7).norm(), 0.0);
}

TEST(PaperModel, GreyNeighbourIsNamed) {
  TwoObjects scene = two_objects();
  scene.materials[1].donaldson.reflectance.setConstant(0.6);
  try {
    shading_terms(scene.direct, scene.element_object, functions_of(scene));
    FAIL() << "terms that nothing tells apart were returned";
  } catch (const InvalidInput& error) {
    EXPECT_NE(std::string(error.what()).find("object 0"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace interglow::radiosity
