// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/visibility.h"

#include <embree3/rtcore.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "diagnostics/error.h"

namespace interglow::radiosity {
namespace {

struct ReleaseDevice {
  void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
};
struct ReleaseScene {
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
};

/// Signed distances below this share of a segment's reach count as touching: a few roundings of double coordinates.
constexpr double kTouching = 1e-13;
/// Share of a segment at each end in which single precision cannot tell a blocker from the face the segment ends on.
/// Most of those faces are then never offered to the filter, which costs more than the search.
constexpr float kEnd = 1e-6F;

}  // namespace

struct Visibility::Impl {
  std::unique_ptr<RTCDeviceTy, ReleaseDevice> device;
  std::unique_ptr<RTCSceneTy, ReleaseScene> scene;
  std::array<std::vector<int>, 2> face_of_primitive;  ///< by geometry: triangles, quads
  std::vector<Eigen::Vector3d> normal;                ///< unit, by face
  std::vector<Eigen::Vector3d> anchor;                ///< a point of the face's plane
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double scale = 1.0;
  int packet = 1;

  int face(unsigned geometry, unsigned primitive) const { return face_of_primitive[geometry][primitive]; }
  double height(int f, const Eigen::Vector3d& p) const {
    return normal[static_cast<std::size_t>(f)].dot(p - anchor[static_cast<std::size_t>(f)]);
  }
  Eigen::Vector3f local(const Eigen::Vector3d& p) const { return ((p - centre) * scale).cast<float>(); }
  void add_geometry(RTCGeometryType type, unsigned id, const Faces& faces, int corners);
};

namespace {

/// What the filter needs of the rays under way; `base` must come first.
struct SegmentContext {
  RTCIntersectContext base;
  const Visibility::Impl* impl;
  const Segment* segments;
};

bool really_blocks(const SegmentContext& context, unsigned ray, unsigned geometry, unsigned primitive) {
  const Segment& segment = context.segments[ray];
  const int face = context.impl->face(geometry, primitive);
  if (face == segment.from_face || face == segment.to_face) return false;
  const double start = context.impl->height(face, segment.from);
  const double end = context.impl->height(face, segment.to);
  const double touching = kTouching * ((segment.to - segment.from).norm() + std::abs(start) + std::abs(end));
  return (start > touching && end < -touching) || (start < -touching && end > touching);
}

void keep_real_blockers(const RTCFilterFunctionNArguments* args) {
  const auto& context = *reinterpret_cast<const SegmentContext*>(args->context);
  for (unsigned lane = 0; lane < args->N; ++lane) {
    if (args->valid[lane] == 0) continue;
    const unsigned id = RTCRayN_id(args->ray, args->N, lane);
    if (!really_blocks(context, id, RTCHitN_geomID(args->hit, args->N, lane),
                       RTCHitN_primID(args->hit, args->N, lane))) {
      args->valid[lane] = 0;
    }
  }
}

struct RayContext {
  RTCIntersectContext base;
  const Visibility::Impl* impl;
  int skip_face;
};

void keep_other_faces(const RTCFilterFunctionNArguments* args) {
  const auto& context = *reinterpret_cast<const RayContext*>(args->context);
  for (unsigned lane = 0; lane < args->N; ++lane) {
    if (args->valid[lane] == 0) continue;
    const int face =
        context.impl->face(RTCHitN_geomID(args->hit, args->N, lane), RTCHitN_primID(args->hit, args->N, lane));
    if (face == context.skip_face) args->valid[lane] = 0;
  }
}

template <class Context>
Context make_context(RTCFilterFunctionN filter) {
  Context context{};
  rtcInitIntersectContext(&context.base);
  context.base.filter = filter;
  return context;
}

template <class Ray>
void set_lane(Ray& ray, unsigned lane, const Eigen::Vector3f& origin, const Eigen::Vector3f& direction, float near,
              float far, unsigned id) {
  ray.org_x[lane] = origin.x();
  ray.org_y[lane] = origin.y();
  ray.org_z[lane] = origin.z();
  ray.dir_x[lane] = direction.x();
  ray.dir_y[lane] = direction.y();
  ray.dir_z[lane] = direction.z();
  ray.tnear[lane] = near;
  ray.tfar[lane] = far;
  ray.time[lane] = 0.0F;
  ray.mask[lane] = ~0U;
  ray.id[lane] = id;
  ray.flags[lane] = 0;
}

RTCRay single_ray(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction, float near, float far) {
  RTCRay ray{};
  ray.tnear = near;
  ray.org_x = origin.x();
  ray.org_y = origin.y();
  ray.org_z = origin.z();
  ray.dir_x = direction.x();
  ray.dir_y = direction.y();
  ray.dir_z = direction.z();
  ray.tfar = far;
  ray.mask = ~0U;
  return ray;
}

/// Runs Embree's packet function of `Size` rays over all segments.
template <unsigned Size, class Ray, class Query>
void blocked_in_packets(const Visibility::Impl& impl, std::span<const Segment> segments, std::span<char> result,
                        Query query) {
  auto context = make_context<SegmentContext>(keep_real_blockers);
  context.impl = &impl;
  alignas(64) int valid[Size];
  alignas(64) Ray ray;
  for (std::size_t first = 0; first < segments.size(); first += Size) {
    const auto count = static_cast<unsigned>(std::min<std::size_t>(Size, segments.size() - first));
    context.segments = segments.data() + first;
    for (unsigned lane = 0; lane < Size; ++lane) {
      valid[lane] = lane < count ? -1 : 0;
      const Segment& segment = segments[first + std::min(lane, count - 1)];
      const Eigen::Vector3f from = impl.local(segment.from);
      set_lane(ray, lane, from, impl.local(segment.to) - from, kEnd, 1.0F - kEnd, lane);
    }
    query(valid, impl.scene.get(), &context.base, &ray);
    for (unsigned lane = 0; lane < count; ++lane) result[first + lane] = ray.tfar[lane] < 0.0F ? 1 : 0;
  }
}

template <unsigned Size, class RayAndHit, class Query>
void hits_in_packets(const Visibility::Impl& impl, std::span<const Eigen::Vector3d> origins,
                     std::span<const Eigen::Vector3d> directions, std::span<RayHit> hits, Query query);

}  // namespace

void Visibility::Impl::add_geometry(RTCGeometryType type, unsigned id, const Faces& faces, int corners) {
  std::vector<int>& of_primitive = face_of_primitive[id];
  for (std::size_t f = 0; f < faces.corners.size(); ++f) {
    if (mesh::corner_count(faces.corners[f]) == corners) of_primitive.push_back(static_cast<int>(f));
  }
  if (of_primitive.empty()) return;
  RTCGeometry geometry = rtcNewGeometry(device.get(), type);
  auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                               3 * sizeof(float), faces.points.size()));
  for (const Eigen::Vector3d& p : faces.points) {
    const Eigen::Vector3f q = local(p);
    vertices = std::copy_n(q.data(), 3, vertices);
  }
  auto* indices = static_cast<unsigned*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, corners == 3 ? RTC_FORMAT_UINT3 : RTC_FORMAT_UINT4,
                              static_cast<std::size_t>(corners) * sizeof(unsigned), of_primitive.size()));
  for (int f : of_primitive) {
    for (int k = 0; k < corners; ++k) {
      *indices++ = static_cast<unsigned>(faces.corners[static_cast<std::size_t>(f)][static_cast<std::size_t>(k)]);
    }
  }
  rtcCommitGeometry(geometry);
  rtcAttachGeometryByID(scene.get(), geometry, id);
  rtcReleaseGeometry(geometry);
}

