// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/slippage.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <map>
#include <utility>

#include "mesh/patch_mesh.h"

namespace interglow::fitting {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// Root mean square normal velocity, per unit of turn × size or shift, of a motion that counts as slipping.
constexpr double kSlips = 0.02;
/// Borders that turn by less from edge to edge are rounds; cosine.
constexpr double kRoundBorder = 0.86;

/// Normals of the smooth surface at the corners of every face.
std::vector<std::array<Vector3d, 4>> smooth_normals(const mesh::PatchMesh& mesh) {
  if (!mesh.corner_normals.empty()) return mesh.corner_normals;
  std::vector<Vector3d> at_point(mesh.points.size(), Vector3d::Zero());
  for (const mesh::Face& face : mesh.faces) {
    for (std::size_t k = 0; k < static_cast<std::size_t>(mesh::corner_count(face)); ++k)
      at_point[static_cast<std::size_t>(face[k])] += mesh::vector_area(mesh, face);
  }
  std::vector<std::array<Vector3d, 4>> result(mesh.faces.size());
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    for (std::size_t k = 0; k < static_cast<std::size_t>(mesh::corner_count(mesh.faces[f])); ++k)
      result[f][k] = at_point[static_cast<std::size_t>(mesh.faces[f][k])].normalized();
  }
  return result;
}

struct Sum {
  Vector3d pivot;
  double size;
  Matrix6d matrix = Matrix6d::Zero();
  double weight = 0.0;

  void add(const Vector3d& point, const Vector3d& normal, double with) {
    Vector6d row;
    row << ((point - pivot) / size).cross(normal), normal;
    matrix += with * row * row.transpose();
    weight += with;
  }
};

void add_borders(const mesh::PatchMesh& mesh, Sum& sum) {
  std::map<std::pair<int, int>, std::pair<int, std::size_t>> edges;  // uses, face
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const auto corners = static_cast<std::size_t>(mesh::corner_count(mesh.faces[f]));
    for (std::size_t k = 0; k < corners; ++k) {
      const auto edge = std::minmax(mesh.faces[f][k], mesh.faces[f][(k + 1) % corners]);
      auto& [uses, face] = edges[{edge.first, edge.second}];
      ++uses;
      face = f;
    }
  }
  // Outward normals of the border at its points.
  std::map<int, std::vector<Vector3d>> at_point;
  for (const auto& [edge, use] : edges) {
    if (use.first != 1) continue;
    const Vector3d along =
        mesh.points[static_cast<std::size_t>(edge.second)] - mesh.points[static_cast<std::size_t>(edge.first)];
    const mesh::Face& face = mesh.faces[use.second];
    Vector3d normal = along.cross(mesh::vector_area(mesh, face)).normalized() * along.norm();
    Vector3d middle = Vector3d::Zero();
    for (int k = 0; k < mesh::corner_count(face); ++k)
      middle += mesh.points[static_cast<std::size_t>(face[static_cast<std::size_t>(k)])] / mesh::corner_count(face);
    if (normal.dot(mesh.points[static_cast<std::size_t>(edge.first)] - middle) < 0.0) normal = -normal;
    at_point[edge.first].push_back(normal);
    at_point[edge.second].push_back(normal);
  }
  for (const auto& [point, normals] : at_point) {
    const Vector3d& place = mesh.points[static_cast<std::size_t>(point)];
    const double with = 0.5 * sum.size;
    const bool round = normals.size() == 2 && normals[0].normalized().dot(normals[1].normalized()) > kRoundBorder;
    if (round) {
      const Vector3d mean = normals[0] + normals[1];
      sum.add(place, mean.normalized(), with * mean.norm());
    } else {
      for (const Vector3d& normal : normals) sum.add(place, normal.normalized(), with * normal.norm());
    }
  }
}

/// Without the sign of a zero.
double tidy(double value, double unit) { return std::round(value / unit) * unit + 0.0; }

std::string body_of(const std::vector<Slip>& slips, const Vector3d& pivot) {
  // Where three turns leave a point in place, it is the centre: turn × (c - pivot) + shift = 0.
  Eigen::MatrixXd system(3 * slips.size(), 3);
  Eigen::VectorXd right(3 * slips.size());
  bool turns = true;
  for (std::size_t k = 0; k < slips.size(); ++k) {
    Matrix3d cross;
    cross << 0, -slips[k].turn.z(), slips[k].turn.y(), slips[k].turn.z(), 0, -slips[k].turn.x(), -slips[k].turn.y(),
        slips[k].turn.x(), 0;
    system.middleRows<3>(static_cast<Eigen::Index>(3 * k)) = cross;
    right.segment<3>(static_cast<Eigen::Index>(3 * k)) = -slips[k].shift;
    turns = turns && slips[k].turn.norm() > 0.0;
  }
  if (slips.size() == 3 && turns) {
    const Vector3d centre = pivot + system.fullPivLu().solve(right).eval();
    return fmt::format("a sphere about ({:.1f}, {:.1f}, {:.1f}) mm", tidy(centre.x(), 0.1), tidy(centre.y(), 0.1),
                       tidy(centre.z(), 0.1));
  }
  if (slips.size() == 1 && slips[0].turn.norm() > 0.0) {
    Vector3d axis = slips[0].turn.normalized();
    Eigen::Index longest = 0;
    axis.cwiseAbs().maxCoeff(&longest);
    if (axis[longest] < 0.0) axis = -axis;
    return fmt::format("a body of revolution about the axis ({:.2f}, {:.2f}, {:.2f})", tidy(axis.x(), 0.01),
                       tidy(axis.y(), 0.01), tidy(axis.z(), 0.01));
  }
  return "surfaces that slide along themselves";
}

}  // namespace

Slippage slippage(const scene::Scene& scene, const Vector3d& pivot) {
  double square = 0.0;
  std::size_t points = 0;
  for (const scene::Object& object : scene.objects) {
    for (const Vector3d& point : object.patches.points) square += (point - pivot).squaredNorm();
    points += object.patches.points.size();
  }
  Sum sum{pivot, std::sqrt(square / static_cast<double>(points))};
  for (const scene::Object& object : scene.objects) {
    const mesh::PatchMesh& mesh = object.patches;
    const auto normals = smooth_normals(mesh);
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
      const auto corners = static_cast<std::size_t>(mesh::corner_count(mesh.faces[f]));
      const double area = mesh::vector_area(mesh, mesh.faces[f]).norm();
      for (std::size_t k = 0; k < corners; ++k)
        sum.add(mesh.points[static_cast<std::size_t>(mesh.faces[f][k])], normals[f][k],
                area / static_cast<double>(corners));
    }
    add_borders(mesh, sum);
  }
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(sum.matrix / sum.weight);
  Slippage result;
  for (int k = 0; k < 6 && eigen.eigenvalues()[k] < kSlips * kSlips; ++k) {
    const Vector6d motion = eigen.eigenvectors().col(k);
    result.slips.push_back({motion.head<3>() / sum.size, motion.tail<3>()});
  }
  if (!result.slips.empty()) result.body = body_of(result.slips, pivot);
  return result;
}

}  // namespace interglow::fitting
