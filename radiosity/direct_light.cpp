// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/direct_light.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <Eigen/Geometry>

#include <array>
#include <cmath>
#include <numbers>
#include <span>

#include "diagnostics/error.h"
#include "radiosity/beam_view.h"

namespace interglow::radiosity {
namespace {

constexpr Eigen::Index kChunkElements = 64;

/// 8 directions on rings at shares `node` of the disk's area, of these weights; each ring turned against the last.
std::vector<BeamDirection> directions_on_rings(const Eigen::Vector3d& axis, double half_angle_rad,
                                               std::span<const double> node, std::span<const double> weight) {
  if (half_angle_rad == 0.0) return {{axis, 1.0}};
  constexpr int kAngles = 8;
  const Eigen::Vector3d u = axis.unitOrthogonal();
  const Eigen::Vector3d v = axis.cross(u);
  std::vector<BeamDirection> directions;
  for (std::size_t ring = 0; ring < node.size(); ++ring) {
    const double radius = std::sin(half_angle_rad) * std::sqrt(node[ring]);
    const double cosine = std::sqrt(1.0 - radius * radius);
    for (int k = 0; k < kAngles; ++k) {
      const double angle = 2.0 * std::numbers::pi * (k + 0.25 * static_cast<double>(ring)) / kAngles;
      const Eigen::Vector3d direction = cosine * axis + radius * (std::cos(angle) * u + std::sin(angle) * v);
      directions.push_back({direction, weight[ring] / kAngles / cosine});
    }
  }
  return directions;
}

}  // namespace

std::vector<BeamDirection> disk_directions(const Eigen::Vector3d& axis, double half_angle_rad) {
  constexpr std::array<double, 4> kNode = {0.0694318442029737, 0.3300094782075719, 0.6699905217924281,
                                           0.9305681557970263};
  constexpr std::array<double, 4> kWeight = {0.1739274225687269, 0.3260725774312731, 0.3260725774312731,
                                             0.1739274225687269};
  return directions_on_rings(axis, half_angle_rad, kNode, kWeight);
}

std::vector<BeamDirection> ring_directions(const Eigen::Vector3d& axis, double half_angle_rad) {
  constexpr std::array<double, 1> kNode = {0.5};
  constexpr std::array<double, 1> kWeight = {1.0};
  return directions_on_rings(axis, half_angle_rad, kNode, kWeight);
}

LightTerm directional_term(const scene::DirectionalLight& light, const Elements& elements, const Progress& progress) {
  if (std::abs(light.direction.norm() - 1.0) > 1e-9) {
    throw InvalidParams(
        fmt::format("light {}: direction has length {}; expected a unit vector.", light.name, light.direction.norm()));
  }
  if (!(light.half_angle_rad >= 0.0 && light.half_angle_rad < 0.5 * std::numbers::pi)) {
    throw InvalidParams(
        fmt::format("light {}: half_angle_rad {}; expected a value in [0, π/2).", light.name, light.half_angle_rad));
  }
  LightTerm term{light.name, Eigen::VectorXd::Zero(elements.size()), light.normal_irradiance};
  const std::vector<BeamDirection> directions = disk_directions(light.direction.normalized(), light.half_angle_rad);
  const Eigen::Index chunks = (elements.size() + kChunkElements - 1) / kChunkElements;
  for (std::size_t k = 0; k < directions.size(); ++k) {
    progress.update("direct light", static_cast<double>(k) / static_cast<double>(directions.size()));
    const BeamView view(elements.faces, directions[k].direction);
    tbb::parallel_for(Eigen::Index{0}, chunks, [&](Eigen::Index chunk) {
      const Eigen::Index end = std::min(elements.size(), (chunk + 1) * kChunkElements);
      for (Eigen::Index e = chunk * kChunkElements; e < end; ++e) {
        const double lit =
            view.lit_area(elements.face[static_cast<std::size_t>(e)], elements.normal.row(e).transpose());
        term.geometric_factor[e] += directions[k].weight * lit / elements.area_mm2[e];
      }
    });
  }
  return term;
}

std::vector<LightTerm> direct_light(const scene::Scene& scene, const Elements& elements, const Transport& transport,
                                    const Progress& progress) {
  if (transport.size() != elements.size()) {
    throw InvalidParams(
        fmt::format("direct_light: a transport of {} elements for {} elements.", transport.size(), elements.size()));
  }
  std::vector<LightTerm> terms;
  for (const scene::DirectionalLight& light : scene.directional_lights)
    terms.push_back(directional_term(light, elements, progress));
  if (scene.sky) {
    // Rounding may lift a row sum of a closed scene over 1.
    const Eigen::VectorXd open = (1.0 - transport.row_sums().array()).max(0.0).matrix();
    terms.push_back({scene.sky->name, open, std::numbers::pi * scene.sky->radiance});
  }
  for (std::size_t o = 0; o < scene.objects.size(); ++o) {
    const scene::Object& object = scene.objects[o];
    if (!object.emits()) continue;
    RowMatrix front = RowMatrix::Zero(elements.size(), 1);
    for (Eigen::Index e = 0; e < elements.size(); ++e) {
      const auto i = static_cast<std::size_t>(e);
      if (elements.object[i] == static_cast<int>(o) && elements.back[i] == 0) front(e, 0) = 1.0;
    }
    terms.push_back({object.name, transport.apply(front).col(0), object.exitance});
  }
  return terms;
}

RowMatrix total(const std::vector<LightTerm>& terms, Eigen::Index elements, Eigen::Index bands) {
  RowMatrix sum = RowMatrix::Zero(elements, bands);
  for (const LightTerm& term : terms) {
    if (term.geometric_factor.size() != elements || term.spectrum.size() != bands) {
      throw InvalidParams(fmt::format("light {}: {} elements and {} bands; expected {} and {}.", term.name,
                                      term.geometric_factor.size(), term.spectrum.size(), elements, bands));
    }
    sum.noalias() += term.geometric_factor * term.spectrum.transpose();
  }
  return sum;
}

}  // namespace interglow::radiosity
