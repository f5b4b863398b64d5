// SPDX-License-Identifier: GPL-3.0-or-later
#include "cross_check/path_tracer.h"

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <numbers>

#include "cross_check/random.h"
#include "cross_check/ray_scene.h"
#include "diagnostics/error.h"

namespace interglow::cross_check {
namespace {

using std::numbers::pi;

/// Paths end at this length at the latest; only a scene that absorbs nothing gets there.
constexpr int kLongestPath = 4096;
/// Vertices before Russian roulette begins: the first bounces carry most of the light.
constexpr int kRouletteFreeVertices = 2;
/// A path continues with at most this probability once roulette began, so that it ends.
constexpr double kMaxContinuation = 0.98;
constexpr double kMinContinuation = 0.05;

/// A unit vector in the plane across `normal` and its partner (Duff et al. 2017, Building an orthonormal basis,
/// revisited).
struct Frame {
  Eigen::Vector3d tangent, bitangent, normal;
  explicit Frame(const Eigen::Vector3d& n) : normal(n) {
    const double sign = std::copysign(1.0, n.z());
    const double a = -1.0 / (sign + n.z());
    const double b = n.x() * n.y() * a;
    tangent = {1.0 + sign * n.x() * n.x() * a, sign * b, -sign * n.x()};
    bitangent = {b, sign + n.y() * n.y() * a, -n.y()};
  }
  Eigen::Vector3d world(double x, double y, double z) const { return x * tangent + y * bitangent + z * normal; }
};

/// Direction with density cosθ / π.
Eigen::Vector3d cosine_direction(const Eigen::Vector3d& normal, double u, double v) {
  const double radius = std::sqrt(u);
  const double angle = 2.0 * pi * v;
  return Frame(normal)
      .world(radius * std::cos(angle), radius * std::sin(angle), std::sqrt(std::max(0.0, 1.0 - u)))
      .normalized();
}

/// The first numbers of a path, spread evenly over the paths of one batch: the additive recurrence of Roberts (2018)
/// with a random shift per pixel and batch; each number alone is uniform, so that every batch is unbiased.
class StratifiedNumbers {
 public:
  static constexpr int kDimensions = 6;
  StratifiedNumbers(std::uint64_t seed, std::uint64_t pixel, std::uint64_t batch) {
    Random random(~seed, pixel, batch);
    for (double& shift : shift_) shift = random.uniform();
  }
  double operator()(int dimension, int sample) const {
    // Powers of the positive root of x^7 = x + 1.
    static constexpr std::array<double, kDimensions> kStep = {0.8986537126286993, 0.8075784952213448,
                                                              0.7257334129697598, 0.6521830259439716,
                                                              0.5860866975779311, 0.5266889867007160};
    const double x = shift_[static_cast<std::size_t>(dimension)] + sample * kStep[static_cast<std::size_t>(dimension)];
    return x - std::floor(x);
  }

 private:
  std::array<double, kDimensions> shift_{};
};

/// D_L as columns with the rows that are not zero.
class Luminescence {
 public:
  explicit Luminescence(const Eigen::MatrixXd& matrix) : matrix_(matrix) {
    for (Eigen::Index column = 0; column < matrix.cols(); ++column) {
      Eigen::Index first = 0;
      Eigen::Index last = matrix.rows();
      while (first < last && matrix(first, column) == 0.0) ++first;
      while (last > first && matrix(last - 1, column) == 0.0) --last;
      first_.push_back(first);
      count_.push_back(last - first);
    }
  }
  bool present() const { return matrix_.size() > 0; }
  /// out += D_L in
  __attribute__((target_clones("avx512f", "avx2", "default"))) void add(const double* in, double* out) const {
    for (Eigen::Index column = 0; column < matrix_.cols(); ++column) {
      const auto c = static_cast<std::size_t>(column);
      const double factor = in[column];
      if (factor == 0.0) continue;
      const double* entry = matrix_.data() + column * matrix_.rows() + first_[c];
      double* target = out + first_[c];
      for (Eigen::Index row = 0; row < count_[c]; ++row) target[row] += factor * entry[row];
    }
  }

