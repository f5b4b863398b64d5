// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/forward_model.h"

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "diagnostics/error.h"
#include "fitting/coverage.h"
#include "fitting/indirect_solve.h"
#include "fitting/node_gather.h"
#include "rendering/surface.h"

namespace interglow::fitting {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using radiosity::RowMatrix;

/// Tilt of the light for differences of exact areas [rad]: far below a pixel of shadow motion, far above rounding.
constexpr double kLightStep = 2e-5;
/// Motion in the picture for differences of exact coverage [px].
constexpr double kPictureStep = 2e-3;
/// As ForwardParams::solve_tolerance, where it is smaller than this.
constexpr double kDerivativeTolerance = 1e-7;
/// Edges of outlines farther than this from the smooth surfaces are halved, in sizes of the scene: a polygon within a
/// circle by a share s of its radius shifts the field of view by 4 s where objects are shallow.
constexpr double kOutline = 3e-5;

/// A step of a camera parameter for differences of exact coverage.
struct CameraStep {
  Eigen::Matrix<double, LensCamera::kParameters, 1> step;
  double size = 0.0;
};

CameraStep camera_step(const LensCamera& camera, int parameter) {
  // A unit of the parameter moves the picture by about this many pixels.
  const double half = 0.5 * camera.width;
  const double depth = camera.pivot_in_camera.z();
  double motion = half;  // turn about the viewing axis, focal length
  if (parameter == kShiftX || parameter == kShiftY) motion = camera.focal_px / depth;
  if (parameter == kShiftZ) motion = half / depth;
  if (parameter == kPrincipalX || parameter == kPrincipalY) motion = 1.0;
  if (parameter == kDistortion) motion = half * half * half / (camera.focal_px * camera.focal_px);
  CameraStep result;
  result.size = kPictureStep / motion;
  result.step.setZero();
  result.step[parameter - kTurnX] = result.size;
  return result;
}

VectorXd covered(const CameraView& view) {
  VectorXd result = VectorXd::Zero(static_cast<Index>(view.camera.width) * view.camera.height);
  for (const Fragment& fragment : view.fragments) result[fragment.pixel] += fragment.area;
  return result;
}

/// Half the diagonal of the box around all faces.
double radius_mm(const radiosity::Elements& elements) {
  Vector3d low = elements.faces.points[0], high = low;
  for (const Vector3d& p : elements.faces.points) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  return 0.5 * (high - low).norm();
}

/// Without a sky nothing is asked of black sides.
radiosity::TransportParams exchange(radiosity::TransportParams params) {
  params.black_sides = false;
  return params;
}

}  // namespace

void validate(const ForwardParams& params) {
  radiosity::validate(params.transport);
  if (params.mesh) validate(*params.mesh);
  if (params.bounces && *params.bounces < 0)
    throw InvalidParams(fmt::format("bounces is {}, expected at least 0.", *params.bounces));
  if (!(params.spectral_tolerance >= 1e-10 && params.spectral_tolerance <= 1e-2)) {
    throw InvalidParams(
        fmt::format("spectral_tolerance is {}, expected a value in [1e-10, 1e-2].", params.spectral_tolerance));
  }
  if (!(params.solve_tolerance >= 1e-14 && params.solve_tolerance <= 1e-3)) {
    throw InvalidParams(
        fmt::format("solve_tolerance is {}, expected a value in [1e-14, 1e-3].", params.solve_tolerance));
  }
}

int shared_count(const scene::Scene& scene) { return kFirstScale + 2 * static_cast<int>(scene.materials.size()); }

Eigen::Matrix<double, 3, 2> light_tangents(const Vector3d& direction) {
  // Along the world's y axis and across it where possible, so that names in reports read easily.
  const Vector3d axis = std::abs(direction.y()) < 0.9 ? Vector3d::UnitY() : Vector3d::UnitX();
  Eigen::Matrix<double, 3, 2> tangents;
  tangents.col(1) = (axis - axis.dot(direction) * direction).normalized();
  tangents.col(0) = tangents.col(1).cross(direction).normalized();
  return tangents;
}

