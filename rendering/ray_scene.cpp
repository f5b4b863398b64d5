// SPDX-License-Identifier: GPL-3.0-or-later
#include "rendering/ray_scene.h"

#include <embree3/rtcore.h>
#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "diagnostics/error.h"

namespace interglow::rendering {
namespace {

constexpr int kPacket = 16;

// Embree's coordinates are of order 1 with an error of 2^-24 at each step; a few steps make a hit.
constexpr double kResolution = 1e-6;

// Share of a segment at each end that is not searched: rounding of a hit's place along it.
constexpr float kEnds = 4e-6F;

struct Plane {
  Eigen::Vector3d normal;
  double offset;
};

}  // namespace

struct RayScene::Impl {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double radius = 1.0;
  double scale = 1.0;
  std::vector<int> triangle_face;
  std::vector<Plane> planes;

  ~Impl() {
    if (scene) rtcReleaseScene(scene);
    if (device) rtcReleaseDevice(device);
  }

  bool ignores(const Segment& segment, int face) const {
    if (face == segment.start_face) return true;
    const Plane& plane = planes[static_cast<std::size_t>(face)];
    const double tolerance = kResolution * radius;
    if (std::abs(plane.normal.dot(segment.from) - plane.offset) < tolerance) return true;
    return !segment.half_line && std::abs(plane.normal.dot(segment.to) - plane.offset) < tolerance;
  }
};

namespace {

struct QueryContext : RTCIntersectContext {
  const Segment* segments = nullptr;
};

}  // namespace

RayScene::RayScene(const radiosity::Faces& faces) : impl_(std::make_unique<Impl>()) {
  Impl& impl = *impl_;
  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector3d high = -low;
  for (const Eigen::Vector3d& point : faces.points) {
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  if (!faces.points.empty()) {
    impl.centre = 0.5 * (low + high);
    impl.radius = std::max(0.5 * (high - low).norm(), std::numeric_limits<double>::min());
    impl.scale = std::exp2(-std::ceil(std::log2(impl.radius)));
  }
  impl.device = rtcNewDevice(nullptr);  // a number of threads would hold for all of oneTBB
  if (!impl.device)
    throw NumericalFailure(
        fmt::format("Embree did not start (error {}).", static_cast<int>(rtcGetDeviceError(nullptr))));
  impl.scene = rtcNewScene(impl.device);
  rtcSetSceneFlags(impl.scene, RTC_SCENE_FLAG_ROBUST);

  impl.planes.reserve(faces.corners.size());
  std::vector<std::array<unsigned, 3>> triangles;
  for (std::size_t f = 0; f < faces.corners.size(); ++f) {
    const mesh::Face& face = faces.corners[f];
    const auto point = [&](int k) { return faces.points[static_cast<std::size_t>(face[static_cast<std::size_t>(k)])]; };
    const Eigen::Vector3d diagonal =
        mesh::corner_count(face) == 4 ? Eigen::Vector3d(point(3) - point(1)) : Eigen::Vector3d(point(2) - point(1));
    const Eigen::Vector3d normal = (point(2) - point(0)).cross(diagonal).normalized();
    impl.planes.push_back({normal, normal.dot(point(0))});
    for (int k = 2; k < mesh::corner_count(face); ++k) {
      triangles.push_back({static_cast<unsigned>(face[0]), static_cast<unsigned>(face[static_cast<std::size_t>(k - 1)]),
                           static_cast<unsigned>(face[static_cast<std::size_t>(k)])});
      impl.triangle_face.push_back(static_cast<int>(f));
    }
  }
  RTCGeometry geometry = rtcNewGeometry(impl.device, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* vertex = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                             3 * sizeof(float), faces.points.size()));
  for (std::size_t p = 0; p < faces.points.size(); ++p) {
    for (int axis = 0; axis < 3; ++axis) {
      vertex[3 * p + static_cast<std::size_t>(axis)] =
          static_cast<float>(impl.scale * (faces.points[p][axis] - impl.centre[axis]));
    }
  }
  auto* index = static_cast<unsigned*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                               3 * sizeof(unsigned), triangles.size()));
  for (std::size_t t = 0; t < triangles.size(); ++t) std::copy(triangles[t].begin(), triangles[t].end(), index + 3 * t);
  rtcSetGeometryUserData(geometry, this->impl_.get());
  rtcSetGeometryOccludedFilterFunction(geometry, [](const RTCFilterFunctionNArguments* arguments) {
    const auto* context = static_cast<const QueryContext*>(arguments->context);
    const auto* owner = static_cast<const Impl*>(arguments->geometryUserPtr);
    for (unsigned lane = 0; lane < arguments->N; ++lane) {
      if (arguments->valid[lane] == 0) continue;
      const Segment& segment = context->segments[RTCRayN_id(arguments->ray, arguments->N, lane)];
      const unsigned triangle = RTCHitN_primID(arguments->hit, arguments->N, lane);
      if (owner->ignores(segment, owner->triangle_face[triangle])) arguments->valid[lane] = 0;
    }
  });
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(impl.scene, geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(impl.scene);
  const RTCError error = rtcGetDeviceError(impl.device);
  if (error != RTC_ERROR_NONE)
    throw NumericalFailure(fmt::format("Embree could not build its tree (error {}).", static_cast<int>(error)));
}