 private:
  Eigen::MatrixXd matrix_;
  std::vector<Eigen::Index> first_, count_;
};

struct Surface {
  Eigen::ArrayXd reflectance;
  Luminescence luminescence;
  double continuation;
};

/// An emitting object: its front faces, to be sampled by area.
struct Emitter {
  int object = -1;
  std::vector<double> cumulative_area;
  double area = 0.0;
};

/// One point of a path.
struct Vertex {
  int material = -1;         ///< -1: black
  double next_weight = 0.0;  ///< 1 / probability of having continued; 0 where the path ends
};

/// Everything one thread needs to follow a path.
struct Workspace {
  Workspace(Eigen::Index bands, Eigen::Index lights)
      : direct(bands),
        reflected(bands),
        luminescent(bands),
        received(bands),
        out_reflected(bands),
        out_luminescent(bands),
        value(Eigen::ArrayXXd::Zero(bands, kChannels)),
        lights_(static_cast<std::size_t>(lights)) {}

  void clear_path() {
    vertices.clear();
    share_.clear();
  }
  /// Starts a vertex and returns the shares of the lights that arrive there directly, all 0.
  double* add_vertex(int material) {
    vertices.push_back({material, 0.0});
    share_.resize(vertices.size() * lights_, 0.0);
    return share(vertices.size() - 1);
  }
  double* share(std::size_t vertex) { return share_.data() + vertex * lights_; }

  std::vector<Vertex> vertices;
  Eigen::ArrayXd direct, reflected, luminescent, received, out_reflected, out_luminescent;
  Eigen::ArrayXXd value;  ///< bands × channels: radiance × π of the paths of a batch, summed

 private:
  std::size_t lights_;
  std::vector<double> share_;
};

}  // namespace

const char* name(Channel channel) {
  static constexpr std::array<const char*, kChannels> kNames = {"total", "re", "rr", "le",
                                                                "lr",    "ll", "rl", "emission"};
  return kNames[static_cast<std::size_t>(channel)];
}

void validate(const TraceParams& params) {
  if (params.bounces && *params.bounces < 0) {
    throw InvalidParams(
        fmt::format("path tracer: bounces {}, expected 0 or more (or none for all of them).", *params.bounces));
  }
  if (params.samples_per_batch < 1) {
    throw InvalidParams(
        fmt::format("path tracer: samples_per_batch {}, expected at least 1.", params.samples_per_batch));
  }
}

struct PathTracer::Impl {
  const scene::Scene& scene;
  const TraceParams params;
  RayScene rays;
  Eigen::Index bands;
  std::vector<Surface> surfaces;
  std::vector<Emitter> emitters;
  std::vector<int> emitter_of_object;
  /// Spectra of the lights in the order: beams, sky, emitters; E⁰ = Σ share × spectrum.
  Eigen::ArrayXXd light_spectrum;  // bands × lights
  int sky_light = -1;
  int first_emitter_light = 0;
  Eigen::Vector3d camera_right, camera_up, camera_forward;
  double half_width = 0.0, half_height = 0.0;
  int first_band = 0, image_bands = 0;
  int kept_channels;
  int batches = 0;
  /// Welford's mean and sum of squared deviations over batches: pixel × channel × (image bands + 1); the last is the
  /// band integral.
  std::vector<float> mean, squares;
  std::atomic<double> largest{0.0};

  Impl(const scene::Scene& s, const TraceParams& p)
      : scene(s), params(p), rays(s), bands(s.grid.size()), kept_channels(p.components ? kChannels : 1) {
    for (const spectral::Material& material : scene.materials) {
      const auto& donaldson = material.donaldson;
      Eigen::VectorXd gain = donaldson.reflectance;
      if (donaldson.luminesces()) {
        gain += (scene.grid.widths_nm().transpose() * donaldson.luminescence.cwiseAbs())
                    .transpose()
                    .cwiseQuotient(scene.grid.widths_nm());
      }
      surfaces.push_back({donaldson.reflectance.array(), Luminescence(donaldson.luminescence),
                          std::clamp(gain.maxCoeff(), kMinContinuation, kMaxContinuation)});
    }
    prepare_lights();
    prepare_camera();
    const std::size_t values = static_cast<std::size_t>(scene.camera.width) *
                               static_cast<std::size_t>(scene.camera.height) * static_cast<std::size_t>(kept_channels) *
                               static_cast<std::size_t>(image_bands + 1);
    mean.assign(values, 0.0F);
    squares.assign(values, 0.0F);
  }