std::string parameter_name(const scene::Scene& scene, const FitState& state, int parameter) {
  switch (parameter) {
    case kLightU:
    case kLightV: {
      const Vector3d along = light_tangents(state.light_direction).col(parameter);
      return fmt::format("light tilt along ({:.2f}, {:.2f}, {:.2f})", along.x(), along.y(), along.z());
    }
    case kTurnX:
      return "camera turn about its x axis";
    case kTurnY:
      return "camera turn about its y axis";
    case kTurnZ:
      return "camera turn about its viewing axis";
    case kShiftX:
      return "camera shift to the right";
    case kShiftY:
      return "camera shift down";
    case kShiftZ:
      return "camera distance";
    case kFocal:
      return "focal length (logarithm)";
    case kPrincipalX:
      return "principal point, column";
    case kPrincipalY:
      return "principal point, row";
    case kDistortion:
      return "radial distortion";
    case kBlur:
      return "blur";
    case kW:
      return "w/w'";
    default: {
      const auto material = static_cast<std::size_t>(parameter - kFirstScale);
      const std::size_t count = scene.materials.size();
      return material < count ? "reflectance scale of " + scene.materials[material].name
                              : "reflectance offset of " + scene.materials[material - count].name;
    }
  }
}

std::string parameter_unit(int parameter) {
  if (parameter <= kTurnZ) return "rad";
  if (parameter <= kShiftZ) return "mm";
  if (parameter == kPrincipalX || parameter == kPrincipalY || parameter == kBlur) return "px";
  return "1";
}

FitState moved(const FitState& state, const VectorXd& step) {
  FitState result = state;
  result.light_direction =
      (state.light_direction + light_tangents(state.light_direction) * step.segment<2>(kLightU)).normalized();
  result.camera = state.camera.moved(step.segment<LensCamera::kParameters>(kTurnX));
  result.blur_px += step[kBlur];
  result.w += step[kW];
  const Index materials = result.scale.size();
  for (Index m = 0; m < materials; ++m) {
    result.scale[m] += step[kFirstScale + m];
    result.raise[m] += step[kFirstScale + materials + m];
  }
  return result;
}

RowMatrix blurred(const RowMatrix& image, int width, int height, double sigma_px, bool derivative) {
  if (!(sigma_px >= kLeastBlur)) return derivative ? RowMatrix(RowMatrix::Zero(image.rows(), image.cols())) : image;
  const int reach = static_cast<int>(std::ceil(5.0 * sigma_px));
  VectorXd kernel(2 * reach + 1);
  VectorXd slope(2 * reach + 1);
  for (int k = -reach; k <= reach; ++k) {
    const double square = static_cast<double>(k) * k;
    kernel[k + reach] = std::exp(-0.5 * square / (sigma_px * sigma_px));
    slope[k + reach] = kernel[k + reach] * square / (sigma_px * sigma_px * sigma_px);
  }
  const double sum = kernel.sum();
  slope = slope / sum - kernel * (slope.sum() / (sum * sum));
  kernel /= sum;
  const auto mirrored = [](int i, int n) {
    while (i < 0 || i >= n) i = i < 0 ? -1 - i : 2 * n - 1 - i;
    return i;
  };
  const auto pass = [&](const RowMatrix& from, const VectorXd& weights, bool along_rows) {
    RowMatrix to = RowMatrix::Zero(from.rows(), from.cols());
    tbb::parallel_for(tbb::blocked_range<int>(0, height, 4), [&](const tbb::blocked_range<int>& range) {
      for (int row = range.begin(); row < range.end(); ++row) {
        for (int column = 0; column < width; ++column) {
          auto out = to.row(static_cast<Index>(row) * width + column);
          for (int k = -reach; k <= reach; ++k) {
            const Index source = along_rows ? static_cast<Index>(row) * width + mirrored(column + k, width)
                                            : static_cast<Index>(mirrored(row + k, height)) * width + column;
            out += weights[k + reach] * from.row(source);
          }
        }
      }
    });
    return to;
  };
  const RowMatrix across = pass(image, kernel, true);
  if (!derivative) return pass(across, kernel, false);
  return pass(across, slope, false) + pass(pass(image, slope, true), kernel, false);
}

