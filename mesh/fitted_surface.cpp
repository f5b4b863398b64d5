// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/fitted_surface.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "mesh/half_edges.h"

namespace interglow::mesh {
namespace {

using Eigen::Vector3d;
/// An arc of 90° rises by a fifth of its chord.
constexpr double kLargestRise = 0.2;
constexpr double kDegree = std::numbers::pi / 180;

/// The smooth fans of a mesh: corners that are connected around their point without crossing a crease form one node.
struct NodeGraph {
  std::vector<std::array<int, 3>> node_of;  ///< per triangle corner
  std::vector<int> point_of;                ///< per node
  std::vector<int> first, neighbours;       ///< compressed rows: neighbours of node n at first[n] … first[n + 1]
  std::vector<char> on_border;              ///< per node: its fan is not a full turn

  int size() const { return static_cast<int>(point_of.size()); }
};

NodeGraph make_nodes(const std::vector<std::array<int, 3>>& triangles, const std::vector<int>& opposite,
                     const std::vector<char>& is_crease) {
  NodeGraph graph;
  graph.node_of.assign(triangles.size(), {-1, -1, -1});
  for (std::size_t t = 0; t < triangles.size(); ++t)
    for (int k = 0; k < 3; ++k) {
      if (graph.node_of[t][k] >= 0) continue;
      const int node = graph.size();
      const int corner = static_cast<int>(3 * t) + k;  // the edge that leaves the corner's point
      graph.point_of.push_back(triangles[t][k]);
      bool full_turn = false;
      graph.node_of[t][k] = node;
      for (int edge = corner;;) {  // turn one way: over the edge that arrives at the point
        const int arriving = previous_edge(edge);
        if (opposite[arriving] < 0 || is_crease[arriving]) break;
        edge = opposite[arriving];
        if (edge == corner) {
          full_turn = true;
          break;
        }
        graph.node_of[edge / 3][edge % 3] = node;
      }
      for (int edge = corner; !full_turn;) {  // and the other way: over the edge that leaves it
        if (opposite[edge] < 0 || is_crease[edge]) break;
        edge = next_edge(opposite[edge]);
        graph.node_of[edge / 3][edge % 3] = node;
      }
      graph.on_border.push_back(!full_turn);
    }
  std::vector<std::pair<int, int>> links;
  links.reserve(6 * triangles.size());
  for (const auto& nodes : graph.node_of)
    for (int k = 0; k < 3; ++k) {
      links.emplace_back(nodes[k], nodes[(k + 1) % 3]);
      links.emplace_back(nodes[(k + 1) % 3], nodes[k]);
    }
  std::sort(links.begin(), links.end());
  links.erase(std::unique(links.begin(), links.end()), links.end());
  graph.first.assign(graph.point_of.size() + 1, 0);
  graph.neighbours.reserve(links.size());
  for (const auto& [from, to] : links) {
    ++graph.first[from + 1];
    graph.neighbours.push_back(to);
  }
  std::partial_sum(graph.first.begin(), graph.first.end(), graph.first.begin());
  return graph;
}

/// Walks the graph outwards from a node; one a thread.
class Neighbourhood {
 public:
  explicit Neighbourhood(int nodes) : seen_(nodes, 0) {}

  /// Nodes connected to `start` within `radius` whose normals are within 60° of its own (farther, a height field
  /// folds).
  const std::vector<int>& within(const NodeGraph& graph, const std::vector<Vector3d>& points,
                                 const std::vector<Vector3d>& normals, int start, double radius) {
    begin(start);
    const Vector3d& centre = points[graph.point_of[start]];
    for (std::size_t i = 0; i < found_.size(); ++i)
      for (int k = graph.first[found_[i]]; k < graph.first[found_[i] + 1]; ++k) {
        const int next = graph.neighbours[k];
        if (seen_[next] == stamp_) continue;
        seen_[next] = stamp_;
        if ((points[graph.point_of[next]] - centre).squaredNorm() <= radius * radius &&
            normals[next].dot(normals[start]) > 0.5)
          found_.push_back(next);
      }
    return found_;
  }