Visibility::Visibility(const Faces& faces) : impl_(std::make_unique<Impl>()) {
  impl_->device.reset(rtcNewDevice(nullptr));
  if (!impl_->device) throw NumericalFailure("Embree could not be started: rtcNewDevice failed.");
  if (rtcGetDeviceProperty(impl_->device.get(), RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED) != 0) impl_->packet = 8;
  if (rtcGetDeviceProperty(impl_->device.get(), RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED) != 0) impl_->packet = 16;
  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector3d high = -low;
  for (const Eigen::Vector3d& p : faces.points) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  if (!faces.points.empty()) {
    impl_->centre = 0.5 * (low + high);
    const double extent = (high - low).maxCoeff();
    // A power of two, so that scaling alone rounds nothing.
    if (extent > 0.0) impl_->scale = std::exp2(-std::floor(std::log2(extent)));
  }
  for (const mesh::Face& face : faces.corners) {
    const auto point = [&](std::size_t k) -> const Eigen::Vector3d& {
      return faces.points[static_cast<std::size_t>(face[k])];
    };
    const Eigen::Vector3d across = face[3] < 0 ? point(2) - point(1) : Eigen::Vector3d(point(3) - point(1));
    const Eigen::Vector3d area =
        (face[3] < 0 ? Eigen::Vector3d(point(1) - point(0)) : Eigen::Vector3d(point(2) - point(0))).cross(across);
    impl_->normal.push_back(area.stableNormalized());
    impl_->anchor.push_back(point(0));
  }
  impl_->scene.reset(rtcNewScene(impl_->device.get()));
  rtcSetSceneFlags(impl_->scene.get(),
                   static_cast<RTCSceneFlags>(RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION));
  impl_->add_geometry(RTC_GEOMETRY_TYPE_TRIANGLE, 0, faces, 3);
  impl_->add_geometry(RTC_GEOMETRY_TYPE_QUAD, 1, faces, 4);
  rtcCommitScene(impl_->scene.get());
  if (rtcGetDeviceError(impl_->device.get()) != RTC_ERROR_NONE) {
    throw NumericalFailure("Embree could not build the scene (most likely out of memory).");
  }
}