/// What a light does to the scene, whatever the camera.
struct Lighting {
  Vector3d direction;
  double half_angle_rad = 0.0;
  VectorXd scale;
  VectorXd raise;
  std::optional<int> bounces;
  LightView view;
  VectorXd factor;      ///< irradiance factors of the elements
  RowMatrix radiosity;  ///< elements x modes; empty without bounces
};

struct ForwardModel::Impl {
  scene::Scene scene;
  ForwardParams params;
  radiosity::Elements elements;
  rendering::Surface surface;
  radiosity::Visibility visibility;
  Triangles triangles;
  radiosity::Transport transport;
  SpectralReduction spectra;
  IndirectSolve between;
  NodeGather gather;
  std::optional<Lighting> lit{};
  std::vector<int> group;  ///< material of each triangle's front, -1 black; backs have the same or none

  Impl(const scene::Scene& of, const ForwardParams& with, const Progress& progress)
      : scene(with.mesh ? fit_mesh(of, *with.mesh) : of),
        params(with),
        elements(radiosity::make_elements(scene)),
        surface(scene, elements),
        visibility(elements.faces),
        triangles(make_triangles(scene, elements, surface,
                                 with.mesh ? kOutline * radius_mm(elements) : std::numeric_limits<double>::infinity())),
        transport(radiosity::Transport::build(elements, exchange(params.transport), progress)),
        spectra(reduce_spectra(scene, scene.directional_lights.front().normal_irradiance, params.spectral_tolerance)),
        between(elements, transport, spectra),
        gather(surface, elements, visibility) {
    for (std::size_t t = 0; t < triangles.size(); ++t)
      group.push_back(scene.objects[static_cast<std::size_t>(triangles.faces.object[t])].material);
  }

  /// Irradiance factors of the elements: mean of cosine × lit share over their triangles.
  VectorXd element_factor(const LightView& light) const {
    VectorXd factor = VectorXd::Zero(elements.size());
    for (std::size_t t = 0; t < triangles.size(); ++t) {
      const auto face = static_cast<std::size_t>(triangles.face[t]);
      const int element = light.back[t] ? elements.back_element[face] : elements.front_element[face];
      if (element < 0) continue;
      const auto& c = triangles.corner[t];
      factor[element] += light.factor[t] * 0.5 * (c[1] - c[0]).cross(c[2] - c[0]).norm() / elements.area_mm2[element];
    }
    return factor;
  }

  /// Of each material, what leaves it per unit of direct irradiance factor, and per unit of each mode that arrives.
  std::vector<Eigen::RowVectorXd> from_direct(const FitState& state) const {
    std::vector<Eigen::RowVectorXd> result;
    for (std::size_t m = 0; m < scene.materials.size(); ++m) {
      const auto k = static_cast<Index>(m);
      result.emplace_back(state.scale[k] * spectra.from_direct[m] + state.raise[k] * spectra.light);
    }
    return result;
  }
  std::vector<MatrixXd> from_indirect(const FitState& state) const {
    std::vector<MatrixXd> result;
    for (std::size_t m = 0; m < scene.materials.size(); ++m) {
      const auto k = static_cast<Index>(m);
      result.emplace_back(state.scale[k] * spectra.from_indirect[m]);
      result.back().diagonal().array() += state.raise[k];
    }
    return result;
  }

  /// Radiosity that direct light v sends out: elements x modes.
  RowMatrix sent(const VectorXd& v, const std::vector<Eigen::RowVectorXd>& reflected) const {
    RowMatrix result = RowMatrix::Zero(elements.size(), spectra.modes());
    for (Index e = 0; e < elements.size(); ++e) {
      const int m = elements.material[static_cast<std::size_t>(e)];
      if (m >= 0) result.row(e) = v[e] * reflected[static_cast<std::size_t>(m)];
    }
    return result;
  }

  bool bounces() const { return !params.bounces || *params.bounces > 0; }