RayScene::~RayScene() = default;
RayScene::RayScene(RayScene&&) noexcept = default;
RayScene& RayScene::operator=(RayScene&&) noexcept = default;

double RayScene::radius_mm() const { return impl_->radius; }
double RayScene::resolution_mm() const { return kResolution * impl_->radius; }

void RayScene::first_faces(const Eigen::Vector3d& origin, std::span<const Eigen::Vector3d> directions,
                           std::span<int> face) const {
  const Impl& impl = *impl_;
  const Eigen::Vector3f start = (impl.scale * (origin - impl.centre)).cast<float>();
  for (std::size_t first = 0; first < directions.size(); first += kPacket) {
    const std::size_t count = std::min<std::size_t>(kPacket, directions.size() - first);
    alignas(64) RTCRayHit16 packet;
    alignas(64) int valid[kPacket];
    for (std::size_t lane = 0; lane < kPacket; ++lane) {
      valid[lane] = lane < count ? -1 : 0;
      const Eigen::Vector3d& direction = directions[first + std::min(lane, count - 1)];
      packet.ray.org_x[lane] = start.x();
      packet.ray.org_y[lane] = start.y();
      packet.ray.org_z[lane] = start.z();
      packet.ray.dir_x[lane] = static_cast<float>(direction.x());
      packet.ray.dir_y[lane] = static_cast<float>(direction.y());
      packet.ray.dir_z[lane] = static_cast<float>(direction.z());
      packet.ray.tnear[lane] = 0.0F;
      packet.ray.tfar[lane] = std::numeric_limits<float>::infinity();
      packet.ray.time[lane] = 0.0F;
      packet.ray.mask[lane] = ~0U;
      packet.ray.id[lane] = static_cast<unsigned>(lane);
      packet.ray.flags[lane] = 0;
      packet.hit.geomID[lane] = RTC_INVALID_GEOMETRY_ID;
    }
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    rtcIntersect16(valid, impl.scene, &context, &packet);
    for (std::size_t lane = 0; lane < count; ++lane) {
      face[first + lane] =
          packet.hit.geomID[lane] == RTC_INVALID_GEOMETRY_ID ? -1 : impl.triangle_face[packet.hit.primID[lane]];
    }
  }
}

void RayScene::blocked(std::span<const Segment> segments, std::span<char> result) const {
  const Impl& impl = *impl_;
  for (std::size_t first = 0; first < segments.size(); first += kPacket) {
    const std::size_t count = std::min<std::size_t>(kPacket, segments.size() - first);
    alignas(64) RTCRay16 packet;
    alignas(64) int valid[kPacket];
    for (std::size_t lane = 0; lane < kPacket; ++lane) {
      valid[lane] = lane < count ? -1 : 0;
      const Segment& segment = segments[first + std::min(lane, count - 1)];
      const Eigen::Vector3d start = impl.scale * (segment.from - impl.centre);
      const Eigen::Vector3d along =
          segment.half_line ? segment.to : Eigen::Vector3d(impl.scale * (segment.to - segment.from));
      packet.org_x[lane] = static_cast<float>(start.x());
      packet.org_y[lane] = static_cast<float>(start.y());
      packet.org_z[lane] = static_cast<float>(start.z());
      packet.dir_x[lane] = static_cast<float>(along.x());
      packet.dir_y[lane] = static_cast<float>(along.y());
      packet.dir_z[lane] = static_cast<float>(along.z());
      // The ends lie on faces; most of the hits there need not be looked at by the filter, which is exact but slow.
      packet.tnear[lane] = segment.half_line ? 0.0F : kEnds;
      packet.tfar[lane] = segment.half_line ? std::numeric_limits<float>::infinity() : 1.0F - kEnds;
      packet.time[lane] = 0.0F;
      packet.mask[lane] = ~0U;
      packet.id[lane] = static_cast<unsigned>(first + std::min(lane, count - 1));
      packet.flags[lane] = 0;
    }
    QueryContext context;
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    context.segments = segments.data();
    rtcOccluded16(valid, impl.scene, &context, &packet);
    // Embree marks an occluded ray by a negative end.
    for (std::size_t lane = 0; lane < count; ++lane) result[first + lane] = packet.tfar[lane] < 0.0F ? 1 : 0;
  }
}

}  // namespace interglow::rendering