  /// The nearest rings of `start` that together have at least `count` nodes.
  const std::vector<int>& rings(const NodeGraph& graph, int start, std::size_t count) {
    begin(start);
    for (std::size_t ring = 0; found_.size() < count && ring < found_.size();) {
      const std::size_t end = found_.size();
      for (; ring < end; ++ring)
        for (int k = graph.first[found_[ring]]; k < graph.first[found_[ring] + 1]; ++k) {
          const int next = graph.neighbours[k];
          if (seen_[next] == stamp_) continue;
          seen_[next] = stamp_;
          found_.push_back(next);
        }
    }
    return found_;
  }

 private:
  void begin(int start) {
    ++stamp_;
    seen_[start] = stamp_;
    found_.assign(1, start);
  }
  std::vector<int> seen_, found_;
  int stamp_ = 0;
};

struct Fit {
  LocalQuadric quadric;
  double residual_variance = 0;  ///< mm², meaningful if degrees_of_freedom > 0
  int degrees_of_freedom = 0;
};

LocalQuadric frame_at(const Vector3d& origin, const Vector3d& normal) {
  LocalQuadric q;
  q.origin = origin;
  q.normal = normal;
  q.u = normal.unitOrthogonal();
  q.v = normal.cross(q.u);
  return q;
}

/// Weighted least squares over the nodes; `through_origin` makes the surface pass through the node's own point.
/// Falls back to a plane, then to the given normal, where the points do not determine more.
Fit fit_quadric(const NodeGraph& graph, const std::vector<Vector3d>& points, const std::vector<int>& nodes,
                const Vector3d& normal, double radius, double sigma, bool through_origin) {
  using Matrix6 = Eigen::Matrix<double, 6, 6>;
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  Fit fit;
  LocalQuadric& q = fit.quadric;
  q = frame_at(points[graph.point_of[nodes[0]]], normal);
  q.radius_mm = radius;
  Matrix6 normal_matrix = Matrix6::Zero(), noise_matrix = Matrix6::Zero();
  Vector6 right = Vector6::Zero();
  double square = 0;
  for (int node : nodes) {
    const Vector3d d = (points[graph.point_of[node]] - q.origin) / radius;
    const double u = d.dot(q.u), v = d.dot(q.v), z = d.dot(q.normal);
    const double w = std::max(0.02, 1 - d.squaredNorm());
    Vector6 row;
    row << 1, u, v, u * u, u * v, v * v;
    normal_matrix.noalias() += w * row * row.transpose();
    noise_matrix.noalias() += w * w * row * row.transpose();
    right += w * z * row;
    square += w * z * z;
  }
  const int count = static_cast<int>(nodes.size());
  const int skip = through_origin ? 1 : 0;
  for (int terms : {6, 3}) {
    const int n = terms - skip;
    if (count < terms + (terms == 6 ? 2 : 0)) continue;
    const Eigen::MatrixXd a = normal_matrix.block(skip, skip, n, n);
    const Eigen::LDLT<Eigen::MatrixXd> solver(a);
    const Eigen::VectorXd pivots = solver.vectorD();
    // Points on a line, or on a conic, leave a term free.
    if (solver.info() != Eigen::Success || !(pivots.minCoeff() > 1e-6 * pivots.maxCoeff())) continue;
    Eigen::VectorXd b(n);
    for (int i = 0; i < n; ++i) b[i] = right[i + skip];
    const Eigen::VectorXd c = solver.solve(b);
    const double residual = std::max(0.0, square - c.dot(b));
    fit.degrees_of_freedom = count - terms;
    fit.residual_variance =
        radius * radius * residual / normal_matrix(0, 0) * count / std::max(1, fit.degrees_of_freedom);
    for (int i = 0; i < n; ++i) {
      const int power = i + skip == 0 ? 0 : (i + skip < 3 ? 1 : 2);
      q.c[i + skip] = c[i] * std::pow(radius, 1 - power);
    }
    const Eigen::MatrixXd inverse = solver.solve(Eigen::MatrixXd::Identity(n, n));
    const Eigen::MatrixXd covariance = inverse * noise_matrix.block(skip, skip, n, n) * inverse;
    q.tilt_std_rad = sigma / radius * std::sqrt(covariance(1 - skip, 1 - skip) + covariance(2 - skip, 2 - skip));
    return fit;
  }
  return fit;
}

std::vector<Vector3d> triangle_normals(const std::vector<Vector3d>& points,
                                       const std::vector<std::array<int, 3>>& triangles) {
  std::vector<Vector3d> normals(triangles.size());
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    const auto& [a, b, c] = triangles[t];
    normals[t] = (points[b] - points[a]).cross(points[c] - points[a]) / 2;  // length: area
  }
  return normals;
}

Vector3d unit_or(const Vector3d& vector, const Vector3d& fallback) {
  const double length = vector.norm();
  return length > 0 ? Vector3d(vector / length) : fallback;
}

/// Averages normals between neighbouring triangles that differ little, so that noise goes and creases stay.
std::vector<Vector3d> bilateral_normals(std::vector<Vector3d> normals, const std::vector<int>& opposite,
                                        double width_rad, int rounds) {
  for (int round = 0; round < rounds; ++round) {
    std::vector<Vector3d> next(normals.size());
    tbb::parallel_for(std::size_t{0}, normals.size(), [&](std::size_t t) {
      Vector3d sum = normals[t];
      const Vector3d own = unit_or(normals[t], Vector3d::UnitZ());
      for (int k = 0; k < 3; ++k) {
        const int other = opposite[3 * t + k];
        if (other < 0) continue;
        const Vector3d theirs = unit_or(normals[other / 3], own);
        const double angle = std::acos(std::clamp(own.dot(theirs), -1.0, 1.0)) / width_rad;
        sum += std::exp(-angle * angle / 2) * normals[other / 3];
      }
      next[t] = unit_or(sum, own) * normals[t].norm();
    });
    normals = std::move(next);
  }
  return normals;
}

/// Marks edges bent by more than `angle_deg`. On noisy scans triangle normals are filtered first, and short chains
/// dropped.
std::vector<char> find_creases(const TriangleMesh& scan, const std::vector<int>& opposite, double angle_deg,
                               double sigma, double mean_edge) {
  std::vector<char> is_crease(opposite.size(), 0);
  if (angle_deg >= 180) return is_crease;
  std::vector<Vector3d> normals = triangle_normals(scan.points, scan.triangles);
  // The angle between two triangles has a standard deviation of about 2.5 σ / edge.
  const bool noisy = 3 * 2.5 * sigma / mean_edge > angle_deg * kDegree;
  if (noisy) normals = bilateral_normals(std::move(normals), opposite, 30 * kDegree, 20);
  const double cosine = std::cos(angle_deg * kDegree);
  for (std::size_t e = 0; e < opposite.size(); ++e) {
    if (opposite[e] < 0) continue;
    const Vector3d &a = normals[e / 3], &b = normals[opposite[e] / 3];
    is_crease[e] = a.dot(b) < cosine * a.norm() * b.norm();
  }
  if (!noisy) return is_crease;
  // Chains shorter than eight edges are left-over noise.
  std::vector<int> parent(scan.points.size());
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](int v) {
    while (parent[v] != v) v = parent[v] = parent[parent[v]];
    return v;
  };
  const auto from = [&](std::size_t e) { return scan.triangles[e / 3][e % 3]; };
  for (std::size_t e = 0; e < is_crease.size(); ++e)
    if (is_crease[e]) parent[root(from(e))] = root(scan.triangles[e / 3][(e % 3 + 1) % 3]);
  std::vector<int> chain_edges(scan.points.size(), 0);
  for (std::size_t e = 0; e < is_crease.size(); ++e)
    if (is_crease[e]) ++chain_edges[root(from(e))];
  for (std::size_t e = 0; e < is_crease.size(); ++e)
    if (is_crease[e] && chain_edges[root(from(e))] < 2 * 8) is_crease[e] = 0;
  return is_crease;
}

