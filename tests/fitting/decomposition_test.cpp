// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/decomposition.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <random>

#include "diagnostics/error.h"

namespace interglow::fitting {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr int kBands = 61;

Eigen::VectorXd wavelengths() { return Eigen::VectorXd::LinSpaced(kBands, 400, 700); }

Eigen::VectorXd bell(double centre_nm, double width_nm) {
  return (-((wavelengths().array() - centre_nm) / width_nm).square()).exp();
}

/// Functions of a red object beside a yellow one; both fluoresce.
radiosity::PaperFunctions red_beside_yellow() {
  const Eigen::VectorXd light = 1.0 + 0.3 * bell(520, 150).array();
  const Eigen::VectorXd red = 0.1 + 0.7 * bell(660, 60).array();
  const Eigen::VectorXd yellow = 0.05 + 0.8 * (1.0 / (1.0 + (-(wavelengths().array() - 510.0) / 15.0).exp()));
  return {.re = red.cwiseProduct(light),
          .rr = red.cwiseProduct(yellow).cwiseProduct(light),
          .le = 0.5 * bell(610, 30),
          .lr = 0.3 * bell(610, 30),
          .ll = 0.1 * bell(612, 30),
          .rl = 0.4 * red.cwiseProduct(bell(540, 25))};
}

/// Rows of terms mixed with the basis, one pixel a row of `terms`.
image::SpectralImage mix(const ComponentBasis& basis, const Eigen::MatrixXd& terms) {
  image::SpectralImage image{static_cast<int>(terms.rows()), 1, wavelengths(), {}};
  for (Eigen::Index p = 0; p < terms.rows(); ++p) {
    const Eigen::VectorXf y = (basis.spectrum * terms.row(p).transpose()).cast<float>();
    image.value.insert(image.value.end(), y.begin(), y.end());
  }
  return image;
}

Eigen::MatrixXd random_terms(Eigen::Index pixels, Eigen::Index components, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  Eigen::MatrixXd terms(pixels, components);
  for (double& term : terms.reshaped()) term = uniform(random);
  return terms;
}

class Decompose : public ::testing::TestWithParam<int> {};

TEST_P(Decompose, RecoversMixturesAndTheirSum) {
  const ComponentBasis basis = paper_basis(red_beside_yellow(), GetParam());
  ASSERT_EQ(basis.spectrum.cols(), GetParam());
  const Eigen::MatrixXd terms = random_terms(700, GetParam(), 1);
  const image::SpectralImage image = mix(basis, terms);
  std::vector<int> object(700, 0);
  object[5] = -1;
  for (const Sign sign : {Sign::kAny, Sign::kNonNegative}) {
    const Decomposition found = decompose(image, object, {basis}, {.sign = sign});
    EXPECT_EQ(found.pixels, 699U);
    // Spectra are stored in single precision (6e-8); the basis amplifies that by 1 / sine.
    const double tolerance = 3e-7 / found.quality[0].sine.minCoeff();
    for (int c = 0; c < GetParam(); ++c) {
      const image::ScalarMap& map = found.shading[static_cast<std::size_t>(c)];
      EXPECT_TRUE(std::isnan(map.value[5]));
      for (std::size_t p = 0; p < 700; ++p) {
        if (p == 5) continue;
        ASSERT_NEAR(map.value[p], terms(static_cast<Eigen::Index>(p), c), tolerance)
            << basis.name[static_cast<std::size_t>(c)] << ' ' << p;
      }
    }
    EXPECT_LT(found.total_relative_residual, 1e-7);
    const image::SpectralImage sum = synthesize(found, object, {basis}, wavelengths());
    for (std::size_t v = 0; v < sum.value.size(); ++v) {
      if (v / kBands == 5) continue;
      ASSERT_NEAR(sum.value[v], image.value[v], 1e-5) << v;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Components, Decompose, ::testing::Values(2, 4, 5));

TEST(Decompose, TwoComponentsAgreeWithThePaperModel) {
  const radiosity::PaperFunctions functions = red_beside_yellow();
  const ComponentBasis basis = paper_basis(functions, 4);
  // Mixtures of four components, so that two of them leave a residual.
  const image::SpectralImage image = mix(basis, random_terms(40, 4, 2));
  const std::vector<int> object(40, 0);
  radiosity::RowMatrix rows(40, kBands);
  for (std::size_t v = 0; v < image.value.size(); ++v) rows.data()[v] = static_cast<double>(image.value[v]);
  const radiosity::ShadingTerms expected = radiosity::shading_terms(rows, object, {functions});
  const Decomposition found = decompose(image, object, {paper_basis(functions, 2)}, {.sign = Sign::kAny});
  EXPECT_NEAR(found.total_relative_residual, expected.relative_residual, 1e-12);
  EXPECT_GT(expected.relative_residual, 0.01);
  for (std::size_t p = 0; p < 40; ++p) {
    EXPECT_NEAR(found.shading[0].value[p], expected.re[static_cast<Eigen::Index>(p)], 1e-6);
    EXPECT_NEAR(found.shading[1].value[p], expected.rr[static_cast<Eigen::Index>(p)], 1e-6);
  }
}

// The optimum of min |A x - b|², x ≥ 0 is the one x with gradient g = Aᵀ(A x - b) ≥ 0 and x·g = 0.
TEST(NonnegativeLeastSquares, MeetsTheOptimalityConditions) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  int bounded = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    const int columns = 1 + trial % 5;
    Eigen::MatrixXd a(12, columns);
    Eigen::VectorXd b(12);
    for (double& value : a.reshaped()) value = 0.7 + normal(random);
    for (double& value : b) value = normal(random);
    const Eigen::VectorXd x = nonnegative_least_squares(a, b);
    const Eigen::VectorXd gradient = a.transpose() * (a * x - b);
    const double scale = a.norm() * b.norm();
    ASSERT_GE(x.minCoeff(), 0.0) << trial;
    ASSERT_GE(gradient.minCoeff(), -1e-13 * scale) << trial;
    ASSERT_LE(std::abs(x.dot(gradient)), 1e-13 * scale * x.norm()) << trial;
    bounded += (x.array() == 0.0).any() ? 1 : 0;
  }
  EXPECT_GT(bounded, 1000);  // the bounds were at work
}

TEST(Decompose, CountsPixelsThatBoundsChanged) {
  const ComponentBasis basis = paper_basis(red_beside_yellow(), 2);
  Eigen::MatrixXd terms = random_terms(3, 2, 3);
  terms(1, 1) = -0.2;
  const image::SpectralImage image = mix(basis, terms);
  const Decomposition any = decompose(image, {0, 0, 0}, {basis}, {.sign = Sign::kAny});
  EXPECT_NEAR(any.shading[1].value[1], -0.2, 1e-5);
  const Decomposition bounded = decompose(image, {0, 0, 0}, {basis});
  EXPECT_EQ(bounded.bounded, 1U);
  EXPECT_EQ(bounded.shading[1].value[1], 0.0F);
  // With f_rr = 0 the best f_re is a·y / a·a.
  const Eigen::VectorXd a = basis.spectrum.col(0);
  const Eigen::VectorXd y = basis.spectrum * terms.row(1).transpose();
  EXPECT_NEAR(bounded.shading[0].value[1], a.dot(y) / a.squaredNorm(), 1e-6);
}

TEST(Decompose, LeavesOutPixelsThatAreNotFinite) {
  const ComponentBasis basis = paper_basis(red_beside_yellow(), 2);
  image::SpectralImage image = mix(basis, random_terms(3, 2, 4));
  image.pixel(0, 1)[7] = std::numeric_limits<float>::quiet_NaN();
  const Decomposition found = decompose(image, {0, 0, 0}, {basis});
  EXPECT_EQ(found.not_finite, 1U);
  EXPECT_EQ(found.pixels, 2U);
  EXPECT_TRUE(std::isnan(found.shading[0].value[1]));
  EXPECT_LT(found.total_relative_residual, 1e-6);
}

TEST(Decompose, WeightsOfZeroRemoveABand) {
  const ComponentBasis basis = paper_basis(red_beside_yellow(), 2);
  const Eigen::MatrixXd terms = random_terms(3, 2, 5);
  image::SpectralImage image = mix(basis, terms);
  image.pixel(0, 1)[30] = 1e3F;  // a dead pixel
  Eigen::VectorXd weight = Eigen::VectorXd::Ones(kBands);
  weight[30] = 0.0;
  const Decomposition found = decompose(image, {0, 0, 0}, {basis}, {.band_weight = weight});
  EXPECT_NEAR(found.shading[0].value[1], terms(1, 0), 1e-5);
  EXPECT_NEAR(found.shading[1].value[1], terms(1, 1), 1e-5);
}

// Two unit columns at the angle φ: singular values √(1 ± cos φ), and each is sin φ away from the other.
TEST(Examine, GivesAngleAndConditionOfTwoColumns) {
  const double angle = 0.02;
  ComponentBasis basis{{"a", "b"}, Eigen::MatrixXd::Zero(3, 2)};
  basis.spectrum.col(0) << 5, 0, 0;
  basis.spectrum.col(1) << 0.1 * std::cos(angle), 0.1 * std::sin(angle), 0;
  const BasisQuality quality = examine(basis);
  EXPECT_NEAR(quality.singular_value[0], std::sqrt(1 + std::cos(angle)), 1e-14);
  EXPECT_NEAR(quality.condition_number, 1.0 / std::tan(angle / 2.0), 1e-9);
  EXPECT_NEAR(quality.sine[0], std::sin(angle), 1e-13);
  EXPECT_NEAR(quality.sine[1], std::sin(angle), 1e-13);
  EXPECT_THAT(quality.sentence, AllOf(HasSubstr("\"a\" and \"b\" trade"), HasSubstr("50")));
}

TEST(Examine, NamesOnlyTheColumnsThatDepend) {
  ComponentBasis basis{{"re", "rr", "le", "li"}, Eigen::MatrixXd::Identity(6, 4)};
  basis.spectrum.col(3) = basis.spectrum.col(1) + basis.spectrum.col(2);
  basis.spectrum(5, 3) = 1e-3;
  const BasisQuality quality = examine(basis);
  EXPECT_EQ(quality.weakest.size(), 3U);
  EXPECT_THAT(quality.weakest, ::testing::UnorderedElementsAre(1, 2, 3));
}

TEST(Decompose, NamesSpectraThatNearlyCoincide) {
  radiosity::PaperFunctions functions = red_beside_yellow();
  functions.lr = 0.3 * functions.le;
  functions.ll.setZero();  // li is a multiple of le, as in equation 11
  const ComponentBasis basis = paper_basis(functions, 5);
  const image::SpectralImage image = mix(basis, random_terms(2, 5, 6));
  try {
    decompose(image, {0, 0}, {basis});
    FAIL();
  } catch (const InvalidInput& error) {
    EXPECT_THAT(error.what(),
                AllOf(HasSubstr("object 0"), HasSubstr("\"le\" and \"li\" nearly coincide"), HasSubstr("Merge")));
  }
}

TEST(SplitLuminescence, RecoversTheShares) {
  const ComponentBasis basis = paper_basis(red_beside_yellow(), 4);
  Eigen::MatrixXd terms = random_terms(1500, 4, 8);
  terms.col(2) = 0.8 * terms.col(0) + 0.35 * terms.col(1);
  const std::vector<int> object(1500, 0);
  const Decomposition found = decompose(mix(basis, terms), object, {basis});
  const std::vector<LuminescenceSplit> split = split_luminescence(found, object);
  ASSERT_EQ(split.size(), 1U);
  EXPECT_NEAR(split[0].direct, 0.8, 1e-6);
  EXPECT_NEAR(split[0].indirect, 0.35, 1e-6);
  EXPECT_LT(split[0].relative_residual, 1e-5);
}

TEST(SplitLuminescence, RefusesProportionalShading) {
  const ComponentBasis basis = paper_basis(red_beside_yellow(), 4);
  Eigen::MatrixXd terms = random_terms(50, 4, 9);
  const std::vector<int> object(50, 0);
  for (const double ratio : {0.0, 0.4}) {
    terms.col(1) = ratio * terms.col(0);
    EXPECT_THROW(split_luminescence(decompose(mix(basis, terms), object, {basis}), object), InvalidInput) << ratio;
  }
}

TEST(Decompose, SameBitsForAnyNumberOfThreads) {
  const ComponentBasis basis = paper_basis(red_beside_yellow(), 4);
  image::SpectralImage image = mix(basis, random_terms(3000, 4, 10));
  std::mt19937 random(11);
  std::normal_distribution<float> noise(0.0F, 0.05F);
  for (float& value : image.value) value += noise(random);
  const std::vector<int> object(3000, 0);
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  const Decomposition a = decompose(image, object, {basis});
  const tbb::global_control four(tbb::global_control::max_allowed_parallelism, 4);
  const Decomposition b = decompose(image, object, {basis});
  EXPECT_EQ(a.total_relative_residual, b.total_relative_residual);
  for (std::size_t c = 0; c < a.shading.size(); ++c) EXPECT_EQ(a.shading[c].value, b.shading[c].value);
}

TEST(Decompose, SaysWhatDisagrees) {
  const ComponentBasis basis = paper_basis(red_beside_yellow(), 2);
  const image::SpectralImage image = mix(basis, random_terms(2, 2, 12));
  const auto message = [&](const auto& call) -> std::string {
    try {
      call();
    } catch (const std::exception& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(message([&] { decompose(image, {0}, {basis}); }), HasSubstr("object: 1 entries for an image of 2 × 1"));
  EXPECT_THAT(message([&] {
                decompose(image, {0, 1}, {basis});
              }),
              HasSubstr("object: 1; expected -1 or an index below 1"));
  EXPECT_THAT(message([&] { decompose(image, {0, 0}, {basis}, {.least_sine = 0.0}); }), HasSubstr("least_sine: 0"));
  EXPECT_THAT(message([&] {
                decompose(image, {0, 0}, {basis}, {.band_weight = Eigen::VectorXd::Ones(3)});
              }),
              HasSubstr("band_weight: 3 values; expected one a band, that is 61"));
  EXPECT_THAT(message([&] { paper_basis(red_beside_yellow(), 3); }), HasSubstr("components: 3; expected 2, 4 or 5"));
  ComponentBasis black = basis;
  black.spectrum.col(1).setZero();
  EXPECT_THAT(message([&] { decompose(image, {0, 0}, {black}); }), HasSubstr("component \"rr\" is 0"));
}

}  // namespace
}  // namespace interglow::fitting
