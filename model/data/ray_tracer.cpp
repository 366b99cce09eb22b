#include "model/data/ray_tracer.h"

#include <embree3/rtcore.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <thread>

#include "model/io/image_file.h"
#include "runtime/fail.h"

namespace vsplat {

struct RayTracer::Scene {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  ~Scene() {
    if (scene) rtcReleaseScene(scene);
    if (device) rtcReleaseDevice(device);
  }
};

namespace {

using Eigen::Vector3f;

void check(RTCDevice device, const Mesh& mesh) {
  const RTCError error = rtcGetDeviceError(device);
  if (error == RTC_ERROR_OUT_OF_MEMORY)
    fail(Status::memory, "{}: not enough memory to trace rays through {} triangles", mesh.name, mesh.triangles());
  if (error != RTC_ERROR_NONE) fail(Status::internal, "{}: Embree's error {}", mesh.name, static_cast<int>(error));
}

// What a surface turned towards `normal` sends back of white light. At most 1.
float light(const Vector3f& normal) {
  static const Vector3f side = Vector3f(0.36f, 0.80f, 0.48f).normalized();
  return 0.48f + 0.12f * normal.y() + 0.4f * std::max(0.0f, normal.dot(side));
}

struct Hit {
  bool any = false;
  Vector3f colour = Vector3f::Zero();  // linear
};

Eigen::Vector2f texture_place(const Mesh& mesh, unsigned triangle, float u, float v) {
  const Corner* c = &mesh.corners[3 * static_cast<std::size_t>(triangle)];
  return (1 - u - v) * c[0].uv + u * c[1].uv + v * c[2].uv;
}

// Embree asks of each triangle that a ray meets whether it counts.
void pass_through_holes(const RTCFilterFunctionNArguments* args) {
  const Mesh& mesh = *static_cast<const Mesh*>(args->geometryUserPtr);
  for (unsigned i = 0; i < args->N; ++i) {
    const unsigned triangle = RTCHitN_primID(args->hit, args->N, i);
    const Material& material = mesh.palette[mesh.materials[triangle]];
    if (args->valid[i] == 0 || !(material.cutoff > 0)) continue;
    float alpha = material.alpha;
    if (material.texture)
      alpha *= sample_alpha(*material.texture, texture_place(mesh, triangle, RTCHitN_u(args->hit, args->N, i),
                                                             RTCHitN_v(args->hit, args->N, i)));
    if (alpha < material.cutoff) args->valid[i] = 0;
  }
}

// The surface that the ray met, in linear light.
Vector3f shaded(const Mesh& mesh, const RTCRayHit& ray) {
  const std::size_t triangle = ray.hit.primID;
  const Corner* c = &mesh.corners[3 * triangle];
  const float u = ray.hit.u, v = ray.hit.v, w = 1 - u - v;
  const Material& material = mesh.palette[mesh.materials[triangle]];
  Vector3f colour = material.colour.cwiseProduct(w * c[0].colour + u * c[1].colour + v * c[2].colour);
  if (material.texture)
    colour = colour.cwiseProduct(sample(*material.texture, texture_place(mesh, ray.hit.primID, u, v)));
  const Vector3f direction(ray.ray.dir_x, ray.ray.dir_y, ray.ray.dir_z);
  Vector3f face(ray.hit.Ng_x, ray.hit.Ng_y, ray.hit.Ng_z);
  if (face.dot(direction) > 0) face = -face;  // the side that is seen, whichever way the triangle is wound
  Vector3f normal = w * c[0].normal + u * c[1].normal + v * c[2].normal;
  if (!(normal.norm() > 1e-6f)) normal = face;
  if (normal.dot(face) < 0) normal = -normal;
  const float length = normal.norm();
  return light(length > 0 ? Vector3f(normal / length) : Vector3f(Vector3f::UnitY())) * colour;
}

Hit traced(RTCScene scene, const Mesh& mesh, const Vector3f& eye, const Vector3f& direction) {
  RTCRayHit ray{};
  ray.ray.org_x = eye.x(), ray.ray.org_y = eye.y(), ray.ray.org_z = eye.z();
  ray.ray.dir_x = direction.x(), ray.ray.dir_y = direction.y(), ray.ray.dir_z = direction.z();
  ray.ray.tfar = std::numeric_limits<float>::infinity();
  ray.ray.mask = ~0u;
  ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcIntersect1(scene, &context, &ray);
  if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) return {};
  return {true, shaded(mesh, ray)};
}

}  // namespace

