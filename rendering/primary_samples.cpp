// SPDX-License-Identifier: GPL-3.0-or-later
#include "rendering/primary_samples.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <span>

namespace interglow::rendering {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// A pixel of a smooth surface is divided where the normal at its centre differs by more than this from the mean over
// its corners: a change of the cosine by 1e-3 is seen by nobody, and a linear change needs no division.
constexpr double kNormalBend = 1e-3;
// Flat faces change at their edges and nowhere else: three of them in a pixel may have the middle one's normal on
// average, but not its share of the pixel. Faces nearer to one plane than this are one.
constexpr double kFacetBend = 1e-5;
// The same for depth, in pixel widths at that depth; a jump means a silhouette within one object.
constexpr double kDepthBend = 1.0;
constexpr int kDiskSamples = 4;  // per side, for beams with a source disk

/// Points of a pixel's square for an area average: a rank-1 lattice, shifted and mirrored differently in every pixel.
/// An upright or level edge is met at `count` different distances in all of them. The golden ratio between the two
/// coordinates spreads the points evenly in boxes of any shape, as the corner of a bright surface needs it; the shifts
/// keep the errors of a slanting edge from adding up along it.
class PixelLattice {
 public:
  explicit PixelLattice(std::size_t count)
      : count_(count), generator_(static_cast<std::size_t>(static_cast<double>(count) / std::numbers::phi)) {
    while (std::gcd(generator_, count_) > 1) ++generator_;
  }
  std::size_t size() const { return count_; }

  Vector2d at(std::size_t point, std::size_t pixel) const {
    // Fibonacci hashing (Knuth): neighbouring pixels get shifts far apart.
    const std::uint64_t hash = (static_cast<std::uint64_t>(pixel) + 1) * 0x9E3779B97F4A7C15ULL;
    const std::size_t shift = (hash >> 32) % count_;
    const bool mirrored = (hash >> 31 & 1U) != 0;
    const std::size_t other = (point * generator_ + shift) % count_;
    return {middle(point), middle(mirrored ? count_ - 1 - other : other)};
  }

 private:
  double middle(std::size_t step) const { return (static_cast<double>(step) + 0.5) / static_cast<double>(count_); }

  std::size_t count_, generator_;
};

/// A ray's hit with what is needed to compare it with its neighbours.
struct Probe {
  Sample sample;
  Vector3d normal = Vector3d::Zero();
  double depth = 0.0;  ///< along the camera's forward
};

struct Tracer {
  const scene::Scene& scene;
  const CameraRays& camera;
  const Surface& surface;
  const radiosity::Visibility& visibility;

  std::size_t beams() const { return scene.directional_lights.size(); }

  /// Traces one ray at each place (column, row); `beam` gets places x beams values. Neighbours use different
  /// points of a source disk.
  void trace(std::span<const Vector2d> places, std::span<Probe> probes, std::span<float> beam) const {
    std::vector<Vector3d> directions;
    directions.reserve(places.size());
    for (const Vector2d& place : places) directions.push_back(camera.direction(place.x(), place.y()));
    std::vector<int> face(places.size());
    visibility.first_faces(camera.origin, directions, face);

    std::vector<radiosity::Segment> segments;
    struct Pending {
      std::size_t slot;
      float weight;
    };
    std::vector<Pending> pending;
    std::fill(beam.begin(), beam.end(), 0.0F);
    for (std::size_t p = 0; p < places.size(); ++p) {
      probes[p] = Probe{};
      if (face[p] < 0) continue;
      const bool back = surface.face_normal(face[p]).dot(directions[p]) > 0.0;
      const Vector3d hit = surface.meet(face[p], camera.origin, directions[p]);
      probes[p].sample = {2 * face[p] + (back ? 1 : 0), surface.locate(face[p], hit)};
      const SurfacePoint point = surface.point(face[p], back, probes[p].sample.at);
      probes[p].normal = point.normal;
      probes[p].depth = camera.forward.dot(hit - camera.origin);
      for (std::size_t l = 0; l < beams(); ++l) {
        const scene::DirectionalLight& light = scene.directional_lights[l];
        if (!(light.half_angle_rad > 0.0)) {
          const double cosine = -point.normal.dot(light.direction);
          if (cosine <= 0.0) continue;
          segments.push_back({point.position, -light.direction, point.face, -1, true});
          pending.push_back({p * beams() + l, static_cast<float>(cosine)});
          continue;
        }
        disk_rays(light, point, static_cast<int>(p), [&](const Vector3d& to_light, double weight) {
          segments.push_back({point.position, to_light, point.face, -1, true});
          pending.push_back({p * beams() + l, static_cast<float>(weight)});
        });
      }
    }
    std::vector<char> blocked(segments.size());
    visibility.blocked(segments, blocked);
    for (std::size_t s = 0; s < pending.size(); ++s) {
      if (!blocked[s]) beam[pending[s].slot] += pending[s].weight;
    }
  }