double mean_edge_length(const TriangleMesh& scan) {
  double sum = 0;
  for (const auto& t : scan.triangles)
    for (int k = 0; k < 3; ++k) sum += (scan.points[t[k]] - scan.points[t[(k + 1) % 3]]).norm();
  return scan.triangles.empty() ? 0 : sum / (3.0 * static_cast<double>(scan.triangles.size()));
}

std::vector<Vector3d> node_normals(const NodeGraph& graph, const std::vector<Vector3d>& normals) {
  std::vector<Vector3d> sums(graph.size(), Vector3d::Zero());
  for (std::size_t t = 0; t < graph.node_of.size(); ++t)
    for (int node : graph.node_of[t]) sums[node] += normals[t];
  for (Vector3d& n : sums) n = unit_or(n, Vector3d::UnitZ());
  return sums;
}

std::vector<Vector3d> averaged(const NodeGraph& graph, std::vector<Vector3d> normals, int rounds) {
  for (int round = 0; round < rounds; ++round) {
    std::vector<Vector3d> next(normals.size());
    for (int n = 0; n < graph.size(); ++n) {
      Vector3d sum = normals[n];
      for (int k = graph.first[n]; k < graph.first[n + 1]; ++k) sum += normals[graph.neighbours[k]];
      next[n] = unit_or(sum, normals[n]);
    }
    normals = std::move(next);
  }
  return normals;
}

