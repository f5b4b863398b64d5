// SPDX-License-Identifier: GPL-3.0-or-later
#include "cross_check/ray_scene.h"

#include <embree3/rtcore.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>

#include "diagnostics/error.h"

namespace interglow::cross_check {
namespace {

/// Faces that a query must not meet, carried behind the Embree context.
struct Query {
  RTCIntersectContext context;
  unsigned start_geometry, start_primitive;
  unsigned end_geometry, end_primitive;
};

/// Primitive 2f and 2f + 1 are the two halves of a quad, or 2f a triangle.
unsigned face_of(unsigned primitive) { return primitive / 2; }

void skip_own_faces(const RTCFilterFunctionNArguments* arguments) {
  const auto* query = reinterpret_cast<const Query*>(arguments->context);
  for (unsigned i = 0; i < arguments->N; ++i) {
    if (arguments->valid[i] != -1) continue;
    const unsigned geometry = RTCHitN_geomID(arguments->hit, arguments->N, i);
    const unsigned face = face_of(RTCHitN_primID(arguments->hit, arguments->N, i));
    if ((geometry == query->start_geometry && face == query->start_primitive) ||
        (geometry == query->end_geometry && face == query->end_primitive)) {
      arguments->valid[i] = 0;
    }
  }
}

}  // namespace

struct RayScene::Impl {
  RTCDevice device = nullptr;
  RTCScene embree_scene = nullptr;
  const scene::Scene* scene = nullptr;
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  double scale = 1.0;  ///< Embree coordinates = (x - center) × scale, within [-1, 1]

  Query query(FaceId start, FaceId end) const {
    Query query{};
    rtcInitIntersectContext(&query.context);
    query.context.filter = &skip_own_faces;
    query.start_geometry = static_cast<unsigned>(start.object);
    query.start_primitive = static_cast<unsigned>(start.face);
    query.end_geometry = static_cast<unsigned>(end.object);
    query.end_primitive = static_cast<unsigned>(end.face);
    return query;
  }

  RTCRay ray(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double distance) const {
    const Eigen::Vector3f from = ((origin - center) * scale).cast<float>();
    RTCRay ray{};
    ray.org_x = from.x();
    ray.org_y = from.y();
    ray.org_z = from.z();
    ray.dir_x = static_cast<float>(direction.x());
    ray.dir_y = static_cast<float>(direction.y());
    ray.dir_z = static_cast<float>(direction.z());
    ray.tnear = 0.0F;
    ray.tfar = static_cast<float>(distance * scale);
    ray.mask = ~0U;
    return ray;
  }
};

RayScene::RayScene(const scene::Scene& scene) : impl_(std::make_unique<Impl>()) {
  impl_->scene = &scene;
  Eigen::AlignedBox3d box;
  for (const scene::Object& object : scene.objects) {
    for (const Eigen::Vector3d& point : object.patches.points) box.extend(point);
  }
  impl_->center = box.center();
  impl_->scale = 2.0 / std::max(box.diagonal().norm(), std::numeric_limits<double>::min());
  impl_->device = rtcNewDevice(nullptr);
  impl_->embree_scene = rtcNewScene(impl_->device);
  rtcSetSceneFlags(impl_->embree_scene,
                   static_cast<RTCSceneFlags>(RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION));
  rtcSetSceneBuildQuality(impl_->embree_scene, RTC_BUILD_QUALITY_HIGH);
  for (std::size_t o = 0; o < scene.objects.size(); ++o) {
    const mesh::PatchMesh& mesh = scene.objects[o].patches;
    RTCGeometry geometry = rtcNewGeometry(impl_->device, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                                 3 * sizeof(float), mesh.points.size()));
    auto* indices = static_cast<unsigned*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                                   3 * sizeof(unsigned), 2 * mesh.faces.size()));
    if (vertices == nullptr || indices == nullptr)
      throw NumericalFailure("path tracer: no memory for the ray-tracing scene.");
    for (const Eigen::Vector3d& point : mesh.points) {
      const Eigen::Vector3f scaled = ((point - impl_->center) * impl_->scale).cast<float>();
      vertices = std::copy(scaled.data(), scaled.data() + 3, vertices);
    }
    for (const mesh::Face& face : mesh.faces) {
      // The second half of a triangle is empty: one point three times.
      const int last = mesh::corner_count(face) == 4 ? face[3] : face[0];
      const int middle = mesh::corner_count(face) == 4 ? face[2] : face[0];
      for (const int corner : {face[0], face[1], face[2], face[0], middle, last})
        *indices++ = static_cast<unsigned>(corner);
    }
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(impl_->embree_scene, geometry, static_cast<unsigned>(o));
    rtcReleaseGeometry(geometry);
  }
  rtcCommitScene(impl_->embree_scene);
}

RayScene::~RayScene() {
  rtcReleaseScene(impl_->embree_scene);
  rtcReleaseDevice(impl_->device);
}

std::optional<Hit> RayScene::first_hit(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                                       FaceId start) const {
  Query query = impl_->query(start, {});
  RTCRayHit ray_hit{};
  ray_hit.ray = impl_->ray(origin, direction, std::numeric_limits<double>::infinity());
  ray_hit.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(impl_->embree_scene, &query.context, &ray_hit);
  if (ray_hit.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;
  Hit hit;
  hit.object = static_cast<int>(ray_hit.hit.geomID);
  hit.face = static_cast<int>(face_of(ray_hit.hit.primID));
  const mesh::PatchMesh& mesh = impl_->scene->objects[ray_hit.hit.geomID].patches;
  const mesh::Face& face = mesh.faces[static_cast<std::size_t>(hit.face)];
  const auto corner = [&](std::size_t k) -> const Eigen::Vector3d& {
    return mesh.points[static_cast<std::size_t>(face[k])];
  };
  const bool second_half = ray_hit.hit.primID % 2 == 1;
  const Eigen::Vector3d& b = corner(second_half ? 2 : 1);
  const Eigen::Vector3d& c = corner(second_half ? 3 : 2);
  const double u = ray_hit.hit.u;
  const double v = ray_hit.hit.v;
  hit.point = (1.0 - u - v) * corner(0) + u * b + v * c;
  hit.normal = mesh::vector_area(mesh, face).normalized();
  hit.back = hit.normal.dot(direction) > 0.0;
  if (hit.back) hit.normal = -hit.normal;
  return hit;
}

bool RayScene::is_clear(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double distance, FaceId start,
                        FaceId end) const {
  Query query = impl_->query(start, end);
  RTCRay ray = impl_->ray(origin, direction, distance);
  rtcOccluded1(impl_->embree_scene, &query.context, &ray);
  return ray.tfar >= 0.0F;
}

}  // namespace interglow::cross_check
