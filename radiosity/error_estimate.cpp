// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/error_estimate.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "radiosity/discretisation_error.h"

namespace interglow::radiosity {
namespace {

/// Band integrals of a component per element, and of its estimated error.
struct Integrated {
  Eigen::VectorXd value;
  Eigen::VectorXd error;
};

ComponentError operator+(const ComponentError& a, const ComponentError& b) {
  return {a.mean + b.mean, a.element + b.element};
}
ComponentError operator*(double factor, const ComponentError& error) {
  return {factor * error.mean, factor * error.element};
}

/// @param more  relative errors that are not of discretisation
ComponentError component_error(const Integrated& component, const Elements& elements, const ComponentError& more) {
  const Eigen::VectorXd& area = elements.area_mm2;
  const double flux = area.dot(component.value);
  if (!(flux > 0.0)) return {};
  const int objects = *std::max_element(elements.object.begin(), elements.object.end()) + 1;
  Eigen::VectorXd of_object = Eigen::VectorXd::Zero(objects);
  for (Eigen::Index e = 0; e < area.size(); ++e)
    of_object[elements.object[static_cast<std::size_t>(e)]] += area[e] * component.error[e];
  const double rms = std::sqrt(area.dot(component.error.cwiseAbs2()) * area.sum());
  return kDiscretisationSafety * ComponentError{of_object.lpNorm<1>() / flux, rms / flux} + more;
}

/// Σ A excess / Σ A, where a patch with corner normals tilted by θ lacks about mean(θ²) / 6 of its area (an arc's
/// chord).
double faceting(const scene::Scene& scene) {
  double area = 0.0;
  double lost = 0.0;
  for (const scene::Object& object : scene.objects) {
    const mesh::PatchMesh& mesh = object.patches;
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
      const Eigen::Vector3d vector_area = mesh::vector_area(mesh, mesh.faces[f]);
      area += vector_area.norm();
      if (mesh.corner_normals.empty()) continue;
      const int corners = mesh::corner_count(mesh.faces[f]);
      double tilt_squared = 0.0;
      for (int k = 0; k < corners; ++k) {
        const Eigen::Vector3d& normal = mesh.corner_normals[f][static_cast<std::size_t>(k)];
        const double tilt = std::atan2(normal.cross(vector_area).norm(), normal.dot(vector_area));
        tilt_squared += tilt * tilt / corners;
      }
      lost += vector_area.norm() * tilt_squared / 6.0;
    }
  }
  return area > 0.0 ? lost / area : 0.0;
}

}  // namespace

ErrorEstimate estimate_errors(const scene::Scene& scene, const Elements& elements, const Transport& transport,
                              const Solution& solution, const Progress& progress) {
  ErrorEstimate estimate;
  estimate.faceting = faceting(scene);
  const std::vector<spectral::Material>& materials = scene.materials;
  const std::vector<int>& material = elements.material;
  const Eigen::VectorXd& width_nm = scene.grid.widths_nm();
  const auto flux = [&](const RowMatrix& density) { return elements.area_mm2.dot(density * width_nm); };
  // Row errors are independent of one another: over many elements they cancel.
  const double row_error = transport.report().error_estimate_rms;
  double area = 0.0, area_squared = 0.0;
  for (Eigen::Index e = 0; e < elements.size(); ++e) {
    if (material[static_cast<std::size_t>(e)] < 0) continue;
    area += elements.area_mm2[e];
    area_squared += elements.area_mm2[e] * elements.area_mm2[e];
  }
  const ComponentError rows = {area > 0.0 ? row_error * std::sqrt(area_squared) / area : 0.0, row_error};

  // Skies and emitting surfaces reach the elements through form factors; beams are exact.
  double through_factors = 0.0;
  if (scene.sky) through_factors += std::numbers::pi * scene.sky->radiance.dot(width_nm);
  for (const scene::Object& object : scene.objects) {
    if (object.emits()) through_factors += object.exitance.dot(width_nm);
  }
  const double direct = flux(solution.direct);
  const ComponentError direct_error = (direct > 0.0 ? through_factors * elements.area_mm2.sum() / direct : 0.0) * rows +
                                      ComponentError{estimate.faceting, estimate.faceting};
  const Integrated re{reflect(solution.direct, materials, material) * width_nm, Eigen::VectorXd::Zero(elements.size())};
  const Integrated le{luminesce(solution.direct, materials, material) * width_nm,
                      Eigen::VectorXd::Zero(elements.size())};
  estimate.re = component_error(re, elements, direct_error);
  estimate.le = component_error(le, elements, direct_error);
  Integrated total{re.value + le.value, re.error};
  estimate.total = component_error(total, elements, direct_error);
  if (solution.reflected_source.size() == 0) return estimate;

  const bool luminesces = solution.luminescent.size() > 0;
  RowMatrix sources = solution.reflected_source;
  if (luminesces) sources += solution.luminescent_source;
  const Eigen::VectorXd source = sources * width_nm;
  const double first_source = elements.area_mm2.dot(total.value);
  const double indirect = flux(solution.reflected) + (luminesces ? flux(solution.luminescent) : 0.0);
  ComponentError more = direct_error;
  if (first_source > 0.0 && indirect > 0.0) {
    const double source_flux = elements.area_mm2.dot(source);
    const double source_rms = std::sqrt(elements.area_mm2.dot(source.cwiseAbs2()) * elements.area_mm2.sum());
    // How often light goes to and fro: all sources over those of direct light.
    const double amplification = source_flux / first_source;
    estimate.form_factors = amplification * source_flux / indirect * rows;
    estimate.residual = solution.relative_residual * amplification;
    // A hollow patch also sends light to itself, by its share of the sphere that fits it, which is about what flat
    // patches lack of its area.
    const ComponentError curved =
        estimate.faceting * amplification / indirect * ComponentError{source_flux, source_rms};
    more = estimate.form_factors + ComponentError{estimate.residual, estimate.residual} + curved;
  }

  const IrradianceError error = discretisation_error(elements, transport, materials, solution, progress);
  const Integrated rr{reflect(solution.reflected, materials, material) * width_nm,
                      reflect(error.reflected, materials, material) * width_nm};
  Integrated li{luminesce(solution.reflected, materials, material) * width_nm,
                luminesce(error.reflected, materials, material) * width_nm};
  Integrated rl{Eigen::VectorXd::Zero(elements.size()), Eigen::VectorXd::Zero(elements.size())};
  if (luminesces) {
    li.value += luminesce(solution.luminescent, materials, material) * width_nm;
    li.error += luminesce(error.luminescent, materials, material) * width_nm;
    rl = {reflect(solution.luminescent, materials, material) * width_nm,
          reflect(error.luminescent, materials, material) * width_nm};
  }
  estimate.rr = component_error(rr, elements, more);
  estimate.li = component_error(li, elements, more);
  estimate.rl = component_error(rl, elements, more);
  const Eigen::VectorXd indirect_value = rr.value + li.value + rl.value;
  total.value += indirect_value;
  total.error = rr.error + li.error + rl.error;
  const double whole = elements.area_mm2.dot(total.value);
  const double indirect_share = whole > 0.0 ? elements.area_mm2.dot(indirect_value) / whole : 0.0;
  estimate.total = component_error(total, elements, (1.0 - indirect_share) * direct_error + indirect_share * more);
  estimate.assessed_share = error.assessed_share;
  return estimate;
}

}  // namespace interglow::radiosity
