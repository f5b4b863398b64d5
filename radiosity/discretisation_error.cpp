// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/discretisation_error.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

namespace interglow::radiosity {
namespace {

/// Two levels of a mesh with half the edge length: four elements for one.
constexpr std::size_t kAggregateSize = 4;
/// Neighbours whose normals differ by more than 40° meet at a crease, across which light is not smooth.
constexpr double kCreaseCosine = 0.766;
/// Centroids within a tenth of its length are on one line.
constexpr double kLine = 1e-2;
/// The estimate needs two digits.
constexpr double kSolveTolerance = 1e-2;
/// Sources are represented to this share, relative to all of them.
constexpr double kRepresentation = 1e-3;

/// Elements that share an edge, per element, in the order of its edges.
std::vector<std::vector<int>> neighbours(const Elements& elements) {
  struct Side {
    std::pair<int, int> edge;
    int element;
    bool operator<(const Side& other) const { return std::tie(edge, element) < std::tie(other.edge, other.element); }
  };
  std::vector<Side> sides;
  for (Eigen::Index e = 0; e < elements.size(); ++e) {
    const auto i = static_cast<std::size_t>(e);
    if (elements.material[i] < 0) continue;
    const mesh::Face& face = elements.faces.corners[static_cast<std::size_t>(elements.face[i])];
    const int corners = mesh::corner_count(face);
    for (int k = 0; k < corners; ++k) {
      const int a = face[static_cast<std::size_t>(k)];
      const int b = face[static_cast<std::size_t>((k + 1) % corners)];
      sides.push_back({{std::min(a, b), std::max(a, b)}, static_cast<int>(e)});
    }
  }
  std::sort(sides.begin(), sides.end());
  std::vector<std::vector<int>> result(static_cast<std::size_t>(elements.size()));
  const auto joined = [&](int a, int b) {
    const auto i = static_cast<std::size_t>(a), j = static_cast<std::size_t>(b);
    return elements.back[i] == elements.back[j] && elements.normal.row(a).dot(elements.normal.row(b)) > kCreaseCosine;
  };
  for (std::size_t first = 0; first < sides.size();) {
    std::size_t end = first + 1;
    while (end < sides.size() && sides[end].edge == sides[first].edge) ++end;
    for (std::size_t s = first; s < end; ++s) {
      for (std::size_t t = first; t < end; ++t) {
        if (s != t && joined(sides[s].element, sides[t].element))
          result[static_cast<std::size_t>(sides[s].element)].push_back(sides[t].element);
      }
    }
    first = end;
  }
  return result;
}

/// ∫ (x - c)(x - c)ᵀ dA over the face of an element, c its centroid.
Eigen::Matrix3d second_moment(const Elements& elements, Eigen::Index e) {
  const mesh::Face& face = elements.faces.corners[static_cast<std::size_t>(elements.face[static_cast<std::size_t>(e)])];
  const Eigen::Vector3d c = elements.centroid.row(e).transpose();
  const auto corner = [&](int k) -> Eigen::Vector3d {
    return elements.faces.points[static_cast<std::size_t>(face[static_cast<std::size_t>(k)])] - c;
  };
  Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
  for (int k = 1; k + 1 < mesh::corner_count(face); ++k) {
    const std::array<Eigen::Vector3d, 3> p = {corner(0), corner(k), corner(k + 1)};
    const double area = 0.5 * (p[1] - p[0]).cross(p[2] - p[0]).norm();
    const Eigen::Vector3d sum = p[0] + p[1] + p[2];
    // ∫ x xᵀ over a triangle = A/12 (Σ p pᵀ + s sᵀ), s the sum of its corners.
    moment += area / 12.0 *
              (p[0] * p[0].transpose() + p[1] * p[1].transpose() + p[2] * p[2].transpose() + sum * sum.transpose());
  }
  return moment;
}

/// Within over between, in the directions in which the centroids of the members differ. Where they differ along one
/// line only (two triangles), the other direction of the surface counts as much.
double spread_ratio(const Elements& elements, const std::vector<int>& members) {
  if (members.size() < 2) return 0.0;
  double area = 0.0;
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  for (const int e : members) {
    area += elements.area_mm2[e];
    center += elements.area_mm2[e] * elements.centroid.row(e).transpose();
  }
  center /= area;
  Eigen::Matrix3d between = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d within = Eigen::Matrix3d::Zero();
  for (const int e : members) {
    const Eigen::Vector3d d = elements.centroid.row(e).transpose() - center;
    between += elements.area_mm2[e] * d * d.transpose();
    within += second_moment(elements, e);
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(between);
  double inside = 0.0;
  int directions = 0;
  for (int k = 1; k < 3; ++k) {
    if (axes.eigenvalues()[k] < kLine * axes.eigenvalues()[2]) continue;
    const Eigen::Vector3d axis = axes.eigenvectors().col(k);
    inside += axis.dot(within * axis);
    ++directions;
  }
  return 2.0 / directions * inside / between.trace();
}

}  // namespace

Aggregates aggregate(const Elements& elements) {
  const std::vector<std::vector<int>> near = neighbours(elements);
  const auto n = static_cast<std::size_t>(elements.size());
  std::vector<int> of_element(n, -1);
  std::vector<std::vector<int>> members;
  for (std::size_t seed = 0; seed < n; ++seed) {
    if (of_element[seed] >= 0) continue;
    const int at = static_cast<int>(members.size());
    std::vector<int> group = {static_cast<int>(seed)};
    of_element[seed] = at;
    Eigen::Vector3d center = elements.centroid.row(static_cast<Eigen::Index>(seed)).transpose();
    while (group.size() < kAggregateSize) {
      int best = -1;
      double best_distance = std::numeric_limits<double>::infinity();
      for (const int member : group) {
        for (const int e : near[static_cast<std::size_t>(member)]) {
          if (of_element[static_cast<std::size_t>(e)] >= 0) continue;
          const double distance = (elements.centroid.row(e).transpose() - center).squaredNorm();
          if (distance < best_distance || (distance == best_distance && e < best)) best = e, best_distance = distance;
        }
      }
      if (best < 0) break;
      of_element[static_cast<std::size_t>(best)] = at;
      group.push_back(best);
      center = Eigen::Vector3d::Zero();
      for (const int member : group) center += elements.centroid.row(member).transpose();
      center /= static_cast<double>(group.size());
    }
    if (group.size() == 1 && !near[seed].empty()) {
      // All neighbours are taken: the smallest of their aggregates takes this one as well.
      int smallest = -1;
      for (const int e : near[seed]) {
        const int other = of_element[static_cast<std::size_t>(e)];
        if (smallest < 0 ||
            members[static_cast<std::size_t>(other)].size() < members[static_cast<std::size_t>(smallest)].size())
          smallest = other;
      }
      of_element[seed] = smallest;
      members[static_cast<std::size_t>(smallest)].push_back(static_cast<int>(seed));
    } else {
      members.push_back(std::move(group));
    }
  }
  Aggregates aggregates{std::move(of_element), Eigen::VectorXd::Zero(static_cast<Eigen::Index>(members.size())),
                        Eigen::VectorXd::Zero(static_cast<Eigen::Index>(members.size()))};
  for (std::size_t a = 0; a < members.size(); ++a) {
    const auto at = static_cast<Eigen::Index>(a);
    aggregates.spread_ratio[at] = spread_ratio(elements, members[a]);
    for (const int e : members[a]) aggregates.area_mm2[at] += elements.area_mm2[e];
  }
  return aggregates;
}

namespace {

/// κ (I - Π) X.
RowMatrix unresolved(const Aggregates& aggregates, const Eigen::VectorXd& area_mm2, const RowMatrix& sources) {
  RowMatrix mean = RowMatrix::Zero(aggregates.area_mm2.size(), sources.cols());
  for (Eigen::Index e = 0; e < sources.rows(); ++e)
    mean.row(aggregates.of_element[static_cast<std::size_t>(e)]) += area_mm2[e] * sources.row(e);
  mean.array().colwise() /= aggregates.area_mm2.array();
  RowMatrix rest(sources.rows(), sources.cols());
  for (Eigen::Index e = 0; e < sources.rows(); ++e) {
    const int a = aggregates.of_element[static_cast<std::size_t>(e)];
    rest.row(e) = aggregates.spread_ratio[a] * (sources.row(e) - mean.row(a));
  }
  return rest;
}

double assessed_share(const Aggregates& aggregates, const Elements& elements, const Solution& solution) {
  double sending = 0.0;
  double assessed = 0.0;
  for (Eigen::Index e = 0; e < elements.size(); ++e) {
    const bool sends =
        (solution.reflected_source.row(e).array() != 0.0).any() ||
        (solution.luminescent_source.size() > 0 && (solution.luminescent_source.row(e).array() != 0.0).any());
    if (!sends) continue;
    sending += elements.area_mm2[e];
    if (aggregates.spread_ratio[aggregates.of_element[static_cast<std::size_t>(e)]] > 0.0)
      assessed += elements.area_mm2[e];
  }
  return sending > 0.0 ? assessed / sending : 1.0;
}

/// F X for bands that span few dimensions: their principal components are multiplied.
RowMatrix apply_compressed(const Transport& transport, const RowMatrix& x) {
  const Eigen::MatrixXd gram = x.transpose() * transport.area_mm2().asDiagonal() * x;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> principal(gram);
  const double smallest = kRepresentation * kRepresentation * principal.eigenvalues().sum();
  Eigen::Index kept = 0;
  while (kept < gram.cols() && principal.eigenvalues()[gram.cols() - 1 - kept] > smallest) ++kept;
  if (kept == 0) return RowMatrix::Zero(x.rows(), x.cols());
  const Eigen::MatrixXd directions = principal.eigenvectors().rightCols(kept);
  return transport.apply(x * directions) * directions.transpose();
}

}  // namespace

IrradianceError discretisation_error(const Elements& elements, const Transport& transport,
                                     const std::vector<spectral::Material>& materials, const Solution& solution,
                                     const Progress& progress) {
  const Eigen::Index n = solution.direct.rows();
  const Eigen::Index bands = solution.direct.cols();
  IrradianceError error{RowMatrix::Zero(n, bands), RowMatrix()};
  const bool luminesces = solution.luminescent.size() > 0;
  if (luminesces) error.luminescent = RowMatrix::Zero(n, bands);
  if (solution.reflected_source.size() == 0) return error;

  const Aggregates aggregates = aggregate(elements);
  error.assessed_share = assessed_share(aggregates, elements, solution);
  SolveParams params{.tolerance = kSolveTolerance};
  if (solution.bounces) params.bounces = *solution.bounces - 1;
  // Light of one history, from its unresolved sources to all that follows from them.
  const auto follow = [&](const RowMatrix& source) {
    const RowMatrix first = apply_compressed(transport, unresolved(aggregates, transport.area_mm2(), source));
    return solve(transport, materials, elements.material, first, params, progress);
  };
  const Solution reflected = follow(solution.reflected_source);
  error.reflected = reflected.direct + reflected.reflected;
  if (!luminesces) return error;
  const Solution luminescent = follow(solution.luminescent_source);
  error.luminescent = reflected.luminescent + luminescent.direct + luminescent.reflected + luminescent.luminescent;
  return error;
}

}  // namespace interglow::radiosity
