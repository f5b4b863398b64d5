// SPDX-License-Identifier: GPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <string>

#include "diagnostics/error.h"
#include "spectral/conservative_resample.h"
#include "spectral/donaldson_file.h"
#include "spectral/shipped_tables.h"
#include "tests/spectral/table_text.h"

namespace interglow::spectral {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

const WavelengthGrid kPaperGrid = WavelengthGrid::uniform(350, 700, 5);

Eigen::MatrixXd luminescence_of(const DonaldsonMatrix& D) {
  return D.luminesces() ? D.luminescence : Eigen::MatrixXd::Zero(D.bands(), D.bands());
}

/// Radiance factor per band under light that is equal in all bands.
Eigen::VectorXd under_flat_light(const DonaldsonMatrix& D) {
  return D.reflectance + luminescence_of(D).rowwise().sum();
}

TEST(ResampleMeans, ConservesEveryOldBandAndStaysInRange) {
  Eigen::VectorXd edges(7);
  edges << 0, 1, 2.5, 3, 5, 6, 8;
  Eigen::VectorXd mean(6);
  mean << 0.0, 0.2, 1.0, 0.9, 0.0, 0.4;
  const int parts = 7;
  Eigen::VectorXd fine(6 * parts + 1);
  for (int i = 0; i < 6; ++i) {
    for (int p = 0; p < parts; ++p) fine[i * parts + p] = edges[i] + (edges[i + 1] - edges[i]) * p / parts;
  }
  fine[6 * parts] = 8;
  const Eigen::VectorXd result = resample_means(edges, mean, fine);
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(result.segment(i * parts, parts).mean(), mean[i], 1e-15) << "band " << i;
  EXPECT_GE(result.minCoeff(), 0.0);
  EXPECT_LE(result.maxCoeff(), 1.0);
  EXPECT_LT((resample_means(edges, mean, edges) - mean).cwiseAbs().maxCoeff(), 1e-15);
}

TEST(ResampleMeans, ThirdOrderOnSmoothMonotoneTables) {
  // exp on [0, 2]: halving the bands divides the error of the half bands by 8 or more away from the ends.
  const auto exact = [](double a, double b) { return (std::exp(b) - std::exp(a)) / (b - a); };
  const auto error = [&](int bands) {
    const Eigen::VectorXd edges = Eigen::VectorXd::LinSpaced(bands + 1, 0, 2);
    const Eigen::VectorXd fine = Eigen::VectorXd::LinSpaced(2 * bands + 1, 0, 2);
    Eigen::VectorXd mean(bands);
    for (int i = 0; i < bands; ++i) mean[i] = exact(edges[i], edges[i + 1]);
    const Eigen::VectorXd result = resample_means(edges, mean, fine);
    double worst = 0.0;
    for (int i = bands / 2; i < 3 * bands / 2; ++i)
      worst = std::max(worst, std::abs(result[i] - exact(fine[i], fine[i + 1])));
    return worst;
  };
  EXPECT_GT(std::log2(error(32) / error(64)), 2.9);
  EXPECT_GT(std::log2(error(64) / error(128)), 2.9);
}

TEST(EmittedOverReceived, CountsEveryBandWithItsWidth) {
  // Bands 10, 15 and 20 nm wide (edges 395, 405, 420, 440). Excitation 400: 0.5 + 0.3 * 15/10 + 0.1 * 20/10 = 1.15.
  const WavelengthGrid grid = WavelengthGrid::from_centers(Eigen::Vector3d(400, 410, 430));
  DonaldsonMatrix D{Eigen::Vector3d(0.5, 0.4, 0.3), Eigen::Matrix3d::Zero()};
  D.luminescence(1, 0) = 0.3;
  D.luminescence(2, 0) = 0.1;
  const Eigen::VectorXd ratio = emitted_over_received(D, grid);
  EXPECT_NEAR(ratio[0], 0.5 + 0.3 * grid.width_nm(1) / grid.width_nm(0) + 0.1 * grid.width_nm(2) / grid.width_nm(0),
              1e-15);
  EXPECT_NEAR(grid.width_nm(1), 15.0, 1e-12);
  EXPECT_NEAR(ratio[0], 1.15, 1e-12);
  EXPECT_EQ(ratio[1], 0.4);
}

TEST(ValidateMaterial, NamesSampleColumnAndExcess) {
  const WavelengthGrid grid = WavelengthGrid::uniform(400, 420, 10);
  Material material{"glow", {Eigen::Vector3d(0.9, 0.4, 0.3), Eigen::Matrix3d::Zero()}};
  EXPECT_TRUE(validate(material, grid).empty());
  material.donaldson.luminescence(1, 0) = 0.15;
  material.donaldson.luminescence(2, 1) = -0.02;
  const Warnings warnings = validate(material, grid);
  ASSERT_EQ(warnings.size(), 2U);
  EXPECT_THAT(warnings[0], AllOf(HasSubstr("\"glow\""), HasSubstr("400 nm"), HasSubstr("5.00 %")));
  EXPECT_THAT(warnings[1], AllOf(HasSubstr("-0.02"), HasSubstr("emission 420 nm, excitation 410 nm")));
}

TEST(ValidateMaterial, RefusesWhatCannotBeUsed) {
  const WavelengthGrid grid = WavelengthGrid::uniform(400, 420, 10);
  const auto message = [&](const DonaldsonMatrix& D) {
    return message_of<InvalidInput>([&] { validate(Material{"sheet", D}, grid); });
  };
  EXPECT_THAT(message({Eigen::Vector3d(0.5, 1.2, 0.5), {}}),
              AllOf(HasSubstr("\"sheet\""), HasSubstr("410 nm"), HasSubstr("1.2")));
  EXPECT_THAT(message({Eigen::Vector2d(0.5, 0.5), {}}), HasSubstr("2 bands, expected 3"));
  EXPECT_THAT(message({Eigen::Vector3d(0.5, 0.5, 0.5), Eigen::Matrix2d::Zero()}), HasSubstr("2 x 2, expected 3 x 3"));
  Eigen::Matrix3d L = Eigen::Matrix3d::Zero();
  L(1, 1) = 0.1;
  EXPECT_THAT(message({Eigen::Vector3d(0.5, 0.5, 0.5), L}), HasSubstr("diagonal"));
  L(1, 1) = 0.0;
  L(2, 0) = std::nan("");
  EXPECT_THAT(message({Eigen::Vector3d(0.5, 0.5, 0.5), L}), HasSubstr("emission 420 nm, excitation 400 nm"));
}

TEST(ReadBispectralTable, TurnsCieTablesToEmissionRows) {
  const TableText ours("wavelength_nm,ex400,ex410\n400,0.5,0.01\n410,0.2,0.6\n");
  const TableText cie("wavelength_nm,em400,em410\n400,0.5,0.2\n410,0.01,0.6\n", "_cie.csv");
  Eigen::Matrix2d expected;
  expected << 0.5, 0.01, 0.2, 0.6;
  EXPECT_EQ(read_bispectral_table(ours.path()).radiance_factor, expected);
  EXPECT_EQ(read_bispectral_table(cie.path()).radiance_factor, expected);
  EXPECT_EQ(read_bispectral_table(cie.path(), Orientation::kExcitationRows).radiance_factor, expected);
  EXPECT_THAT(message_of<InvalidInput>([&] { read_bispectral_table(cie.path(), Orientation::kEmissionRows); }),
              AllOf(HasSubstr("emission by their names"), HasSubstr("em400")));
}

TEST(ReadBispectralTable, BareWavelengthsNeedADeclaration) {
  const TableText file("wavelength_nm,400,410\n400,0.5,0.2\n410,0.01,0.6\n");
  EXPECT_THAT(message_of<InvalidInput>([&] { read_bispectral_table(file.path()); }), HasSubstr("orientation"));
  EXPECT_EQ(read_bispectral_table(file.path(), Orientation::kExcitationRows).radiance_factor(1, 0), 0.2);
  EXPECT_EQ(read_bispectral_table(file.path(), Orientation::kEmissionRows).radiance_factor(1, 0), 0.01);
}

TEST(ReadBispectralTable, RefusesBadColumns) {
  const TableText unsorted("wavelength_nm,ex410,ex400\n400,0.5,0.2\n410,0.01,0.6\n");
  EXPECT_THAT(message_of<InvalidInput>([&] { read_bispectral_table(unsorted.path()); }),
              HasSubstr("\"ex400\" follows \"ex410\""));
  const TableText word("wavelength_nm,ex400,other\n400,0.5,0.2\n", "_word.csv");
  EXPECT_THAT(message_of<InvalidInput>([&] { read_bispectral_table(word.path()); }), HasSubstr("\"other\""));
  const TableText triple("wavelength_nm,S,alpha\n400,0.5,0.2\n410,0.5,0.2\n", "_triple.csv");
  EXPECT_THAT(message_of<InvalidInput>([&] { read_bispectral_table(triple.path()); }),
              HasSubstr("\"beta\" is missing"));
}

TEST(Resample, OnTheTablesOwnBandsChangesNothing) {
  const BispectralTable table = read_bispectral_table(find_table("interglow:fluorescent/paper_red"));
  const DonaldsonReading reading = resample(table, table.emission, {.keep_anti_stokes = true, .keep_noise = true});
  const Eigen::Index first = table.excitation.size() - table.emission.size();
  Eigen::MatrixXd expected = table.radiance_factor.rightCols(table.emission.size());
  EXPECT_EQ(table.excitation.center_nm(first), table.emission.center_nm(0));
  EXPECT_LT((reading.donaldson.reflectance - expected.diagonal()).cwiseAbs().maxCoeff(), 1e-15);
  expected.diagonal().setZero();
  // Entries more than 50 nm on the anti-Stokes side stay too.
  EXPECT_LT((reading.donaldson.luminescence - expected).cwiseAbs().maxCoeff(), 1e-15);
}

TEST(Resample, TotalRadianceFactorUnderFlatLightDoesNotDependOnTheGrid) {
  const std::vector<std::string> samples = {"paper_red",   "paper_yellow", "paper_magenta",
                                            "paper_green", "pigment_red",  "pigment_chartreuse"};
  for (const std::string& sample : samples) {
    const BispectralTable table = read_bispectral_table(find_table("interglow:fluorescent/" + sample));
    const Eigen::VectorXd expected = table.radiance_factor.rowwise().sum();
    // Edges 295 + 2 k and 295 + 7 k nm; the first share all edges of the 10 nm bands, the second those at 435, 505,
    // 575, 645, 715.
    for (const double step : {2.0, 7.0}) {
      const WavelengthGrid grid = WavelengthGrid::uniform(295 + step / 2, 785 - step / 2, step);
      const DonaldsonMatrix D = resample(table, grid, {.keep_anti_stokes = true, .keep_noise = true}).donaldson;
      const Eigen::VectorXd flux = under_flat_light(D).cwiseProduct(grid.widths_nm());
      const double span = step * 10.0;
      for (double lower = step == 2.0 ? 375 : 435; lower + span < 785; lower += span) {
        const auto first = static_cast<Eigen::Index>(std::lround((lower - 295) / step));
        const auto old_first = static_cast<Eigen::Index>(std::lround((lower - 375) / 10));
        const auto old_bands = static_cast<Eigen::Index>(std::lround(span / 10));
        EXPECT_NEAR(flux.segment(first, 10).sum(), expected.segment(old_first, old_bands).sum() * 10.0, 1e-10)
            << sample << ", " << step << " nm, from " << lower << " nm";
      }
    }
  }
}

TEST(Resample, DropsAntiStokesEntriesAndKeepsTheStokesSideAsItIs) {
  const BispectralTable table = read_bispectral_table(find_table("interglow:fluorescent/pigment_red"));
  const Eigen::MatrixXd kept = resample(table, kPaperGrid, {.keep_anti_stokes = true}).donaldson.luminescence;
  const DonaldsonReading reading = resample(table, kPaperGrid);
  const Eigen::MatrixXd& dropped = reading.donaldson.luminescence;
  const Eigen::MatrixXd difference = dropped - kept;
  EXPECT_EQ(Eigen::MatrixXd(dropped.triangularView<Eigen::StrictlyUpper>()).cwiseAbs().maxCoeff(), 0.0);
  EXPECT_EQ(Eigen::MatrixXd(difference.triangularView<Eigen::StrictlyLower>()).cwiseAbs().maxCoeff(), 0.0);
  EXPECT_GT(kept.triangularView<Eigen::StrictlyUpper>().toDenseMatrix().sum(), 0.0);
  EXPECT_THAT(reading.warnings, ::testing::Contains(HasSubstr("anti-Stokes")));
  EXPECT_THAT(reading.warnings, ::testing::Contains(AllOf(HasSubstr("375"), HasSubstr("held"))));
  EXPECT_GE(dropped.minCoeff(), 0.0);
}

TEST(Resample, OfAProductIsTheProductOfTheResampled) {
  // A table of D = α β Δμ on 10 nm whose exact continuation is known: linear α and β (per nm), flat S. Away from the
  // ends of the table the 5 nm matrix must be α(λ) β(μ) 5 nm wherever the coarse cells lie wholly on the Stokes side.
  const WavelengthGrid coarse = WavelengthGrid::uniform(400, 600, 10);
  const auto alpha = [](double nm) { return (nm - 390.0) / 400.0; };
  const auto beta = [](double nm) { return (620.0 - nm) / 1e5; };
  BispectralTable table{coarse, coarse, Eigen::MatrixXd::Zero(21, 21), "product"};
  for (Eigen::Index i = 0; i < 21; ++i) {
    table.radiance_factor(i, i) = 0.5;
    for (Eigen::Index j = 0; j < i; ++j)
      table.radiance_factor(i, j) = alpha(coarse.center_nm(i)) * beta(coarse.center_nm(j)) * 10.0;
  }
  const WavelengthGrid fine = WavelengthGrid::uniform(397.5, 602.5, 5);
  const DonaldsonMatrix D = resample(table, fine).donaldson;
  for (Eigen::Index k = 0; k < fine.size(); ++k) {
    for (Eigen::Index j = 0; j < fine.size(); ++j) {
      const Eigen::Index row = k / 2;
      const Eigen::Index column = j / 2;
      // Linear tables come back exactly where no stencil (two cells each way, on one axis after the other) meets the
      // half-filled diagonal or the rim.
      if (row - column < 6 || column < 2 || row > 18) continue;
      EXPECT_NEAR(D.luminescence(k, j), alpha(fine.center_nm(k)) * beta(fine.center_nm(j)) * 5.0, 1e-15)
          << k << ", " << j;
    }
  }
}

TEST(Resample, RefusesWhatIsNoDonaldsonMatrix) {
  const WavelengthGrid grid = WavelengthGrid::uniform(400, 420, 10);
  BispectralTable table{grid, grid, Eigen::Matrix3d::Identity() * 50.0, "percent.csv"};
  EXPECT_THAT(message_of<InvalidInput>([&] { resample(table, grid); }),
              AllOf(HasSubstr("percent.csv"), HasSubstr("50"), HasSubstr("400 nm")));
  table.radiance_factor = Eigen::Matrix3d::Identity() * 0.5;
  table.excitation = WavelengthGrid::uniform(395, 415, 10);
  EXPECT_THAT(message_of<InvalidInput>([&] { resample(table, grid); }), HasSubstr("not a band of the excitation"));
  table.excitation = WavelengthGrid::uniform(300, 320, 10);
  EXPECT_THAT(message_of<InvalidInput>([&] { resample(table, grid); }), HasSubstr("reflectance is unknown"));
}

TEST(ReadDonaldson, TripleOnItsOwnGridIsTheProduct) {
  const DonaldsonMatrix D = read_donaldson(find_table("interglow:fluorescent/paper_red_triple"), kPaperGrid).donaldson;
  // Lines of the file: 350 nm has S = 0.493274 and beta = 0.000921367; 700 nm has alpha = 0.0410496.
  EXPECT_NEAR(D.reflectance[0], 0.493274, 1e-15);
  EXPECT_NEAR(D.luminescence(70, 0), 0.0410496 * 0.000921367 * 5.0, 1e-18);
  EXPECT_EQ(D.luminescence(0, 70), 0.0);
  const Eigen::MatrixXd L = D.luminescence;
  // Rank 1 below the diagonal: 2 x 2 minors vanish.
  EXPECT_NEAR(L(60, 30) * L(55, 35), L(60, 35) * L(55, 30), 1e-18);
}

TEST(ReadDonaldson, FaintBandsOfATripleAreKept) {
  // There is no noise in a formula: an emission of a thousandth of the peak is as true as the peak.
  const TableText file("wavelength_nm,S,alpha,beta\n400,0.2,0,0.05\n410,0.3,0.001,0.05\n420,0.4,1,0\n");
  const WavelengthGrid grid = WavelengthGrid::uniform(400, 420, 10);
  const DonaldsonReading reading = read_donaldson(file.path(), grid);
  EXPECT_NEAR(reading.donaldson.luminescence(1, 0), 0.001 * 0.05 * 10.0, 1e-18);
  EXPECT_NEAR(reading.donaldson.luminescence(2, 0), 0.5, 1e-15);
  EXPECT_NEAR(reading.donaldson.luminescence(2, 1), 0.5, 1e-15);
  EXPECT_TRUE(reading.warnings.empty());
}

/// Root mean square difference of the total radiance factors under flat light, 400 to 700 nm.
double rms_difference(const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
  return std::sqrt((a - b).tail(61).squaredNorm() / 61.0);
}

TEST(ReadDonaldson, MeasuredMatrixAndTripleAgree) {
  // The triple is the best rank-1 product, made by another program; for these samples rank 1 leaves 1 to 4 % of the
  // squared luminescence, so total radiance factors up to 1.4 agree within a few hundredths.
  for (const std::string sample :
       {"paper_red", "paper_yellow", "paper_magenta", "paper_green", "pigment_red", "pigment_chartreuse"}) {
    const auto full = read_donaldson(find_table("interglow:fluorescent/" + sample), kPaperGrid);
    const auto triple = read_donaldson(find_table("interglow:fluorescent/" + sample + "_triple"), kPaperGrid);
    EXPECT_LT(rms_difference(under_flat_light(full.donaldson), under_flat_light(triple.donaldson)), 0.03) << sample;
    EXPECT_LE(emitted_over_received(full.donaldson, kPaperGrid).maxCoeff(), 1.0) << sample;
    EXPECT_TRUE(validate(Material{sample, full.donaldson}, kPaperGrid).empty()) << sample;
  }
}

TEST(ReadDonaldson, AgreesWithIndependentlyResampledMatrices) {
  const std::filesystem::path folder = std::filesystem::path(INTERGLOW_SHARED_DATA) / "spectral/fluorescent";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is absent";
  // Stated accuracy of those 5 nm matrices: RMS difference to the measured 10 nm totals 0.010 in the median, 0.054 at
  // worst.
  std::vector<double> differences;
  for (const auto& entry : std::filesystem::directory_iterator(folder / "donaldson_10nm_measured")) {
    const DonaldsonMatrix ours = read_donaldson(entry.path(), kPaperGrid).donaldson;
    const BispectralTable theirs = read_bispectral_table(folder / "donaldson_5nm" / entry.path().filename());
    differences.push_back(rms_difference(under_flat_light(ours), theirs.radiance_factor.rowwise().sum()));
    EXPECT_LT(differences.back(), 0.054) << entry.path();
  }
  ASSERT_GE(differences.size(), 36U);
  std::sort(differences.begin(), differences.end());
  EXPECT_LT(differences[differences.size() / 2], 0.010);
}

TEST(ReadReflectance, HoldsTheEndsAndSaysSo) {
  const DonaldsonReading reading =
      read_reflectance(find_table("interglow:reflectances/matte_papers"), "pink", kPaperGrid);
  EXPECT_FALSE(reading.donaldson.luminesces());
  EXPECT_NEAR(reading.donaldson.reflectance[0], 0.2992, 1e-15);  // the value at 400 nm
  ASSERT_EQ(reading.warnings.size(), 1U);
  EXPECT_THAT(reading.warnings[0], HasSubstr("held"));
  const TableText percent("wavelength_nm,S\n400,55\n410,60\n");
  EXPECT_THAT(message_of<InvalidInput>([&] { read_reflectance(percent.path(), "S", kPaperGrid); }),
              HasSubstr("percentages"));
}

}  // namespace
}  // namespace interglow::spectral