  void prepare_lights() {
    emitter_of_object.assign(scene.objects.size(), -1);
    for (std::size_t o = 0; o < scene.objects.size(); ++o) {
      const scene::Object& object = scene.objects[o];
      if (!object.emits()) continue;
      Emitter emitter;
      emitter.object = static_cast<int>(o);
      for (const mesh::Face& face : object.patches.faces) {
        emitter.area += mesh::vector_area(object.patches, face).norm();
        emitter.cumulative_area.push_back(emitter.area);
      }
      emitter_of_object[o] = static_cast<int>(emitters.size());
      emitters.push_back(std::move(emitter));
    }
    const auto beams = static_cast<Eigen::Index>(scene.directional_lights.size());
    const Eigen::Index sky = scene.sky ? 1 : 0;
    light_spectrum.resize(bands, beams + sky + static_cast<Eigen::Index>(emitters.size()));
    for (Eigen::Index k = 0; k < beams; ++k) {
      light_spectrum.col(k) = scene.directional_lights[static_cast<std::size_t>(k)].normal_irradiance.array();
    }
    if (scene.sky) {
      sky_light = static_cast<int>(beams);
      light_spectrum.col(beams) = pi * scene.sky->radiance.array();
    }
    first_emitter_light = static_cast<int>(beams + sky);
    for (std::size_t e = 0; e < emitters.size(); ++e) {
      light_spectrum.col(first_emitter_light + static_cast<Eigen::Index>(e)) =
          scene.objects[static_cast<std::size_t>(emitters[e].object)].exitance.array();
    }
  }

  void prepare_camera() {
    const scene::Camera& camera = scene.camera;
    camera_forward = (camera.target - camera.position).normalized();
    camera_right = camera_forward.cross(camera.up).normalized();
    camera_up = camera_right.cross(camera_forward);
    half_width = std::tan(camera.horizontal_fov_deg * pi / 360.0);
    half_height = half_width * camera.height / camera.width;
    first_band = camera.first_band;
    image_bands = (camera.last_band < 0 ? static_cast<int>(bands) - 1 : camera.last_band) - first_band + 1;
  }

  Eigen::Vector3d camera_ray(double x, double y) const {
    const double sx = x / scene.camera.width;
    const double sy = y / scene.camera.height;
    return (camera_forward + (2.0 * sx - 1.0) * half_width * camera_right + (1.0 - 2.0 * sy) * half_height * camera_up)
        .normalized();
  }

  int material_at(const Hit& hit) const {
    const scene::Object& object = scene.objects[static_cast<std::size_t>(hit.object)];
    return hit.back && object.sides == scene::Sides::kOne ? -1 : object.material;
  }

  /// Density, per area on emitter `e`, of drawing a given one of its points.
  double area_density(int e) const { return 1.0 / emitters[static_cast<std::size_t>(e)].area; }

  void add_beams(const Hit& hit, FaceId face, double* share, double u, double v) const {
    for (std::size_t k = 0; k < scene.directional_lights.size(); ++k) {
      const scene::DirectionalLight& light = scene.directional_lights[k];
      Eigen::Vector3d towards = -light.direction;
      double axis_cosine = 1.0;
      if (light.half_angle_rad > 0.0) {
        // Density cosine to the axis, so that the disk has uniform radiance and the stated normal irradiance.
        const double sine = std::sin(light.half_angle_rad) * std::sqrt(u);
        axis_cosine = std::sqrt(1.0 - sine * sine);
        const double angle = 2.0 * pi * v;
        towards = Frame(towards).world(sine * std::cos(angle), sine * std::sin(angle), axis_cosine).normalized();
      }
      const double cosine = hit.normal.dot(towards);
      if (cosine <= 0.0) continue;
      if (!rays.is_clear(hit.point, towards, std::numeric_limits<double>::infinity(), face)) continue;
      share[k] = cosine / axis_cosine;
    }
  }

