// Scenes as triangle meshes.
#include "model/api/mesh.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <vector>

#include "model/api/cameras.h"
#include "model/api/device.h"
#include "model/api/scene.h"
#include "model/io/mesh/mesh_writer.h"
#include "model/render/mesh/scene_mesh.h"
#include "model/views/orbit.h"
#include "runtime/fail.h"

using namespace vsplat;
using namespace vsplat::api;

namespace {

constexpr Ring kAllAround[] = {{-90, 1}, {-70, 6}, {-35, 10}, {0, 14}, {35, 10}, {70, 6}, {90, 1}};
constexpr int kMeshPixels = 2048;  // pixels; mesh_of() scales them

std::optional<SceneMeshOptions::Cube> cube_of(const vsplat_scene_mesh_options& o, const Scene& scene) {
  if (!std::isfinite(o.scale) || o.scale < 0) fail(Status::usage, "options.scale is {}: 0 or more expected", o.scale);
  if ((o.has_center != 0) != (o.scale > 0))
    fail(Status::usage, "options.center and options.scale are given together, or neither of them");
  if (!o.has_center) return std::nullopt;
  const Eigen::Vector3d centre(o.center[0], o.center[1], o.center[2]);
  if (!centre.allFinite()) fail(Status::usage, "options.center is not finite");
  return SceneMeshOptions::Cube{centre - scene.offset, o.scale};
}

SceneMeshOptions options_of(const vsplat_scene_mesh_options& o, const Scene& scene) {
  SceneMeshOptions out;
  if (o.voxels < kFewestVoxels || o.voxels > kMostVoxels)
    fail(Status::usage, "options.voxels is {}: {} to {} expected", o.voxels, kFewestVoxels, kMostVoxels);
  if (!(o.least_part >= 0 && o.least_part <= 1))
    fail(Status::usage, "options.least_part is {}: 0 to 1 expected", o.least_part);
  const int depth = value_of(o.depth);
  if (depth != VSPLAT_SURFACE_MEDIAN && depth != VSPLAT_SURFACE_EXPECTED)
    fail(Status::usage, "options.depth is {}, not a value of vsplat_surface_depth", depth);
  need_structs(o.cameras, o.num_cameras, "options.cameras");
  if (o.cameras && !o.num_cameras) fail(Status::usage, "options.num_cameras is 0: at least one camera expected");
  out.voxels = o.voxels;
  out.max_triangles = static_cast<std::size_t>(o.max_triangles);
  out.least_part = o.least_part;
  out.depth = depth == VSPLAT_SURFACE_MEDIAN ? SurfaceDepth::median : SurfaceDepth::expected;
  out.cube = cube_of(o, scene);
  for (size_t i = 0; i < o.num_cameras; ++i)
    out.cameras.push_back(camera_of(element(o.cameras, i, "options.cameras"), "options.cameras"));
  return out;
}

const SurfaceMesh& surface_of(vsplat_mesh mesh) {
  const auto* out = std::get_if<SurfaceMesh>(&mesh->mesh);
  if (!out) fail(Status::usage, "mesh was not made from a scene");
  return *out;
}

}  // namespace

vsplat_status vsplat_mesh_from_scene(vsplat_device device, vsplat_scene scene, const vsplat_scene_mesh_options* options,
                                     vsplat_mesh* out_mesh) {
  return guarded([&] {
    const DeviceUse use(device);
    need(scene, "scene");
    need(out_mesh, "out_mesh");
    const vsplat_scene_mesh_options o = taken(options, VSPLAT_SCENE_MESH_OPTIONS_INIT, "options");
    const std::shared_ptr<const Scene> now = scene->now();
    SceneMeshOptions how = options_of(o, *now);
    if (now->gaussians.count == 0) fail(Status::input, "the scene has no Gaussians: there is nothing to mesh");
    if (how.cameras.empty()) {
      how.about = true;
      how.cameras = rings_about_scene(*now, kAllAround, kMeshPixels, kMeshPixels);
    }
    for (Camera& camera : how.cameras) camera = in_frame(*now, camera);
    how.begin = [&o](const char* stage, double done) {
      if (o.progress && !o.progress(o.user, stage, done)) fail(Status::cancelled, "the mesh was stopped");
    };
    SurfaceMesh made = retry_with_memory_freed(device, nullptr, [&] { return mesh_of(device->context, *now, how); });
    *out_mesh = std::make_unique<vsplat_mesh_impl>(std::move(made)).release();
  });
}

vsplat_status vsplat_mesh_save(vsplat_mesh mesh, const char* path) {
  return guarded([&] {
    need(mesh, "mesh");
    need(path, "path");
    write_mesh(path, surface_of(mesh));
  });
}

vsplat_status vsplat_mesh_get_arrays(vsplat_mesh mesh, const vsplat_mesh_arrays* arrays) {
  return guarded([&] {
    need(mesh, "mesh");
    need(arrays, "arrays");
    const vsplat_mesh_arrays to = taken(arrays, VSPLAT_MESH_ARRAYS_INIT, "arrays");
    const SurfaceMesh& from = surface_of(mesh);
    const std::size_t vertices = from.vertex_count(), triangles = from.triangle_count();
    if ((to.positions || to.normals || to.colours) && to.vertex_capacity < vertices)
      fail(Status::usage, "arrays.vertex_capacity is {}: the mesh has {} vertices", to.vertex_capacity, vertices);
    if (to.triangles && to.triangle_capacity < triangles)
      fail(Status::usage, "arrays.triangle_capacity is {}: the mesh has {} triangles", to.triangle_capacity, triangles);
    Outputs outputs;
    outputs.add(to.positions, 3 * sizeof(double) * vertices, "arrays.positions");
    outputs.add(to.normals, 3 * sizeof(float) * vertices, "arrays.normals");
    outputs.add(to.colours, 3 * sizeof(float) * vertices, "arrays.colours");
    outputs.add(to.triangles, 3 * sizeof(uint32_t) * triangles, "arrays.triangles");
    outputs.refuse_shared();
    for (std::size_t i = 0; to.positions && i < 3 * vertices; ++i)
      to.positions[i] = from.positions[i] + from.offset[static_cast<Eigen::Index>(i % 3)];
    if (to.normals) std::copy(from.normals.begin(), from.normals.end(), to.normals);
    if (to.colours) std::copy(from.colours.begin(), from.colours.end(), to.colours);
    if (to.triangles) std::copy(from.triangles.begin(), from.triangles.end(), to.triangles);
  });
}