  /// Points of the source disk, uniform in its projection along the beam, shifted differently for each turn.
  template <class Visit>
  static void disk_rays(const scene::DirectionalLight& light, const SurfacePoint& point, int turn, const Visit& visit) {
    const Vector3d axis = -light.direction;
    const Vector3d u = axis.unitOrthogonal();
    const Vector3d v = axis.cross(u);
    const double sine = std::sin(light.half_angle_rad);
    // Additive recurrence of the golden ratio and its plastic cousin: the turns fill the cells evenly.
    const double shift_r = std::fmod(0.5 + 0.7548776662466927 * turn, 1.0);
    const double shift_phi = std::fmod(0.5 + 0.5698402909980532 * turn, 1.0);
    for (int i = 0; i < kDiskSamples; ++i) {
      for (int j = 0; j < kDiskSamples; ++j) {
        const double radius = sine * std::sqrt((i + shift_r) / kDiskSamples);
        const double phi = 2.0 * std::numbers::pi * (j + shift_phi) / kDiskSamples;
        const double height = std::sqrt(1.0 - radius * radius);
        const Vector3d to_light = radius * std::cos(phi) * u + radius * std::sin(phi) * v + height * axis;
        const double cosine = point.normal.dot(to_light);
        if (cosine > 0.0) visit(to_light, cosine / height / (kDiskSamples * kDiskSamples));
      }
    }
  }
};

}  // namespace

PrimarySamples primary_samples(const scene::Scene& scene, const CameraRays& camera, const Surface& surface,
                               const radiosity::Visibility& visibility, int samples_per_side,
                               const Progress& progress) {
  const Tracer tracer{scene, camera, surface, visibility};
  const auto width = static_cast<std::size_t>(camera.width);
  const auto height = static_cast<std::size_t>(camera.height);
  const std::size_t beams = tracer.beams();
  const auto n = static_cast<std::size_t>(samples_per_side);
  const PixelLattice lattice(n * n);

  std::vector<Probe> corner((width + 1) * (height + 1));
  std::vector<float> corner_beam(corner.size() * beams);
  std::vector<std::vector<Sample>> row_samples(height);
  std::vector<std::vector<float>> row_beams(height);
  std::vector<std::size_t> count(width * height);

  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, height + 1, 4),
                    [&](const tbb::blocked_range<std::size_t>& range) {
                      std::vector<Vector2d> places(width + 1);
                      for (std::size_t row = range.begin(); row < range.end(); ++row) {
                        for (std::size_t column = 0; column <= width; ++column)
                          places[column] = {static_cast<double>(column), static_cast<double>(row)};
                        tracer.trace(places, std::span(corner).subspan(row * (width + 1), width + 1),
                                     std::span(corner_beam).subspan(row * (width + 1) * beams, (width + 1) * beams));
                      }
                    });
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, height, 4), [&](const tbb::blocked_range<std::size_t>& range) {
    std::vector<Vector2d> places(width);
    std::vector<Probe> centre(width);
    std::vector<float> centre_beam(width * beams);
    std::vector<Probe> divided(lattice.size());
    std::vector<Vector2d> divided_places(lattice.size());
    std::vector<float> divided_beam(lattice.size() * beams);
    for (std::size_t row = range.begin(); row < range.end(); ++row) {
      for (std::size_t column = 0; column < width; ++column) {
        places[column] = {static_cast<double>(column) + 0.5, static_cast<double>(row) + 0.5};
      }
      tracer.trace(places, centre, centre_beam);
      for (std::size_t column = 0; column < width; ++column) {
        const Probe& middle = centre[column];
        const std::array<std::size_t, 4> around{row * (width + 1) + column, row * (width + 1) + column + 1,
                                                (row + 1) * (width + 1) + column, (row + 1) * (width + 1) + column + 1};
        const int middle_object = middle.sample.side < 0 ? -1 : surface.object(middle.sample.side / 2);
        bool divide = false;
        Vector3d normal = Vector3d::Zero();
        double depth = 0.0;
        bool same_face = true;
        for (const std::size_t c : around) {
          const Probe& probe = corner[c];
          same_face = same_face && probe.sample.side == middle.sample.side;
          const int object = probe.sample.side < 0 ? -1 : surface.object(probe.sample.side / 2);
          divide =
              divide || object != middle_object || (object >= 0 && (probe.sample.side % 2) != (middle.sample.side % 2));
          divide = divide || (object >= 0 && !surface.smooth(probe.sample.side / 2) &&
                              (probe.normal - middle.normal).norm() > kFacetBend);
          normal += 0.25 * probe.normal;
          depth += 0.25 * probe.depth;
          for (std::size_t b = 0; b < beams; ++b) {
            divide = divide || (corner_beam[c * beams + b] > 0.0F) != (centre_beam[column * beams + b] > 0.0F);
          }
        }
        if (middle_object >= 0 && !same_face) {
          divide = divide || (normal - middle.normal).norm() > kNormalBend ||
                   std::abs(depth - middle.depth) > kDepthBend * camera.pixel_side() * middle.depth;
        }
        for (std::size_t b = 0; b < beams && middle_object >= 0; ++b) {
          // Half-shadow of a source disk.
          const scene::DirectionalLight& light = scene.directional_lights[b];
          const double open = -middle.normal.dot(light.direction);
          divide = divide || (light.half_angle_rad > 0.0 && std::abs(centre_beam[column * beams + b] - open) > 1e-3);
        }
        std::vector<Sample>& samples = row_samples[row];
        std::vector<float>& sample_beams = row_beams[row];
        if (!divide || n == 1) {
          count[row * width + column] = 1;
          samples.push_back(middle.sample);
          sample_beams.insert(sample_beams.end(), centre_beam.begin() + static_cast<std::ptrdiff_t>(column * beams),
                              centre_beam.begin() + static_cast<std::ptrdiff_t>((column + 1) * beams));
          continue;
        }
        count[row * width + column] = lattice.size();
        for (std::size_t s = 0; s < lattice.size(); ++s) {
          divided_places[s] =
              Vector2d(static_cast<double>(column), static_cast<double>(row)) + lattice.at(s, row * width + column);
        }
        tracer.trace(divided_places, divided, divided_beam);
        for (const Probe& probe : divided) samples.push_back(probe.sample);
        sample_beams.insert(sample_beams.end(), divided_beam.begin(), divided_beam.end());
      }
      if (progress.report || progress.cancelled)
        progress.update("camera rays", static_cast<double>(row) / static_cast<double>(height));
    }
  });

  PrimarySamples result;
  result.first.reserve(width * height + 1);
  result.first.push_back(0);
  for (const std::size_t c : count) {
    result.first.push_back(result.first.back() + c);
    result.divided_pixels += c > 1 ? 1 : 0;
  }
  result.sample.reserve(result.first.back());
  result.beam.reserve(result.first.back() * beams);
  for (std::size_t row = 0; row < height; ++row) {
    result.sample.insert(result.sample.end(), row_samples[row].begin(), row_samples[row].end());
    result.beam.insert(result.beam.end(), row_beams[row].begin(), row_beams[row].end());
    row_samples[row] = {};
    row_beams[row] = {};
  }
  result.rays = static_cast<std::int64_t>(corner.size() + width * height) +
                result.divided_pixels * static_cast<std::int64_t>(lattice.size());
  return result;
}