  /// Area sampling of every emitter, weighted by the balance heuristic against the cosine-distributed next ray.
  void add_emitters(const Hit& hit, FaceId face, double* share, double u, double v, Random& random) const {
    for (std::size_t e = 0; e < emitters.size(); ++e) {
      const Emitter& emitter = emitters[e];
      const mesh::PatchMesh& mesh = scene.objects[static_cast<std::size_t>(emitter.object)].patches;
      const double wanted = random.uniform() * emitter.area;
      const auto found = std::upper_bound(emitter.cumulative_area.begin(), emitter.cumulative_area.end(), wanted);
      const auto f = std::min<std::size_t>(static_cast<std::size_t>(found - emitter.cumulative_area.begin()),
                                           mesh.faces.size() - 1);
      if (emitter.object == hit.object && static_cast<int>(f) == hit.face) continue;
      const mesh::Face& corners = mesh.faces[f];
      const auto corner = [&](std::size_t k) -> const Eigen::Vector3d& {
        return mesh.points[static_cast<std::size_t>(corners[k])];
      };
      double first = u;
      std::size_t half = 0;
      if (mesh::corner_count(corners) == 4) {
        const double area0 = (corner(1) - corner(0)).cross(corner(2) - corner(0)).norm();
        const double area1 = (corner(2) - corner(0)).cross(corner(3) - corner(0)).norm();
        const double split = area0 / (area0 + area1);
        half = u < split ? 0 : 1;
        first = half == 0 ? u / split : (u - split) / (1.0 - split);
      }
      const double root = std::sqrt(first);
      const Eigen::Vector3d point =
          (1.0 - root) * corner(0) + root * (1.0 - v) * corner(half + 1) + root * v * corner(half + 2);
      const Eigen::Vector3d normal = mesh::vector_area(mesh, corners).normalized();
      Eigen::Vector3d towards = point - hit.point;
      const double distance = towards.norm();
      if (distance == 0.0) continue;
      towards /= distance;
      const double cosine = hit.normal.dot(towards);
      const double cosine_there = -normal.dot(towards);
      if (cosine <= 0.0 || cosine_there <= 0.0) continue;
      if (!rays.is_clear(hit.point, towards, distance, face, {emitter.object, static_cast<int>(f)})) continue;
      const double direction_density = cosine * cosine_there / (pi * distance * distance);
      // exitance × cosθ cosθ' / (π r²) / (sum of the two densities): at most the exitance, however near the emitter is.
      share[first_emitter_light + static_cast<int>(e)] +=
          direction_density / (area_density(static_cast<int>(e)) + direction_density);
    }
  }

  /// The next ray met emitter `hit`: its light belongs to the direct irradiance of the point the ray left.
  void add_met_emitter(const Hit& from, const Hit& hit, double* share) const {
    const int e = emitter_of_object[static_cast<std::size_t>(hit.object)];
    if (e < 0 || hit.back) return;
    const Eigen::Vector3d way = hit.point - from.point;
    const double squared = way.squaredNorm();
    if (squared == 0.0) return;
    const double cosines = from.normal.dot(way) * -hit.normal.dot(way);  // × squared distance
    const double direction_density = cosines / (pi * squared * squared);
    share[first_emitter_light + e] += direction_density / (area_density(e) + direction_density);
  }

  /// Follows a path from its first hit, as far as roulette and the number of bounces let it.
  void follow(Hit hit, int sample, const StratifiedNumbers& strata, Random& random, Workspace& work) const {
    const bool next_ray_for_light = sky_light >= 0 || !emitters.empty();
    work.clear_path();
    for (int depth = 0; depth < kLongestPath; ++depth) {
      const int material = material_at(hit);
      if (material < 0) {
        if (depth == 0) work.add_vertex(-1);
        return;
      }
      double* share = work.add_vertex(material);
      const FaceId face{hit.object, hit.face};
      const bool first = depth == 0;
      const double light_u = first ? strata(4, sample) : random.uniform();
      const double light_v = first ? strata(5, sample) : random.uniform();
      add_beams(hit, face, share, light_u, light_v);
      add_emitters(hit, face, share, light_u, light_v, random);
      const bool last = params.bounces && depth >= *params.bounces;
      if (last && !next_ray_for_light) return;
      const double u = first ? strata(2, sample) : random.uniform();
      const double v = first ? strata(3, sample) : random.uniform();
      const auto next = rays.first_hit(hit.point, cosine_direction(hit.normal, u, v), face);
      if (!next) {
        if (sky_light >= 0) share[sky_light] += 1.0;
        return;
      }
      add_met_emitter(hit, *next, share);
      if (last) return;
      double weight = 1.0;
      if (depth + 1 >= kRouletteFreeVertices) {
        const int next_material = material_at(*next);
        const double continuation =
            next_material < 0 ? kMinContinuation : surfaces[static_cast<std::size_t>(next_material)].continuation;
        if (random.uniform() >= continuation) return;
        weight = 1.0 / continuation;
      }
      work.vertices.back().next_weight = weight;
      hit = *next;
    }
  }

  void direct_irradiance(Workspace& work, std::size_t vertex) const {
    work.direct.setZero();
    const double* share = work.share(vertex);
    for (int k = 0; k < lights(); ++k) {
      if (share[k] != 0.0) work.direct += share[k] * light_spectrum.col(k);
    }
  }