  /// Light of a state: solved once, as long as it stays where it is.
  const Lighting& lighting(const FitState& state) {
    if (lit && lit->direction == state.light_direction && lit->half_angle_rad == state.half_angle_rad &&
        lit->scale == state.scale && lit->raise == state.raise && lit->bounces == params.bounces)
      return *lit;
    lit.reset();
    Lighting next{state.light_direction, state.half_angle_rad, state.scale, state.raise, params.bounces, {}, {}, {}};
    next.view = light_view(triangles, state.light_direction, state.half_angle_rad);
    next.factor = element_factor(next.view);
    if (bounces()) {
      next.radiosity = between.radiosity(sent(next.factor, from_direct(state)), from_indirect(state), params.bounces,
                                         params.solve_tolerance);
    }
    lit = std::move(next);
    return *lit;
  }

  /// Sides that a camera sees.
  std::vector<int> seen_sides(const CameraView& view) const {
    std::vector<int> sides;
    for (std::size_t t = 0; t < triangles.size(); ++t) {
      if (!view.part[t].empty() && seen_material(view, t) >= 0) sides.push_back(side_of(view, t));
    }
    sides.erase(std::unique(sides.begin(), sides.end()), sides.end());
    return sides;
  }
  int side_of(const CameraView& view, std::size_t t) const {
    return NodeGather::side(triangles.face[t], triangles.half[t], view.back[t] != 0);
  }
  int seen_material(const CameraView& view, std::size_t t) const {
    const auto face = static_cast<std::size_t>(triangles.face[t]);
    const int element = view.back[t] ? elements.back_element[face] : elements.front_element[face];
    return element < 0 ? -1 : elements.material[static_cast<std::size_t>(element)];
  }
  std::vector<int> seen_groups(const CameraView& view) const {
    std::vector<int> groups(triangles.size());
    for (std::size_t t = 0; t < groups.size(); ++t) groups[t] = seen_material(view, t);
    return groups;
  }

  /// Indirect irradiance of every pixel: pixels x (materials × modes), from values at the points (points x modes).
  RowMatrix indirect_image(const CameraView& view, const RowMatrix& values, Index first_column) const {
    const Index modes = spectra.modes();
    const Index pixels = static_cast<Index>(view.camera.width) * view.camera.height;
    RowMatrix image = RowMatrix::Zero(pixels, modes * static_cast<Index>(scene.materials.size()));
    tbb::parallel_for(tbb::blocked_range<Index>(0, pixels, 1024), [&](const tbb::blocked_range<Index>& range) {
      Eigen::RowVectorXd sum(modes);
      for (Index pixel = range.begin(); pixel < range.end(); ++pixel) {
        const auto p = static_cast<std::size_t>(pixel);
        for (std::size_t f = view.first[p]; f < view.first[p + 1]; ++f) {
          const Fragment& fragment = view.fragments[f];
          const auto t = static_cast<std::size_t>(fragment.triangle);
          const int m = seen_material(view, t);
          if (m < 0) continue;
          const std::array<int, 6>& points = gather.points(side_of(view, t));
          sum.setZero();
          for (std::size_t k = 0; k < 6; ++k)
            sum += fragment.shape[k] * values.block(points[k], first_column, 1, modes);
          image.block(pixel, m * modes, 1, modes) += sum;
        }
      }
    });
    return image;
  }

  /// Channels of a picture before the blur: what leaves the surfaces towards the camera.
  /// @param direct    pixels x materials; @param arriving  pixels x (materials × modes); either may be empty
  RowMatrix leaving(const RowMatrix& direct, const RowMatrix& arriving,
                    const std::vector<Eigen::RowVectorXd>& of_direct, const std::vector<MatrixXd>& of_indirect,
                    double w) const {
    const Index modes = spectra.modes();
    const Index pixels = std::max(direct.rows(), arriving.rows());
    RowMatrix channels = RowMatrix::Zero(pixels, modes);
    tbb::parallel_for(tbb::blocked_range<Index>(0, pixels, 1024), [&](const tbb::blocked_range<Index>& range) {
      const auto first = range.begin();
      const auto count = static_cast<Index>(range.size());
      auto part = channels.middleRows(first, count);
      for (std::size_t m = 0; m < scene.materials.size(); ++m) {
        const auto k = static_cast<Index>(m);
        if (direct.size() > 0) part.noalias() += direct.block(first, k, count, 1) * of_direct[m];
        if (arriving.size() > 0) part.noalias() += w * arriving.block(first, k * modes, count, modes) * of_indirect[m];
      }
    });
    return channels;
  }
};

