// SPDX-License-Identifier: GPL-3.0-or-later
#include "rendering/light_channels.h"

#include <Eigen/Eigenvalues>
#include <numbers>

namespace interglow::rendering {

using radiosity::RowMatrix;

Factors factorise(const RowMatrix& a) {
  Factors factors;
  const Eigen::Index bands = a.cols();
  if (a.size() == 0) return factors;
  const Eigen::MatrixXd gram = a.transpose() * a;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(gram);
  // Eigenvalues are squared singular values, known to the rounding of the largest.
  const double least = std::max(eigen.eigenvalues()[bands - 1] * 1e-14, 0.0);
  Eigen::Index rank = 0;
  while (rank < bands && eigen.eigenvalues()[bands - 1 - rank] > least) ++rank;
  factors.spectrum = eigen.eigenvectors().rightCols(rank).transpose();
  factors.coefficient = a * factors.spectrum.transpose();
  return factors;
}

LightChannels light_channels(const scene::Scene& scene, const radiosity::Elements& elements,
                             const radiosity::Solution& solution) {
  LightChannels channels;
  const Eigen::Index count = elements.size();
  const Eigen::VectorXd& width = scene.grid.widths_nm();
  const Factors reflected = factorise(solution.reflected_source);
  const Factors luminescent = factorise(solution.luminescent_source);
  channels.reflected = static_cast<int>(reflected.spectrum.rows());
  channels.luminescent = static_cast<int>(luminescent.spectrum.rows());
  channels.reflected_spectrum = reflected.spectrum;
  channels.luminescent_spectrum = luminescent.spectrum;
  for (std::size_t o = 0; o < scene.objects.size(); ++o) {
    if (scene.objects[o].emits()) channels.emitters.push_back(static_cast<int>(o));
  }
  channels.sky = scene.sky.has_value();

  const Eigen::Index columns = channels.sky_channel() + (channels.sky ? 1 : 0);
  channels.source = RowMatrix::Zero(count, columns);
  channels.weight = Eigen::VectorXd::Zero(columns);
  channels.strength = Eigen::VectorXd::Zero(count);
  if (channels.reflected > 0) {
    channels.source.leftCols(channels.reflected) = reflected.coefficient;
    channels.weight.head(channels.reflected) = reflected.spectrum.cwiseAbs() * width;
    channels.strength += solution.reflected_source.cwiseAbs() * width;
  }
  if (channels.luminescent > 0) {
    channels.source.middleCols(channels.reflected, channels.luminescent) = luminescent.coefficient;
    channels.weight.segment(channels.reflected, channels.luminescent) = luminescent.spectrum.cwiseAbs() * width;
    channels.strength += solution.luminescent_source.cwiseAbs() * width;
  }
  for (std::size_t k = 0; k < channels.emitters.size(); ++k) {
    const int object = channels.emitters[k];
    const double power = scene.objects[static_cast<std::size_t>(object)].exitance.cwiseAbs().dot(width);
    const Eigen::Index column = channels.first_emitter() + static_cast<Eigen::Index>(k);
    channels.weight[column] = power;
    for (Eigen::Index e = 0; e < count; ++e) {
      const auto i = static_cast<std::size_t>(e);
      if (elements.object[i] != object || elements.back[i]) continue;
      channels.source(e, column) = 1.0;
      channels.strength[e] += power;
    }
  }
  if (channels.sky) {
    const double power = std::numbers::pi * scene.sky->radiance.dot(width);
    channels.source.col(channels.sky_channel()).setOnes();
    channels.weight[channels.sky_channel()] = power;
    channels.strength.array() += power;
  }
  // Elements whose light is rounding, or the residual of an iteration, are dark.
  if (count > 0) {
    const double dark = 1e-12 * channels.strength.maxCoeff();
    for (Eigen::Index e = 0; e < count; ++e) {
      if (channels.strength[e] <= dark) channels.strength[e] = 0.0;
    }
  }

  Eigen::VectorXd irradiance = solution.direct * width;
  if (solution.reflected.size() > 0) irradiance += solution.reflected * width;
  if (solution.luminescent.size() > 0) irradiance += solution.luminescent * width;
  const double flux = elements.area_mm2.dot(irradiance);
  if (flux > 0.0) channels.mean_irradiance = elements.area_mm2.dot(irradiance.cwiseAbs2()) / flux;
  return channels;
}

}  // namespace interglow::rendering