  /// From the far end of the path to the camera: what leaves each vertex is what arrives at the one before.
  void evaluate(Workspace& work) const {
    work.reflected.setZero();
    work.luminescent.setZero();
    for (std::size_t i = work.vertices.size(); i-- > 1;) {
      const Surface& surface = surfaces[static_cast<std::size_t>(work.vertices[i].material)];
      direct_irradiance(work, i);
      work.out_reflected = surface.reflectance * (work.direct + work.reflected);
      work.out_luminescent = surface.reflectance * work.luminescent;
      if (surface.luminescence.present()) {
        work.received = work.direct + work.reflected + work.luminescent;
        surface.luminescence.add(work.received.data(), work.out_luminescent.data());
      }
      const double weight = work.vertices[i - 1].next_weight;
      work.reflected = weight * work.out_reflected;
      work.luminescent = weight * work.out_luminescent;
    }
    if (work.vertices[0].material < 0) return;
    const Surface& surface = surfaces[static_cast<std::size_t>(work.vertices[0].material)];
    direct_irradiance(work, 0);
    const auto column = [&](Channel channel) { return work.value.col(static_cast<int>(channel)); };
    column(Channel::kRe) += surface.reflectance * work.direct;
    column(Channel::kRr) += surface.reflectance * work.reflected;
    column(Channel::kRl) += surface.reflectance * work.luminescent;
    if (surface.luminescence.present()) {
      surface.luminescence.add(work.direct.data(), column(Channel::kLe).data());
      surface.luminescence.add(work.reflected.data(), column(Channel::kLr).data());
      surface.luminescence.add(work.luminescent.data(), column(Channel::kLl).data());
    }
  }

  void add_path(double x, double y, int sample, const StratifiedNumbers& strata, Random& random,
                Workspace& work) const {
    const auto hit = rays.first_hit(scene.camera.position, camera_ray(x, y));
    if (!hit) return;
    const scene::Object& object = scene.objects[static_cast<std::size_t>(hit->object)];
    if (object.emits() && !hit->back) work.value.col(static_cast<int>(Channel::kEmission)) += object.exitance.array();
    follow(*hit, sample, strata, random, work);
    evaluate(work);
  }

  /// One batch of one pixel: its mean radiance enters Welford's recurrence.
  void add_batch(int row, int column, int batch, Workspace& work) {
    const std::uint64_t pixel = static_cast<std::uint64_t>(row) * static_cast<std::uint64_t>(scene.camera.width) +
                                static_cast<std::uint64_t>(column);
    const StratifiedNumbers strata(params.seed, pixel, static_cast<std::uint64_t>(batch));
    work.value.setZero();
    for (int sample = 0; sample < params.samples_per_batch; ++sample) {
      const auto index = static_cast<std::uint64_t>(batch) * static_cast<std::uint64_t>(params.samples_per_batch) +
                         static_cast<std::uint64_t>(sample);
      Random random(params.seed, pixel, index);
      add_path(column + strata(0, sample), row + strata(1, sample), sample, strata, random, work);
    }
    work.value /= pi * params.samples_per_batch;
    work.value.col(0) = work.value.rightCols(kChannels - 1).rowwise().sum();
    const int stride = image_bands + 1;
    float* const pixel_mean = mean.data() + pixel * static_cast<std::size_t>(kept_channels * stride);
    float* const pixel_squares = squares.data() + pixel * static_cast<std::size_t>(kept_channels * stride);
    const auto widths = scene.grid.widths_nm().segment(first_band, image_bands).array();
    for (int channel = 0; channel < kept_channels; ++channel) {
      const auto spectrum = work.value.col(channel).segment(first_band, image_bands);
      const double integral = (spectrum * widths).sum();
      if (channel == 0) note_largest(integral * params.samples_per_batch);
      for (int band = 0; band < stride; ++band) {
        const double value = band < image_bands ? spectrum[band] : integral;
        float& m = pixel_mean[channel * stride + band];
        const double deviation = value - static_cast<double>(m);
        m = static_cast<float>(static_cast<double>(m) + deviation / (batch + 1));
        pixel_squares[channel * stride + band] += static_cast<float>(deviation * (value - static_cast<double>(m)));
      }
    }
  }

  /// The mean of a batch times its size bounds each of its paths from above, since none is negative.
  void note_largest(double value) {
    double seen = largest.load(std::memory_order_relaxed);
    while (value > seen && !largest.compare_exchange_weak(seen, value, std::memory_order_relaxed)) {
    }
  }

