#include "model/data/rays_module.h"

#if VSPLAT_EMBREE == 3
#include <embree3/rtcore.h>
#else
#include <embree4/rtcore.h>
#endif

#include <algorithm>
#include <cstring>
#include <limits>
#include <memory>

namespace {

using vsplat::RayHit;
using vsplat::RayTriangles;

struct Scene {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  RayTriangles triangles{};
  ~Scene() {
    if (scene) rtcReleaseScene(scene);
    if (device) rtcReleaseDevice(device);
  }
};

// Embree calls this for each triangle that a ray meets, to decide whether it counts.
void filter(const RTCFilterFunctionNArguments* args) {
  const auto& of = *static_cast<const RayTriangles*>(args->geometryUserPtr);
  for (unsigned i = 0; i < args->N; ++i)
    if (args->valid[i] != 0 && of.passes(of.user, RTCHitN_primID(args->hit, args->N, i),
                                         RTCHitN_u(args->hit, args->N, i), RTCHitN_v(args->hit, args->N, i)))
      args->valid[i] = 0;
}

int code_of(RTCError code, int* error) {
  *error = static_cast<int>(code);
  return code == RTC_ERROR_NONE ? 0 : code == RTC_ERROR_OUT_OF_MEMORY ? 1 : 2;
}

int open(const RayTriangles* triangles, void** out, int* error) {
  auto made = std::make_unique<Scene>();
  made->triangles = *triangles;
  made->device = rtcNewDevice("threads=1");  // for building; any thread may trace
  if (!made->device) return std::max(1, code_of(rtcGetDeviceError(nullptr), error));
  made->scene = rtcNewScene(made->device);
  rtcSetSceneFlags(made->scene, RTC_SCENE_FLAG_ROBUST);  // no ray slips through an edge
  const RTCGeometry geometry = rtcNewGeometry(made->device, RTC_GEOMETRY_TYPE_TRIANGLE);
  const std::size_t count = triangles->count;
  auto* positions = static_cast<float*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), 3 * count));
  auto* indices = static_cast<unsigned*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(unsigned), count));
  if (positions && indices) {
    const auto* from = reinterpret_cast<const unsigned char*>(triangles->corners);
    for (std::size_t i = 0; i < 3 * count; ++i) {
      std::memcpy(positions + 3 * i, from + i * triangles->stride, 3 * sizeof(float));
      indices[i] = static_cast<unsigned>(i);
    }
    if (triangles->passes) {
      rtcSetGeometryUserData(geometry, &made->triangles);
      rtcSetGeometryIntersectFilterFunction(geometry, filter);
    }
    rtcCommitGeometry(geometry);
  }
  rtcAttachGeometry(made->scene, geometry);
  rtcReleaseGeometry(geometry);
  int code = code_of(rtcGetDeviceError(made->device), error);
  if (code == 0) {
    rtcCommitScene(made->scene);
    code = code_of(rtcGetDeviceError(made->device), error);
  }
  if (code == 0) *out = made.release();
  return code;
}

void close(void* scene) { delete static_cast<Scene*>(scene); }

bool trace(void* scene, const float* origin, const float* direction, RayHit* hit) {
  RTCRayHit ray{};
  ray.ray.org_x = origin[0], ray.ray.org_y = origin[1], ray.ray.org_z = origin[2];
  ray.ray.dir_x = direction[0], ray.ray.dir_y = direction[1], ray.ray.dir_z = direction[2];
  ray.ray.tfar = std::numeric_limits<float>::infinity();
  ray.ray.mask = ~0u;
  ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
#if VSPLAT_EMBREE == 3
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcIntersect1(static_cast<Scene*>(scene)->scene, &context, &ray);
#else
  rtcIntersect1(static_cast<Scene*>(scene)->scene, &ray);
#endif
  if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) return false;
  *hit = {ray.hit.primID, ray.hit.u, ray.hit.v, {ray.hit.Ng_x, ray.hit.Ng_y, ray.hit.Ng_z}};
  return true;
}

}  // namespace

extern "C" __attribute__((visibility("default"))) const vsplat::RayFunctions* vsplat_rays(const char* version) {
  static constexpr vsplat::RayFunctions functions{open, close, trace};
  return std::strcmp(version, VSPLAT_VERSION) == 0 ? &functions : nullptr;
}