Visibility::~Visibility() = default;
Visibility::Visibility(Visibility&&) noexcept = default;
Visibility& Visibility::operator=(Visibility&&) noexcept = default;

namespace {

/// The hit in double precision, from what Embree found.
RayHit exact_hit(const Visibility::Impl& impl, int face, double distance_found, const Eigen::Vector3d& origin,
                 const Eigen::Vector3d& direction) {
  const double speed = impl.normal[static_cast<std::size_t>(face)].dot(direction);
  const double height = impl.height(face, origin);
  // A ray that grazes the plane has no stable crossing: the single-precision distance is the better one.
  const bool grazing = std::abs(speed) < 1e-6 * direction.norm();
  RayHit hit;
  hit.face = face;
  hit.distance = grazing ? distance_found : -height / speed;
  hit.front = speed < 0.0;
  hit.point = origin + hit.distance * direction;
  return hit;
}

template <unsigned Size, class RayAndHit, class Query>
void hits_in_packets(const Visibility::Impl& impl, std::span<const Eigen::Vector3d> origins,
                     std::span<const Eigen::Vector3d> directions, std::span<RayHit> hits, Query query) {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  alignas(64) int valid[Size];
  alignas(64) RayAndHit packet;
  for (std::size_t first = 0; first < origins.size(); first += Size) {
    const auto count = static_cast<unsigned>(std::min<std::size_t>(Size, origins.size() - first));
    for (unsigned lane = 0; lane < Size; ++lane) {
      valid[lane] = lane < count ? -1 : 0;
      const std::size_t k = first + std::min(lane, count - 1);
      set_lane(packet.ray, lane, impl.local(origins[k]), (directions[k] * impl.scale).template cast<float>(), 0.0F,
               std::numeric_limits<float>::infinity(), lane);
      packet.hit.geomID[lane] = RTC_INVALID_GEOMETRY_ID;
      packet.hit.instID[0][lane] = RTC_INVALID_GEOMETRY_ID;
    }
    query(valid, impl.scene.get(), &context, &packet);
    for (unsigned lane = 0; lane < count; ++lane) {
      const std::size_t k = first + lane;
      hits[k] = packet.hit.geomID[lane] == RTC_INVALID_GEOMETRY_ID
                    ? RayHit{}
                    : exact_hit(impl, impl.face(packet.hit.geomID[lane], packet.hit.primID[lane]),
                                static_cast<double>(packet.ray.tfar[lane]), origins[k], directions[k]);
    }
  }
}

}  // namespace

std::optional<RayHit> Visibility::first_hit(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                                            int skip_face) const {
  auto context = make_context<RayContext>(keep_other_faces);
  context.impl = impl_.get();
  context.skip_face = skip_face;
  RTCRayHit query{};
  query.ray = single_ray(impl_->local(origin), (direction * impl_->scale).cast<float>(), 0.0F,
                         std::numeric_limits<float>::infinity());
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(impl_->scene.get(), &context.base, &query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;
  return exact_hit(*impl_, impl_->face(query.hit.geomID, query.hit.primID), static_cast<double>(query.ray.tfar), origin,
                   direction);
}

void Visibility::first_hits(std::span<const Eigen::Vector3d> origins, std::span<const Eigen::Vector3d> directions,
                            std::span<RayHit> hits) const {
  if (impl_->packet == 16) {
    hits_in_packets<16, RTCRayHit16>(*impl_, origins, directions, hits, rtcIntersect16);
  } else if (impl_->packet == 8) {
    hits_in_packets<8, RTCRayHit8>(*impl_, origins, directions, hits, rtcIntersect8);
  } else {
    for (std::size_t k = 0; k < origins.size(); ++k) hits[k] = first_hit(origins[k], directions[k]).value_or(RayHit{});
  }
}

bool Visibility::blocked(const Segment& segment) const {
  auto context = make_context<SegmentContext>(keep_real_blockers);
  context.impl = impl_.get();
  context.segments = &segment;
  const Eigen::Vector3f from = impl_->local(segment.from);
  RTCRay ray = single_ray(from, impl_->local(segment.to) - from, kEnd, 1.0F - kEnd);
  rtcOccluded1(impl_->scene.get(), &context.base, &ray);
  return ray.tfar < 0.0F;
}

void Visibility::blocked(std::span<const Segment> segments, std::span<char> result) const {
  if (impl_->packet == 16) {
    blocked_in_packets<16, RTCRay16>(*impl_, segments, result, rtcOccluded16);
  } else if (impl_->packet == 8) {
    blocked_in_packets<8, RTCRay8>(*impl_, segments, result, rtcOccluded8);
  } else {
    for (std::size_t k = 0; k < segments.size(); ++k) result[k] = blocked(segments[k]) ? 1 : 0;
  }
}

}  // namespace interglow::radiosity