  int lights() const { return static_cast<int>(light_spectrum.cols()); }
};

PathTracer::PathTracer(const scene::Scene& scene, const TraceParams& params) {
  scene::validate(scene);
  validate(params);
  impl_ = std::make_unique<Impl>(scene, params);
}
PathTracer::~PathTracer() = default;
PathTracer::PathTracer(PathTracer&&) noexcept = default;

void PathTracer::add_batches(int count, const Progress& progress) {
  const scene::Camera& camera = impl_->scene.camera;
  std::atomic<int> rows_done{0};
  tbb::parallel_for(tbb::blocked_range<int>(0, camera.height, 1), [&](const tbb::blocked_range<int>& rows) {
    Workspace work(impl_->bands, impl_->lights());
    for (int row = rows.begin(); row != rows.end(); ++row) {
      for (int column = 0; column < camera.width; ++column) {
        for (int batch = impl_->batches; batch < impl_->batches + count; ++batch)
          impl_->add_batch(row, column, batch, work);
      }
      progress.update("path tracing", static_cast<double>(++rows_done) / camera.height);
    }
  });
  impl_->batches += count;
}

int PathTracer::batches() const { return impl_->batches; }

std::int64_t PathTracer::paths() const {
  const scene::Camera& camera = impl_->scene.camera;
  return std::int64_t{camera.width} * camera.height * impl_->batches * impl_->params.samples_per_batch;
}

Estimate PathTracer::estimate(Channel channel) const {
  const int index = static_cast<int>(channel);
  if (impl_->batches < 2) throw InvalidParams("path tracer: a standard error needs at least 2 batches; add more.");
  if (index >= impl_->kept_channels) {
    throw InvalidParams("path tracer: components were not kept; set TraceParams::components.");
  }
  const scene::Camera& camera = impl_->scene.camera;
  Estimate estimate;
  image::SpectralImage& mean = estimate.mean;
  mean.width = camera.width;
  mean.height = camera.height;
  mean.wavelength_nm = impl_->scene.grid.centers_nm().segment(impl_->first_band, impl_->image_bands);
  const std::size_t pixels = static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  const auto bands = static_cast<std::size_t>(impl_->image_bands);
  mean.value.resize(pixels * bands);
  estimate.standard_error = mean;
  estimate.integral_mean.resize(pixels);
  estimate.integral_standard_error.resize(pixels);
  const double batches = impl_->batches;
  const auto error = [&](std::size_t i) {
    return std::sqrt(std::max(0.0, static_cast<double>(impl_->squares[i])) / (batches * (batches - 1.0)));
  };
  for (std::size_t pixel = 0; pixel < pixels; ++pixel) {
    const std::size_t from =
        (pixel * static_cast<std::size_t>(impl_->kept_channels) + static_cast<std::size_t>(index)) * (bands + 1);
    for (std::size_t band = 0; band < bands; ++band) {
      mean.value[pixel * bands + band] = impl_->mean[from + band];
      estimate.standard_error.value[pixel * bands + band] = static_cast<float>(error(from + band));
    }
    estimate.integral_mean[pixel] = static_cast<double>(impl_->mean[from + bands]);
    estimate.integral_standard_error[pixel] = error(from + bands);
  }
  return estimate;
}

double PathTracer::largest_sample() const { return impl_->largest.load(); }

double PathTracer::largest_possible_sample() const {
  const Eigen::VectorXd& widths = impl_->scene.grid.widths_nm();
  double arriving = 0.0;
  for (int k = 0; k < impl_->lights(); ++k) {
    // Emitting surfaces may be counted once by either way of sampling them.
    const double ways = k >= impl_->first_emitter_light ? 2.0 : 1.0;
    arriving += ways * (impl_->light_spectrum.col(k) * widths.array()).sum();
  }
  double continuation = 0.0;
  for (const Surface& surface : impl_->surfaces) continuation = std::max(continuation, surface.continuation);
  double vertices = kRouletteFreeVertices + std::log(1e-12) / std::log(continuation);
  if (impl_->params.bounces) vertices = std::min(vertices, *impl_->params.bounces + 1.0);
  double emitted = 0.0;
  for (const scene::Object& object : impl_->scene.objects) {
    if (object.emits()) emitted = std::max(emitted, object.exitance.dot(widths));
  }
  return (arriving * vertices + emitted) / pi;
}

}  // namespace interglow::cross_check