ForwardModel::ForwardModel(const scene::Scene& scene, const ForwardParams& params, const Progress& progress) {
  validate(params);
  scene::validate(scene);
  bool emits = scene.sky.has_value();
  for (const scene::Object& object : scene.objects) emits = emits || object.emits();
  if (scene.directional_lights.size() != 1 || emits) {
    throw InvalidInput(fmt::format(
        "The fit needs a scene with one directional light and no other light; this one has {} directional lights{}. "
        "Leave one lamp in the scene file.",
        scene.directional_lights.size(), emits ? " and a sky or an emitting surface" : ""));
  }
  if (!(scene.directional_lights.front().normal_irradiance.maxCoeff() > 0.0))
    throw InvalidInput("light " + scene.directional_lights.front().name + ": its spectrum is 0 in all bands.");
  impl_ = std::make_unique<Impl>(scene, params, progress);
}

ForwardModel::~ForwardModel() = default;

const scene::Scene& ForwardModel::scene() const { return impl_->scene; }
const SpectralReduction& ForwardModel::spectra() const { return impl_->spectra; }
const radiosity::Elements& ForwardModel::elements() const { return impl_->elements; }
const radiosity::Transport& ForwardModel::transport() const { return impl_->transport; }
Index ForwardModel::channels() const { return impl_->spectra.modes(); }
const RowMatrix& ForwardModel::palette() const { return impl_->spectra.palette; }
void ForwardModel::set_bounces(std::optional<int> bounces) { impl_->params.bounces = bounces; }

FitState ForwardModel::initial_state() const {
  const scene::Scene& scene = impl_->scene;
  FitState state;
  state.light_direction = scene.directional_lights.front().direction;
  state.half_angle_rad = scene.directional_lights.front().half_angle_rad;
  const Vector3d pivot =
      (impl_->elements.area_mm2.transpose() * impl_->elements.centroid).transpose() / impl_->elements.area_mm2.sum();
  state.camera = lens_camera(scene.camera, pivot);
  state.scale = VectorXd::Ones(static_cast<Index>(scene.materials.size()));
  state.raise = VectorXd::Zero(static_cast<Index>(scene.materials.size()));
  state.gain = VectorXd::Ones(impl_->spectra.bands());
  state.offset = VectorXd::Zero(impl_->spectra.bands());
  return state;
}