double estimate_noise(const NodeGraph& graph, const std::vector<Vector3d>& points,
                      const std::vector<Vector3d>& normals) {
  constexpr std::size_t kPoints = 20;
  std::vector<double> variances;
  Neighbourhood neighbourhood(graph.size());
  const int step = std::max(1, graph.size() / 2000);
  for (int n = 0; n < graph.size(); n += step) {
    if (graph.on_border[n]) continue;
    const std::vector<int>& nodes = neighbourhood.rings(graph, n, kPoints);
    if (nodes.size() < kPoints / 2) continue;
    double radius = 0;
    for (int node : nodes) radius = std::max(radius, (points[graph.point_of[node]] - points[graph.point_of[n]]).norm());
    // A radius far beyond the points weighs all of them alike.
    const Fit fit = fit_quadric(graph, points, nodes, normals[n], 10 * radius, 0, false);
    if (fit.degrees_of_freedom >= 4) variances.push_back(fit.residual_variance);
  }
  if (variances.empty()) return 0;
  std::nth_element(variances.begin(), variances.begin() + variances.size() / 2, variances.end());
  // The median of chi-square with 14 degrees of freedom is 0.953 of its mean.
  return std::sqrt(variances[variances.size() / 2] / 0.953);
}

/// Moves every point onto its quadrics: onto the only one, or onto the common point of those around a crease.
std::vector<Vector3d> moved_points(const std::vector<Vector3d>& points, const NodeGraph& graph,
                                   const std::vector<LocalQuadric>& quadrics) {
  std::vector<Eigen::Matrix3d> a(points.size(), Eigen::Matrix3d::Zero());
  std::vector<Vector3d> b(points.size(), Vector3d::Zero());
  for (int n = 0; n < graph.size(); ++n) {
    const LocalQuadric& q = quadrics[n];
    const Vector3d normal = (q.normal - q.c[1] * q.u - q.c[2] * q.v).normalized();
    const double distance = normal.dot(q.normal) * q.c[0];
    a[graph.point_of[n]] += normal * normal.transpose();
    b[graph.point_of[n]] += distance * normal;
  }
  std::vector<Vector3d> moved = points;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (b[i].isZero(0)) continue;
    // The smallest move that meets the tangent planes; directions that nearly no plane fixes stay.
    const Eigen::Matrix3d regular = a[i] + 1e-2 * a[i].trace() * Eigen::Matrix3d::Identity();
    Vector3d move = Vector3d::Zero();
    for (int round = 0; round < 4; ++round) move += regular.ldlt().solve(b[i] - a[i] * move);
    moved[i] += move;
  }
  return moved;
}

}  // namespace

