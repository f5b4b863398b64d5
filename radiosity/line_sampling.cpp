// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/line_sampling.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

namespace interglow::radiosity {
namespace {

using Eigen::Vector3d;

/// Steele, Lea and Flood (2014): splitmix64.
std::uint64_t mixed(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

/// Patches whose centres are nearer than so many times the sum of their radii are seen under angles.
constexpr double kNear = 1.0;

/// What of a patch lies in front of a plane.
struct Part {
  std::array<Vector3d, 5> corner;
  int corners = 0;

  void add(const Vector3d& p) { corner[static_cast<std::size_t>(corners++)] = p; }
  const Vector3d& at(int k) const { return corner[static_cast<std::size_t>(k < corners ? k : 0)]; }
  double area() const {
    Vector3d sum = Vector3d::Zero();
    for (int k = 2; k < corners; ++k) sum += (at(k - 1) - at(0)).cross(at(k) - at(0));
    return 0.5 * sum.norm();
  }
};

Part in_front(const Polygon& polygon, const Vector3d& normal, const Vector3d& anchor) {
  Part part;
  const auto n = static_cast<std::size_t>(polygon.corners);
  for (std::size_t k = 0; k < n; ++k) {
    const Vector3d& p = polygon.corner[k];
    const Vector3d& q = polygon.corner[k + 1 < n ? k + 1 : 0];
    const double height = normal.dot(p - anchor);
    const double next = normal.dot(q - anchor);
    if (height >= 0.0) part.add(p);
    if ((height > 0.0 && next < 0.0) || (height < 0.0 && next > 0.0))
      part.add((p * next - q * height) / (next - height));
  }
  return part;
}

/// Points of a convex polygon by two numbers in [0, 1), with the Jacobian over the area. Five corners are a triangle
/// and a quad.
class Points {
 public:
  explicit Points(const Part& part) {
    const bool five = part.corners == 5;
    if (five) {
      of_triangle_ = Vector3d((part.at(1) - part.at(0)).cross(part.at(2) - part.at(0))).norm() / (2.0 * part.area());
      u_first_ = part.at(1) - part.at(0);
      v_first_ = part.at(2) - part.at(0);
    }
    const int second = five ? 2 : 1;
    triangle_ = part.corners == 3;
    origin_ = part.at(0);
    u_ = part.at(second) - origin_;
    v_ = part.at(triangle_ ? 2 : part.corners - 1) - origin_;
    if (!triangle_) uv_ = part.at(second + 1) - part.at(second) - v_;
    parallelogram_ = triangle_ || uv_.squaredNorm() <= 1e-24 * (u_.squaredNorm() + v_.squaredNorm());
    area_ = part.area() * (1.0 - of_triangle_);
  }

  Vector3d at(double u, double v, double& density) const {
    density = 1.0;
    if (u < of_triangle_) {
      u /= of_triangle_;
      return origin_ + (u + v > 1.0 ? Vector3d((1.0 - u) * u_first_ + (1.0 - v) * v_first_)
                                    : Vector3d(u * u_first_ + v * v_first_));
    }
    u = (u - of_triangle_) / (1.0 - of_triangle_);
    if (triangle_ && u + v > 1.0) return origin_ + (1.0 - u) * u_ + (1.0 - v) * v_;
    if (parallelogram_) return origin_ + u * u_ + v * v_;
    density = (u_ + v * uv_).cross(v_ + u * uv_).norm() / area_;
    return origin_ + u * u_ + v * v_ + u * v * uv_;
  }

 private:
  bool triangle_ = true;
  bool parallelogram_ = true;
  double of_triangle_ = 0.0;  ///< share of the first triangle of five corners
  Vector3d u_first_ = Vector3d::Zero(), v_first_ = Vector3d::Zero();
  Vector3d origin_, u_, v_, uv_ = Vector3d::Zero();
  double area_;
};

/// Directions from a point to a triangle, uniform in solid angle (Arvo 1995).
class Directions {
 public:
  Directions() = default;
  Directions(const Vector3d& point, const Vector3d& a, const Vector3d& b, const Vector3d& c)
      : a_((a - point).stableNormalized()), b_((b - point).stableNormalized()), c_((c - point).stableNormalized()) {
    const Vector3d ab = a_.cross(b_);
    const double volume = std::abs(ab.dot(c_));
    solid_angle_ = 2.0 * std::atan2(volume, 1.0 + a_.dot(b_) + b_.dot(c_) + c_.dot(a_));
    const Vector3d ac = a_.cross(c_);
    const double sine = ab.cross(ac).norm();
    const double cosine = ab.dot(ac);
    const double length = std::hypot(sine, cosine);
    if (!(length > 0.0 && volume > 0.0)) solid_angle_ = 0.0;
    sine_ = sine / length;
    cosine_ = cosine / length;
  }

  double solid_angle() const { return solid_angle_; }

  /// @param area, height  in [0, 1)
  Vector3d at(double area, double height) const {
    // cos and sin of the partial triangle's area less the angle at a.
    const double part = area * solid_angle_;
    const double s = std::sin(part) * cosine_ - std::cos(part) * sine_;
    const double t = std::cos(part) * cosine_ + std::sin(part) * sine_;
    const double u = t - cosine_;
    const double v = s + sine_ * a_.dot(b_);
    const double below = (v * s + u * t) * sine_;
    const double q = below != 0.0 ? std::clamp(((v * t - u * s) * cosine_ - v) / below, -1.0, 1.0) : 1.0;
    const Vector3d corner = q * a_ + std::sqrt(1.0 - q * q) * (c_ - c_.dot(a_) * a_).stableNormalized();
    const double z = 1.0 - height * (1.0 - corner.dot(b_));
    return z * b_ + std::sqrt(std::max(0.0, 1.0 - z * z)) * (corner - corner.dot(b_) * b_).stableNormalized();
  }

 private:
  Vector3d a_, b_, c_;
  double solid_angle_ = 0.0;
  double sine_ = 0.0;  ///< of the angle at a
  double cosine_ = 1.0;
};

/// Directions to the triangles of a convex polygon.
class Cone {
 public:
  Cone(const Vector3d& point, const Part& part) {
    for (int k = 2; k < part.corners; ++k) {
      fan_[static_cast<std::size_t>(k - 2)] = Directions(point, part.at(0), part.at(k - 1), part.at(k));
      solid_angle_ += fan_[static_cast<std::size_t>(k - 2)].solid_angle();
    }
    triangles_ = static_cast<std::size_t>(part.corners - 2);
  }
  double solid_angle() const { return solid_angle_; }
  Vector3d at(double area, double height) const {
    double left = area * solid_angle_;
    std::size_t k = 0;
    while (k + 1 < triangles_ && left >= fan_[k].solid_angle()) left -= fan_[k++].solid_angle();
    const double whole = fan_[k].solid_angle();
    return fan_[k].at(whole > 0.0 ? std::min(1.0, left / whole) : 0.0, height);
  }

 private:
  std::array<Directions, 3> fan_;
  std::size_t triangles_ = 0;
  double solid_angle_ = 0.0;
};

double radius(const Polygon& polygon, const Vector3d& centre) {
  double squared = 0.0;
  for (std::size_t k = 0; k < static_cast<std::size_t>(polygon.corners); ++k)
    squared = std::max(squared, (polygon.corner[k] - centre).squaredNorm());
  return std::sqrt(squared);
}

}  // namespace

double LineSums::share() const {
  if (!(whole > 0.0)) return 0.5;
  const double ratio = seen / whole;
  return std::clamp(ratio - (ratio * whole_squares - seen_squares) / (whole * whole), 0.0, 1.0);
}

double LineSums::variance() const {
  if (!(whole > 0.0)) return 0.25;
  const double ratio = seen / whole;
  return ratio * (1.0 - ratio) / std::max(1.0, worth() - 1.0);
}

void LineSampler::clear() {
  segments_.clear();
  weights_.clear();
}

void LineSampler::trace() {
  blocked_.resize(segments_.size());
  visibility_.blocked(segments_, blocked_);
}

/// Points of a rank-1 lattice in four dimensions: powers of the root of x^5 = x + 1.
int LineSampler::add(int i, int j, std::uint64_t draw, int count) {
  constexpr std::array<double, 4> kStep = {0.8566748838545029, 0.733891856627126, 0.6287067210378087,
                                           0.5385972572236101};
  const auto pair = (static_cast<std::uint64_t>(i) << 32) | static_cast<std::uint64_t>(j);
  std::uint64_t seed = mixed(pair ^ mixed(draw));
  std::array<double, 4> x;
  for (double& each : x) {
    seed = mixed(seed);
    each = static_cast<double>(seed >> 11) * 0x1p-53;
  }
  const Vector3d centre_i = elements_.centroid.row(i).transpose();
  const Vector3d centre_j = elements_.centroid.row(j).transpose();
  const bool near =
      (centre_j - centre_i).norm() < kNear * (radius(tree_.polygon(i), centre_i) + radius(tree_.polygon(j), centre_j));
  // Near by, the larger patch is seen from the smaller one under an angle that varies less than the squared distance.
  if (near && elements_.area_mm2[j] < elements_.area_mm2[i]) std::swap(i, j);
  const Vector3d normal_i = elements_.normal.row(i).transpose();
  const Vector3d normal_j = elements_.normal.row(j).transpose();
  const Part part_i = in_front(tree_.polygon(i), normal_j, tree_.polygon(j).corner[0]);
  const Part part_j = in_front(tree_.polygon(j), normal_i, tree_.polygon(i).corner[0]);
  if (part_i.corners < 3 || part_j.corners < 3) return 0;
  const Points from(part_i);
  const Points to(part_j);
  const double of_parts = part_i.area() / elements_.area_mm2[i] * (near ? 1.0 : part_j.area()) / elements_.area_mm2[j];
  const int face_i = elements_.face[static_cast<std::size_t>(i)];
  const int face_j = elements_.face[static_cast<std::size_t>(j)];
  int found = 0;
  // How often is tried depends on the shapes alone, not on what is seen.
  for (int tries = 2 * count + 8; found < count && tries > 0; --tries) {
    const std::array<double, 4> u = x;
    for (std::size_t k = 0; k < 4; ++k) {
      x[k] += kStep[k];
      if (x[k] >= 1.0) x[k] -= 1.0;
    }
    double density_i = 0.0;
    double density_j = 0.0;
    const Vector3d p = from.at(u[0], u[1], density_i);
    Vector3d line;
    double weight = 0.0;
    if (near) {
      const double height = normal_j.dot(p - part_j.corner[0]);
      if (!(height > 0.0)) continue;
      const Cone cone(p, part_j);
      const Vector3d direction = cone.at(u[2], u[3]);
      const double in = -normal_j.dot(direction);
      weight = of_parts * density_i * cone.solid_angle() * normal_i.dot(direction);
      if (!(weight > 0.0 && in > 0.0)) continue;
      line = height / in * direction;
    } else {
      line = to.at(u[2], u[3], density_j) - p;
      const double out = normal_i.dot(line);
      const double in = -normal_j.dot(line);
      if (!(out > 0.0 && in > 0.0)) continue;
      const double squared = line.squaredNorm();
      weight = of_parts * density_i * density_j * out * in / (squared * squared);
    }
    weights_.push_back(weight);
    segments_.push_back({p, p + line, face_i, face_j});
    ++found;
  }
  return found;
}

LineSums LineSampler::sums(std::size_t first, std::size_t end) const {
  LineSums sums;
  for (std::size_t line = first; line < end; ++line) {
    const double w = weights_[line];
    sums.whole += w;
    sums.whole_squares += w * w;
    if (blocked_[line] != 0) continue;
    sums.seen += w;
    sums.seen_squares += w * w;
  }
  return sums;
}

}  // namespace interglow::radiosity