Evaluation ForwardModel::evaluate(const FitState& state, const std::vector<int>& wanted,
                                  const Progress& progress) const {
  Impl& impl = *impl_;
  const Index modes = impl.spectra.modes();
  const auto materials = static_cast<Index>(impl.scene.materials.size());
  const int width = state.camera.width;
  const int height = state.camera.height;
  const auto asked = [&](int parameter) { return std::find(wanted.begin(), wanted.end(), parameter) != wanted.end(); };

  // Light: irradiance factors of the elements and their derivatives, indirect light of all of them at once.
  const Eigen::Matrix<double, 3, 2> tangents = light_tangents(state.light_direction);
  const auto tilted = [&](int axis, double step) -> Vector3d {
    return (state.light_direction + step * tangents.col(axis)).normalized();
  };
  const Lighting& lit = impl.lighting(state);
  const LightView& light = lit.view;
  std::array<std::array<LightView, 2>, 2> tilted_light;  // of the tilts asked for: behind, ahead
  for (const int axis : {0, 1}) {
    if (!asked(axis)) continue;
    for (const int ahead : {0, 1}) {
      const Vector3d direction = tilted(axis, ahead ? kLightStep : -kLightStep);
      tilted_light[static_cast<std::size_t>(axis)][static_cast<std::size_t>(ahead)] =
          light_view(impl.triangles, direction, state.half_angle_rad);
    }
  }
  const std::vector<Eigen::RowVectorXd> of_direct = impl.from_direct(state);
  const std::vector<MatrixXd> of_indirect = impl.from_indirect(state);
  std::vector<int> sources;  // of the solve beside the light itself: parameters
  for (const int parameter : wanted) {
    if (parameter <= kLightV || parameter >= kFirstScale) sources.push_back(parameter);
  }
  std::sort(sources.begin(), sources.end());
  // Of a scale or an offset: material, and what of all that arrives leaves it in the picture and between the surfaces.
  struct Paint {
    Index material;
    std::vector<Eigen::RowVectorXd> of_direct;
    std::vector<MatrixXd> of_indirect;
  };
  const auto paint_of = [&](int parameter) {
    const bool is_scale = parameter < kFirstScale + materials;
    Paint paint{(parameter - kFirstScale) % materials, {}, {}};
    for (Index m = 0; m < materials; ++m) {
      const auto k = static_cast<std::size_t>(m);
      const double on = m == paint.material ? 1.0 : 0.0;
      paint.of_direct.emplace_back(on * (is_scale ? impl.spectra.from_direct[k] : impl.spectra.light));
      paint.of_indirect.emplace_back(
          on * (is_scale ? impl.spectra.from_indirect[k] : MatrixXd(MatrixXd::Identity(modes, modes))));
    }
    return paint;
  };
  const bool bounces = impl.bounces();
  RowMatrix values;  // at the points: light, then each source
  RowMatrix last;
  if (bounces) {
    const RowMatrix& own = lit.radiosity;
    RowMatrix first = RowMatrix::Zero(impl.elements.size(), modes * static_cast<Index>(sources.size()));
    RowMatrix arriving;
    if (!sources.empty() && sources.back() >= kFirstScale) arriving = impl.transport.apply(own);
    for (std::size_t s = 0; s < sources.size(); ++s) {
      auto block = first.middleCols(static_cast<Index>(s) * modes, modes);
      if (sources[s] <= kLightV) {
        const auto& pair = tilted_light[static_cast<std::size_t>(sources[s])];
        const VectorXd dv = (impl.element_factor(pair[1]) - impl.element_factor(pair[0])) / (2.0 * kLightStep);
        block = impl.sent(dv, of_direct);
      } else {
        // B = D (E + F B): dB = dD (E + F B) + D F dB.
        const Paint paint = paint_of(sources[s]);
        const auto k = static_cast<std::size_t>(paint.material);
        for (Index e = 0; e < impl.elements.size(); ++e) {
          if (impl.elements.material[static_cast<std::size_t>(e)] != paint.material) continue;
          block.row(e) = lit.factor[e] * paint.of_direct[k];
          block.row(e).noalias() += arriving.row(e) * paint.of_indirect[k];
        }
      }
    }
    last.resize(impl.elements.size(), modes * static_cast<Index>(1 + sources.size()));
    last.leftCols(modes) = own;
    if (!sources.empty()) {
      last.rightCols(first.cols()) = impl.between.radiosity(
          first, of_indirect, impl.params.bounces, std::max(impl.params.solve_tolerance, kDerivativeTolerance));
    }
    if (progress.report || progress.cancelled) progress.update("light", 1.0);
  }

  struct Seen {
    RowMatrix direct;    ///< pixels x materials
    RowMatrix arriving;  ///< pixels x (materials × modes)
  };
  const auto seen_by = [&](const CameraView& view) {
    impl.gather.require(impl.seen_sides(view), progress);
    if (values.rows() != static_cast<Index>(impl.gather.size())) {
      values = bounces ? impl.gather.apply(last)
                       : RowMatrix(RowMatrix::Zero(static_cast<Index>(impl.gather.size()),
                                                   modes * static_cast<Index>(1 + sources.size())));
    }
    return Seen{direct_image(impl.triangles, view, light, impl.seen_groups(view), static_cast<int>(materials)),
                impl.indirect_image(view, values, 0)};
  };
  const auto picture_of = [&](const Seen& seen) {
    return impl.leaving(seen.direct, seen.arriving, of_direct, of_indirect, state.w);
  };

  Evaluation result;
  const CameraView view = camera_view(impl.triangles, state.camera);
  const Seen seen = seen_by(view);
  const RowMatrix sharp = picture_of(seen);
  result.channels = blurred(sharp, width, height, state.blur_px);
  result.direct = blurred(impl.leaving(seen.direct, {}, of_direct, of_indirect, state.w), width, height, state.blur_px);
  result.coverage = blurred(covered(view), width, height, state.blur_px).col(0);

  result.derivative.resize(static_cast<std::size_t>(shared_count(impl.scene)));
  const auto blur = [&](const RowMatrix& image) { return blurred(image, width, height, state.blur_px); };
  const std::vector<int> groups = impl.seen_groups(view);
  for (const int axis : {0, 1}) {
    if (!asked(axis)) continue;
    const auto tilted_picture = [&](std::size_t ahead) {
      return direct_image(impl.triangles, view, tilted_light[static_cast<std::size_t>(axis)][ahead], groups,
                          static_cast<int>(materials));
    };
    const RowMatrix direct = (tilted_picture(1) - tilted_picture(0)) / (2.0 * kLightStep);
    const auto source = std::find(sources.begin(), sources.end(), axis) - sources.begin();
    const RowMatrix indirect = impl.indirect_image(view, values, (1 + source) * modes);
    result.derivative[static_cast<std::size_t>(axis)] =
        blur(impl.leaving(direct, indirect, of_direct, of_indirect, state.w));
  }
  for (int parameter = kTurnX; parameter < kBlur; ++parameter) {
    if (!asked(parameter)) continue;
    if (progress.report || progress.cancelled)
      progress.update("camera derivatives", static_cast<double>(parameter - kTurnX) / LensCamera::kParameters);
    const CameraStep step = camera_step(state.camera, parameter);
    const CameraView ahead_view = camera_view(impl.triangles, state.camera.moved(step.step));
    const RowMatrix ahead = picture_of(seen_by(ahead_view));
    const CameraView behind_view = camera_view(impl.triangles, state.camera.moved(-step.step));
    const RowMatrix behind = picture_of(seen_by(behind_view));
    result.derivative[static_cast<std::size_t>(parameter)] = blur((ahead - behind) / (2.0 * step.size));
  }
  if (asked(kBlur)) {
    result.derivative[kBlur] = blurred(sharp, width, height, std::max(state.blur_px, kLeastBlur), true);
  }
  if (asked(kW)) result.derivative[kW] = (result.channels - result.direct) / state.w;
  for (const int parameter : sources) {
    if (parameter < kFirstScale) continue;
    const auto source = std::find(sources.begin(), sources.end(), parameter) - sources.begin();
    const RowMatrix indirect = impl.indirect_image(view, values, (1 + source) * modes);
    // The material itself shows more of all that arrives.
    const Paint paint = paint_of(parameter);
    result.derivative[static_cast<std::size_t>(parameter)] =
        blur(impl.leaving({}, indirect, of_direct, of_indirect, state.w) +
             impl.leaving(seen.direct, seen.arriving, paint.of_direct, paint.of_indirect, state.w));
  }
  return result;
}

