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

/// Distances from a plane below this share of the scene's radius count as touching: single precision cannot tell them
/// from 0. A line that starts so near to a plane crosses it there or nowhere.
constexpr double kTouching = 1e-6;
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
  double touching = 0.0;  ///< kTouching in mm
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
  const Visibility::Impl& impl = *context.impl;
  const double start = impl.height(face, segment.from);
  if (std::abs(start) <= impl.touching) return false;
  if (segment.half_line) return start * impl.normal[static_cast<std::size_t>(face)].dot(segment.to) < 0.0;
  const double end = impl.height(face, segment.to);
  return std::abs(end) > impl.touching && (start > 0.0) != (end > 0.0);
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

SegmentContext segment_context(const Visibility::Impl& impl) {
  SegmentContext context{};
  rtcInitIntersectContext(&context.base);
  context.base.filter = keep_real_blockers;
  context.impl = &impl;
  return context;
}

/// A ray in Embree's coordinates.
struct LocalRay {
  Eigen::Vector3f origin;
  Eigen::Vector3f direction;
  float near = 0.0F;
  float far = std::numeric_limits<float>::infinity();
};

LocalRay local_ray(const Visibility::Impl& impl, const Segment& segment) {
  const Eigen::Vector3f from = impl.local(segment.from);
  if (segment.half_line) return {from, segment.to.cast<float>()};
  return {from, impl.local(segment.to) - from, kEnd, 1.0F - kEnd};
}

template <class Ray>
void set_lane(Ray& ray, unsigned lane, const LocalRay& local) {
  ray.org_x[lane] = local.origin.x();
  ray.org_y[lane] = local.origin.y();
  ray.org_z[lane] = local.origin.z();
  ray.dir_x[lane] = local.direction.x();
  ray.dir_y[lane] = local.direction.y();
  ray.dir_z[lane] = local.direction.z();
  ray.tnear[lane] = local.near;
  ray.tfar[lane] = local.far;
  ray.time[lane] = 0.0F;
  ray.mask[lane] = ~0U;
  ray.id[lane] = lane;
  ray.flags[lane] = 0;
}

RTCRay single_ray(const LocalRay& local) {
  RTCRay ray{};
  ray.tnear = local.near;
  ray.org_x = local.origin.x();
  ray.org_y = local.origin.y();
  ray.org_z = local.origin.z();
  ray.dir_x = local.direction.x();
  ray.dir_y = local.direction.y();
  ray.dir_z = local.direction.z();
  ray.tfar = local.far;
  ray.mask = ~0U;
  return ray;
}

/// Runs Embree's packet function of `Size` rays over all segments.
template <unsigned Size, class Ray, class Query>
void blocked_in_packets(const Visibility::Impl& impl, std::span<const Segment> segments, std::span<char> result,
                        Query query) {
  SegmentContext context = segment_context(impl);
  alignas(64) int valid[Size];
  alignas(64) Ray ray;
  for (std::size_t first = 0; first < segments.size(); first += Size) {
    const auto count = static_cast<unsigned>(std::min<std::size_t>(Size, segments.size() - first));
    context.segments = segments.data() + first;
    for (unsigned lane = 0; lane < Size; ++lane) {
      valid[lane] = lane < count ? -1 : 0;
      set_lane(ray, lane, local_ray(impl, segments[first + std::min(lane, count - 1)]));
    }
    query(valid, impl.scene.get(), &context.base, &ray);
    for (unsigned lane = 0; lane < count; ++lane) result[first + lane] = ray.tfar[lane] < 0.0F ? 1 : 0;
  }
}

/// The same for the first faces along half-lines from one point.
template <unsigned Size, class RayAndHit, class Query>
void faces_in_packets(const Visibility::Impl& impl, const Eigen::Vector3f& origin,
                      std::span<const Eigen::Vector3d> directions, std::span<int> faces, Query query) {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  alignas(64) int valid[Size];
  alignas(64) RayAndHit packet;
  for (std::size_t first = 0; first < directions.size(); first += Size) {
    const auto count = static_cast<unsigned>(std::min<std::size_t>(Size, directions.size() - first));
    for (unsigned lane = 0; lane < Size; ++lane) {
      valid[lane] = lane < count ? -1 : 0;
      set_lane(packet.ray, lane, {origin, directions[first + std::min(lane, count - 1)].template cast<float>()});
      packet.hit.geomID[lane] = RTC_INVALID_GEOMETRY_ID;
      packet.hit.instID[0][lane] = RTC_INVALID_GEOMETRY_ID;
    }
    query(valid, impl.scene.get(), &context, &packet);
    for (unsigned lane = 0; lane < count; ++lane) {
      faces[first + lane] = packet.hit.geomID[lane] == RTC_INVALID_GEOMETRY_ID
                                ? -1
                                : impl.face(packet.hit.geomID[lane], packet.hit.primID[lane]);
    }
  }
}

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
    impl_->touching = kTouching * 0.5 * (high - low).norm();
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

void Visibility::first_faces(const Eigen::Vector3d& origin, std::span<const Eigen::Vector3d> directions,
                             std::span<int> faces) const {
  const Eigen::Vector3f start = impl_->local(origin);
  if (impl_->packet == 16) {
    faces_in_packets<16, RTCRayHit16>(*impl_, start, directions, faces, rtcIntersect16);
  } else if (impl_->packet == 8) {
    faces_in_packets<8, RTCRayHit8>(*impl_, start, directions, faces, rtcIntersect8);
  } else {
    for (std::size_t k = 0; k < directions.size(); ++k) {
      RTCIntersectContext context;
      rtcInitIntersectContext(&context);
      RTCRayHit query{};
      query.ray = single_ray({start, directions[k].cast<float>()});
      query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
      query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
      rtcIntersect1(impl_->scene.get(), &context, &query);
      faces[k] = query.hit.geomID == RTC_INVALID_GEOMETRY_ID ? -1 : impl_->face(query.hit.geomID, query.hit.primID);
    }
  }
}

bool Visibility::blocked(const Segment& segment) const {
  SegmentContext context = segment_context(*impl_);
  context.segments = &segment;
  RTCRay ray = single_ray(local_ray(*impl_, segment));
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