RayTracer::RayTracer(const Mesh& mesh) : scene_(std::make_unique<Scene>()), mesh_(mesh) {
  if (mesh.triangles() > std::numeric_limits<unsigned>::max() / 3)
    fail(Status::input, "{}: {} triangles are more than can be drawn", mesh.name, mesh.triangles());
  scene_->device = rtcNewDevice("threads=1");  // of building; every thread may trace
  if (!scene_->device)
    fail(Status::internal, "Embree does not start: error {}", static_cast<int>(rtcGetDeviceError(nullptr)));
  const RTCDevice device = scene_->device;
  scene_->scene = rtcNewScene(device);
  rtcSetSceneFlags(scene_->scene, RTC_SCENE_FLAG_ROBUST);  // no ray slips through an edge
  const RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* positions = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                                3 * sizeof(float), mesh.corners.size()));
  auto* indices = static_cast<unsigned*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                                 3 * sizeof(unsigned), mesh.triangles()));
  if (positions && indices)
    for (std::size_t i = 0; i < mesh.corners.size(); ++i) {
      std::copy_n(mesh.corners[i].position.data(), 3, positions + 3 * i);
      indices[i] = static_cast<unsigned>(i);
    }
  if (std::any_of(mesh.palette.begin(), mesh.palette.end(), [](const Material& m) { return m.cutoff > 0; })) {
    rtcSetGeometryUserData(geometry, const_cast<Mesh*>(&mesh_));
    rtcSetGeometryIntersectFilterFunction(geometry, pass_through_holes);
  }
  if (positions && indices) rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene_->scene, geometry);
  rtcReleaseGeometry(geometry);
  check(device, mesh);
  rtcCommitScene(scene_->scene);
  check(device, mesh);
}

RayTracer::~RayTracer() = default;

Image RayTracer::picture(const Camera& camera, int samples, unsigned threads) const {
  Image out(camera.width, camera.height, 4);
  const Eigen::Matrix4d c2w = camera.c2w();
  const Vector3f eye = camera.centre().cast<float>();
  const auto pixel = [&](int x, int y) {
    Vector3f sum = Vector3f::Zero();
    int hits = 0;
    for (int i = 0; i < samples * samples; ++i) {
      const int row = i / samples, column = i % samples;
      const double across = x + (column + 0.5) / samples, down = y + (row + 0.5) / samples;
      const Eigen::Vector3d ray((across - camera.cx) / camera.fx, (down - camera.cy) / camera.fy, 1.0);
      const Vector3f direction = (c2w.topLeftCorner<3, 3>() * ray).cast<float>();
      const Hit hit = traced(scene_->scene, mesh_, eye, direction);
      if (!hit.any) continue;
      sum += hit.colour;
      ++hits;
    }
    if (hits == 0) return;
    float* to = out.at(x, y);
    for (int c = 0; c < 3; ++c) to[c] = srgb_encode(sum[c] / static_cast<float>(hits));
    to[3] = static_cast<float>(hits) / static_cast<float>(samples * samples);
  };
  std::atomic<int> next{0};
  const auto rows = [&] {
    for (int y = next++; y < camera.height; y = next++)
      for (int x = 0; x < camera.width; ++x) pixel(x, y);
  };
  std::vector<std::jthread> others;
  if (threads == 0) threads = std::clamp(std::thread::hardware_concurrency(), 1u, 64u);
  for (unsigned i = 1; i < threads; ++i) others.emplace_back(rows);
  rows();
  others.clear();  // joins
  return out;
}

}  // namespace vsplat