CoverageEvaluation ForwardModel::coverage(const LensCamera& camera, double blur_px,
                                          const std::vector<int>& wanted) const {
  const auto seen = [&](const LensCamera& from) -> VectorXd {
    return blurred(covered(camera_view(impl_->triangles, from)), camera.width, camera.height, blur_px).col(0);
  };
  CoverageEvaluation result;
  result.value = seen(camera);
  for (const int parameter : wanted) {
    const CameraStep step = camera_step(camera, parameter);
    result.derivative.emplace_back((seen(camera.moved(step.step)) - seen(camera.moved(-step.step))) /
                                   (2.0 * step.size));
  }
  return result;
}

image::SpectralImage picture(const ForwardModel& model, const FitState& state, const Evaluation& evaluation) {
  image::SpectralImage image;
  image.width = state.camera.width;
  image.height = state.camera.height;
  image.wavelength_nm = model.spectra().wavelength_nm;
  const Index bands = model.spectra().bands();
  image.value.resize(static_cast<std::size_t>(evaluation.channels.rows() * bands));
  for (Index p = 0; p < evaluation.channels.rows(); ++p) {
    const Eigen::RowVectorXd value =
        (evaluation.channels.row(p) * model.palette()).cwiseProduct(state.gain.transpose()) + state.offset.transpose();
    Eigen::Map<Eigen::RowVectorXf>(image.value.data() + p * bands, bands) = value.cast<float>();
  }
  return image;
}

}  // namespace interglow::fitting