void divide_pixels(PrimarySamples& samples, const std::vector<char>& pixels, const scene::Scene& scene,
                   const CameraRays& camera, const Surface& surface, const radiosity::Visibility& visibility,
                   int samples_per_side) {
  const auto n = static_cast<std::size_t>(samples_per_side);
  if (n == 1) return;
  const Tracer tracer{scene, camera, surface, visibility};
  const PixelLattice lattice(n * n);
  const std::size_t beams = tracer.beams();
  const auto width = static_cast<std::size_t>(camera.width);
  const PrimarySamples before = std::move(samples);
  samples = {};
  samples.rays = before.rays;
  samples.divided_pixels = before.divided_pixels;
  samples.first.push_back(0);
  const auto wanted = [&](std::size_t pixel) {
    return pixels[pixel] != 0 && before.first[pixel + 1] - before.first[pixel] == 1;
  };
  for (std::size_t pixel = 0; pixel < pixels.size(); ++pixel) {
    const std::size_t count = wanted(pixel) ? lattice.size() : before.first[pixel + 1] - before.first[pixel];
    samples.first.push_back(samples.first.back() + count);
    if (!wanted(pixel)) continue;
    ++samples.divided_pixels;
    samples.rays += static_cast<std::int64_t>(lattice.size());
  }
  samples.sample.resize(samples.first.back());
  samples.beam.resize(samples.first.back() * beams);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, pixels.size(), 64),
                    [&](const tbb::blocked_range<std::size_t>& range) {
                      std::vector<Vector2d> places(lattice.size());
                      std::vector<Probe> probes(lattice.size());
                      for (std::size_t pixel = range.begin(); pixel < range.end(); ++pixel) {
                        const std::size_t first = samples.first[pixel];
                        const std::size_t count = samples.first[pixel + 1] - first;
                        if (!wanted(pixel)) {
                          std::copy_n(before.sample.data() + before.first[pixel], count, samples.sample.data() + first);
                          std::copy_n(before.beam.data() + before.first[pixel] * beams, count * beams,
                                      samples.beam.data() + first * beams);
                          continue;
                        }
                        const Vector2d corner(static_cast<double>(pixel % width), static_cast<double>(pixel / width));
                        for (std::size_t s = 0; s < count; ++s) places[s] = corner + lattice.at(s, pixel);
                        tracer.trace(places, probes, std::span(samples.beam).subspan(first * beams, count * beams));
                        for (std::size_t s = 0; s < count; ++s) samples.sample[first + s] = probes[s].sample;
                      }
                    });
}

}  // namespace interglow::rendering
