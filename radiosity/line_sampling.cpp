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

/// Points of a patch by two numbers in [0, 1), with the Jacobian over the area.
class Points {
 public:
  Points(const Polygon& polygon, double area)
      : triangle_(polygon.corners == 3),
        origin_(polygon.corner[0]),
        u_(polygon.corner[1] - polygon.corner[0]),
        v_((triangle_ ? polygon.corner[2] : polygon.corner[3]) - polygon.corner[0]),
        area_(area) {
    if (!triangle_) uv_ = polygon.corner[0] - polygon.corner[1] + polygon.corner[2] - polygon.corner[3];
    parallelogram_ = triangle_ || uv_.squaredNorm() <= 1e-24 * (u_.squaredNorm() + v_.squaredNorm());
  }

  Vector3d at(double u, double v, double& density) const {
    if (parallelogram_) {
      density = 1.0;
      return triangle_ && u + v > 1.0 ? Vector3d(origin_ + (1.0 - u) * u_ + (1.0 - v) * v_)
                                      : Vector3d(origin_ + u * u_ + v * v_);
    }
    density = (u_ + v * uv_).cross(v_ + u * uv_).norm() / area_;
    return origin_ + u * u_ + v * v_ + u * v * uv_;
  }

 private:
  bool triangle_;
  bool parallelogram_ = true;
  Vector3d origin_, u_, v_, uv_ = Vector3d::Zero();
  double area_;
};

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
  const Points from(tree_.polygon(i), elements_.area_mm2[i]);
  const Points to(tree_.polygon(j), elements_.area_mm2[j]);
  const Vector3d normal_i = elements_.normal.row(i).transpose();
  const Vector3d normal_j = elements_.normal.row(j).transpose();
  const int face_i = elements_.face[static_cast<std::size_t>(i)];
  const int face_j = elements_.face[static_cast<std::size_t>(j)];
  int found = 0;
  // How often is tried depends on the shapes alone, not on what is seen.
  for (int tries = 2 * count + 8; found < count && tries > 0; --tries) {
    double density_i = 0.0;
    double density_j = 0.0;
    const Vector3d p = from.at(x[0], x[1], density_i);
    const Vector3d q = to.at(x[2], x[3], density_j);
    for (std::size_t k = 0; k < 4; ++k) {
      x[k] += kStep[k];
      if (x[k] >= 1.0) x[k] -= 1.0;
    }
    const Vector3d line = q - p;
    const double out = normal_i.dot(line);
    const double in = -normal_j.dot(line);
    if (!(out > 0.0 && in > 0.0)) continue;
    const double squared = line.squaredNorm();
    weights_.push_back(density_i * density_j * out * in / (squared * squared));
    segments_.push_back({p, q, face_i, face_j});
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
