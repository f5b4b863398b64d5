// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/silhouette.h"

#include <algorithm>
#include <cmath>

#include "fitting/compression.h"

namespace interglow::fitting {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using radiosity::RowMatrix;

/// Share of each pixel that something bright covers, from the mean of its bands. Half-covered pixels of a dim surface
/// count as half.
RowMatrix bright_share(const FitData& data) {
  std::vector<float> level;
  const Index bands = data.image.bands();
  for (Index p = 0; p < static_cast<Index>(data.use.size()); ++p)
    level.push_back(Eigen::Map<const Eigen::VectorXf>(data.image.value.data() + p * bands, bands).mean());
  std::vector<float> sorted = level;
  const double dark = quantile(sorted, 0.02);
  const double bright = quantile(sorted, 0.9);
  RowMatrix seen(level.size(), 1);
  for (std::size_t p = 0; p < level.size(); ++p) {
    seen(static_cast<Index>(p), 0) =
        std::clamp((static_cast<double>(level[p]) - dark) / (0.15 * (bright - dark) + 1e-300), 0.0, 1.0);
  }
  return seen;
}

constexpr double kCoverageSigma = 0.1;  ///< what is bright is not quite what is covered

}  // namespace

FitStage align_silhouettes(const ForwardModel& model, const FitData& data, FitState& state, const Progress& progress) {
  const RowMatrix seen = bright_share(data);
  const std::vector<int> pose{kTurnX, kTurnY, kTurnZ, kShiftX, kShiftY, kShiftZ};
  const FitState start = state;
  FitStage whole;
  for (const double blur : {4.0, 1.5}) {
    const VectorXd target = blurred(seen, data.image.width, data.image.height, blur).col(0);
    const Linearise linearise = [&](FitState& at, bool with_derivatives) {
      const CoverageEvaluation here = model.coverage(at.camera, blur, with_derivatives ? pose : std::vector<int>{});
      MatrixXd rows(target.size(), with_derivatives ? 7 : 1);
      for (std::size_t k = 0; k < here.derivative.size(); ++k) rows.col(static_cast<Index>(k)) = here.derivative[k];
      rows.rightCols(1) = target - here.value;
      rows /= kCoverageSigma;
      for (Index p = 0; p < rows.rows(); ++p) {
        if (!data.use[static_cast<std::size_t>(p)]) rows.row(p).setZero();
      }
      Linearisation result;
      result.cost = rows.rightCols(1).squaredNorm();
      if (with_derivatives) {
        TileQr qr(7);
        qr.add(rows);
        result.triangle = qr.triangle();
      }
      return result;
    };
    const FitStage part = minimize(state, pose, linearise,
                                   {.name = "silhouettes",
                                    .most_iterations = 25,
                                    .tolerance = 1e-4,
                                    .residuals = static_cast<double>(data.use.size()),
                                    .believed = start},
                                   progress);
    const int before = whole.iterations;
    whole = part;
    whole.iterations += before;
  }
  return whole;
}

}  // namespace interglow::fitting