std::pair<Vector3d, Vector3d> LocalQuadric::at(const Vector3d& x) const {
  const Vector3d d = x - origin;
  const double s = d.dot(u), t = d.dot(v);
  const double height = c[0] + s * (c[1] + c[3] * s + c[4] * t) + t * (c[2] + c[5] * t);
  const double slope_s = c[1] + 2 * c[3] * s + c[4] * t;
  const double slope_t = c[2] + 2 * c[5] * t + c[4] * s;
  return {origin + s * u + t * v + height * normal, (normal - slope_s * u - slope_t * v).normalized()};
}

std::pair<Vector3d, Vector3d> FittedSurface::at(int triangle, const Vector3d& barycentric) const {
  Vector3d x = Vector3d::Zero(), point = Vector3d::Zero(), normal = Vector3d::Zero();
  for (int k = 0; k < 3; ++k) x += barycentric[k] * points[triangles[triangle][k]];
  for (int k = 0; k < 3; ++k) {
    if (barycentric[k] == 0) continue;
    const auto [p, n] = quadrics[quadric_of[triangle][k]].at(x);
    point += barycentric[k] * p;
    normal += barycentric[k] * n;
  }
  // Quadrics continued far beyond their points, over large triangles of a hole, may run away.
  double longest = 0;
  for (int k = 0; k < 3; ++k)
    longest = std::max(longest, (points[triangles[triangle][k]] - points[triangles[triangle][(k + 1) % 3]]).norm());
  const double shift = (point - x).norm(), limit = kLargestRise * longest;
  if (shift > limit) point = x + limit / shift * (point - x);
  return {point, normal.normalized()};
}

void find_curves(FittedSurface& surface) {
  surface.creases.clear();
  surface.borders.clear();
  const std::vector<int> opposite = opposite_edges(surface.triangles);
  const auto quadric = [&](int edge) { return surface.quadric_of[edge / 3][edge % 3]; };
  for (int e = 0; e < static_cast<int>(opposite.size()); ++e) {
    const int o = opposite[e];
    const std::array<int, 2> ends{surface.triangles[e / 3][e % 3], surface.triangles[e / 3][next_edge(e) % 3]};
    if (o < 0) {
      surface.borders.push_back(ends);
    } else if (e < o && (quadric(e) != quadric(next_edge(o)) || quadric(next_edge(e)) != quadric(o))) {
      surface.creases.push_back(ends);
    }
  }
}

double estimate_noise(const TriangleMesh& scan) {
  const std::vector<int> opposite = opposite_edges(scan.triangles);
  const NodeGraph graph = make_nodes(scan.triangles, opposite, std::vector<char>(opposite.size(), 0));
  const auto normals = averaged(graph, node_normals(graph, triangle_normals(scan.points, scan.triangles)), 1);
  return estimate_noise(graph, scan.points, normals);
}

FittedSurface flat_surface(const TriangleMesh& mesh) {
  FittedSurface surface;
  surface.points = mesh.points;
  surface.triangles = mesh.triangles;
  surface.mean_edge_mm = mean_edge_length(mesh);
  const std::vector<Vector3d> normals = triangle_normals(mesh.points, mesh.triangles);
  for (std::size_t t = 0; t < normals.size(); ++t) {
    surface.quadrics.push_back(frame_at(mesh.points[mesh.triangles[t][0]], unit_or(normals[t], Vector3d::UnitZ())));
    const int quadric = static_cast<int>(t);
    surface.quadric_of.push_back({quadric, quadric, quadric});
  }
  return surface;
}

