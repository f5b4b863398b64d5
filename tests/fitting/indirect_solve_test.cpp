// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/indirect_solve.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <optional>
#include <vector>

#include "fit_scenes.h"
#include "fitting/fit_mesh.h"

namespace interglow::fitting {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using radiosity::RowMatrix;

// Oracle: the same equation as one full matrix, elements × modes, by LU. Faces are graded towards the contact, so that
// cells hold elements of very different sizes and the light changes within them as quickly as it ever does.
class IndirectSolveOf : public testing::Test {
 protected:
  scene::Scene scene_ = fit_mesh(test::half_cylinders({.around = 6, .along = 2, .bands = 3, .side_px = 8}),
                                 {.most_turn_deg = 90.0, .contact_halvings = 2});
  radiosity::Elements elements_ = radiosity::make_elements(scene_);
  radiosity::Transport transport_ = radiosity::Transport::build(elements_, {});
  SpectralReduction spectra_ = reduce_spectra(scene_, VectorXd::Ones(scene_.grid.size()), 1e-2);

  std::vector<MatrixXd> reflection() const {
    return {1.05 * spectra_.from_indirect[0], 0.98 * spectra_.from_indirect[1]};
  }

  /// 1 - S F.
  MatrixXd system() const {
    const Index modes = spectra_.modes();
    MatrixXd result = MatrixXd::Identity(elements_.size() * modes, elements_.size() * modes);
    for (Index i = 0; i < elements_.size(); ++i) {
      const int m = elements_.material[static_cast<std::size_t>(i)];
      if (m < 0) continue;
      for (Index j = 0; j < elements_.size(); ++j) {
        result.block(i * modes, j * modes, modes, modes) -=
            transport_.form_factor(i, j) * reflection()[static_cast<std::size_t>(m)].transpose();
      }
    }
    return result;
  }

  /// Two sources: light on the left half cylinder alone, and a change of both signs.
  RowMatrix sources() const {
    const Index modes = spectra_.modes();
    RowMatrix first = RowMatrix::Zero(elements_.size(), 2 * modes);
    for (Index e = 0; e < elements_.size(); ++e) {
      const auto i = static_cast<std::size_t>(e);
      if (elements_.material[i] < 0) continue;
      if (elements_.object[i] == 0) first(e, 0) = 1.0 + elements_.centroid(e, 1) / 50.0;
      first(e, modes + 1) = std::sin(7.0 * static_cast<double>(e));
    }
    return first;
  }
};

TEST_F(IndirectSolveOf, MeetsTheFullMatrix) {
  const Index modes = spectra_.modes();
  ASSERT_GE(modes, 2);
  const IndirectSolve solve(elements_, transport_, spectra_);
  EXPECT_LT(solve.cells(), elements_.size() / 4);
  const RowMatrix first = sources();
  const RowMatrix ours = solve.radiosity(first, reflection(), std::nullopt, 1e-11);
  const Eigen::PartialPivLU<MatrixXd> lu(system());
  for (Index s = 0; s < 2; ++s) {
    const RowMatrix right = first.middleCols(s * modes, modes);
    const VectorXd truth = lu.solve(Eigen::Map<const VectorXd>(right.data(), right.size()));
    const RowMatrix block = ours.middleCols(s * modes, modes);
    const VectorXd found = Eigen::Map<const VectorXd>(block.data(), block.size());
    EXPECT_LT((found - truth).cwiseAbs().maxCoeff(), 1e-9 * truth.cwiseAbs().maxCoeff()) << "source " << s;
  }
}

TEST_F(IndirectSolveOf, BouncesAreTheTermsOfTheSeries) {
  const IndirectSolve solve(elements_, transport_, spectra_);
  const RowMatrix first = sources();
  const Index modes = spectra_.modes();
  const RowMatrix right = first.leftCols(modes);
  const MatrixXd bounce = MatrixXd::Identity(right.size(), right.size()) - system();
  const VectorXd e = Eigen::Map<const VectorXd>(right.data(), right.size());
  const VectorXd truth = e + bounce * (e + bounce * e);
  const RowMatrix block = solve.radiosity(first, reflection(), 3, 1e-11).leftCols(modes);
  EXPECT_LT((Eigen::Map<const VectorXd>(block.data(), block.size()) - truth).cwiseAbs().maxCoeff(),
            1e-12 * truth.cwiseAbs().maxCoeff());
}

}  // namespace
}  // namespace interglow::fitting