FittedSurface fit_surface(const TriangleMesh& scan, const FitParams& params) {
  FittedSurface surface;
  surface.triangles = scan.triangles;
  surface.mean_edge_mm = mean_edge_length(scan);
  const double edge = surface.mean_edge_mm;
  double sigma = params.noise_sigma_mm ? *params.noise_sigma_mm : estimate_noise(scan);
  // Below half a percent of the spacing the residuals are curvature, not noise: the points are taken as exact.
  const bool exact = params.noise_sigma_mm ? sigma == 0 : sigma < 0.005 * edge;
  if (exact) sigma = 0;
  surface.noise_sigma_mm = sigma;

  const std::vector<int> opposite = opposite_edges(scan.triangles);
  const std::vector<char> is_crease = find_creases(scan, opposite, params.feature_angle_deg, sigma, edge);
  const NodeGraph graph = make_nodes(scan.triangles, opposite, is_crease);
  surface.quadric_of = graph.node_of;
  find_curves(surface);

  const std::vector<Vector3d> areas = triangle_normals(scan.points, scan.triangles);
  double area = 0;
  for (const Vector3d& a : areas) area += a.norm();
  const double density = area > 0 ? static_cast<double>(graph.size()) / area : 1;
  const double wanted_tilt = params.normal_error_deg * kDegree;
  const double smallest = 1.8 * edge;
  // 1.3: the weights fall towards the rim and use the points less well.
  const double usual = std::max(smallest, 1.3 * std::sqrt(2 * std::numbers::sqrt2 * sigma /
                                                          (std::sqrt(std::numbers::pi * density) * wanted_tilt)));
  const std::vector<Vector3d> raw_normals = node_normals(graph, areas);
  const std::vector<Vector3d> normals =
      exact ? raw_normals : averaged(graph, raw_normals, std::clamp(static_cast<int>(usual / edge), 1, 5));

  surface.quadrics.resize(graph.size());
  tbb::enumerable_thread_specific<Neighbourhood> neighbourhoods([&] { return Neighbourhood(graph.size()); });
  tbb::parallel_for(tbb::blocked_range<int>(0, graph.size(), 256), [&](const tbb::blocked_range<int>& range) {
    Neighbourhood& neighbourhood = neighbourhoods.local();
    for (int n = range.begin(); n < range.end(); ++n) {
      const auto fit_within = [&](double radius) {
        return fit_quadric(graph, scan.points, neighbourhood.within(graph, scan.points, normals, n, radius), normals[n],
                           radius, sigma, exact);
      };
      if (exact) {
        const std::vector<int>& nodes = neighbourhood.rings(graph, n, 12);
        double radius = 0;
        for (int node : nodes)
          radius = std::max(radius, (scan.points[graph.point_of[node]] - scan.points[graph.point_of[n]]).norm());
        surface.quadrics[n] = fit_quadric(graph, scan.points, nodes, raw_normals[n], 1.2 * radius, 0, true).quadric;
        continue;
      }
      const auto is_good = [&](const Fit& fit) {
        const double slack = 1.3 + 3 * std::sqrt(2.0 / std::max(1, fit.degrees_of_freedom));
        return fit.degrees_of_freedom <= 0 || fit.residual_variance <= slack * sigma * sigma;
      };
      double radius = usual;
      Fit fit = fit_within(radius);
      while (radius > smallest && !is_good(fit)) fit = fit_within(radius = std::max(smallest, radius / 1.4));
      // One-sided neighbourhoods need more of it.
      while (radius >= usual && radius < 1.9 * usual && fit.quadric.tilt_std_rad > 2 * wanted_tilt) {
        const Fit wider = fit_within(radius *= 1.25);
        if (!is_good(wider)) break;
        fit = wider;
      }
      surface.quadrics[n] = fit.quadric;
    }
  });
  surface.points = exact ? scan.points : moved_points(scan.points, graph, surface.quadrics);
  return surface;
}

}  // namespace interglow::mesh
