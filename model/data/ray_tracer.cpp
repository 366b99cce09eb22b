#include "model/data/ray_tracer.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <mutex>
#include <thread>

#include "model/data/rays_module.h"
#include "model/io/picture/image_file.h"
#include "runtime/fail.h"
#include "runtime/library_programs.h"
#include "runtime/system/system.h"

namespace vsplat {

namespace {

using Eigen::Vector3f;

std::string& named_module() {
  static std::string path;
  return path;
}

const RayFunctions* loaded() {
  const std::string path = named_module().empty() ? library_program("vsplat-rays.so") : named_module();
  std::string why = "the library's own path is unknown";
  void* module = path.empty() ? nullptr : sys::load_library(path, sys::Symbols::own, why);
  if (!module)
    fail(Status::internal,
         "vsplat-rays.so, which draws meshes and random objects, cannot be loaded. It is installed beside the library "
         "(package libvsplat{}-data): {}",
         VSPLAT_SOVERSION, why.empty() ? path : why);
  auto* functions = reinterpret_cast<RayModule*>(sys::symbol(module, "vsplat_rays"));
  if (const RayFunctions* found = functions ? functions(VSPLAT_VERSION) : nullptr) return found;
  fail(Status::internal, "{} does not belong to vsplat {}, whose library loads it", path, VSPLAT_VERSION);
}

// The module is loaded once and never unloaded.
const RayFunctions& rays() {
  static std::mutex one;
  static const RayFunctions* found = nullptr;
  const std::lock_guard<std::mutex> lock(one);
  if (!found) found = loaded();
  return *found;
}

// The reflected share of white light for a surface with this normal; at most 1.
float light(const Vector3f& normal) {
  static const Vector3f side = Vector3f(0.36f, 0.80f, 0.48f).normalized();
  return 0.48f + 0.12f * normal.y() + 0.4f * std::max(0.0f, normal.dot(side));
}

Eigen::Vector2f texture_place(const Mesh& mesh, std::size_t triangle, Eigen::Vector2f Corner::*uv, float u, float v) {
  const Corner* c = &mesh.corners[3 * triangle];
  return (1 - u - v) * c[0].*uv + u * c[1].*uv + v * c[2].*uv;
}

bool passes(const void* user, unsigned triangle, float u, float v) {
  const Mesh& mesh = *static_cast<const Mesh*>(user);
  const Material& material = mesh.palette[mesh.materials[triangle]];
  if (!(material.cutoff > 0)) return false;
  float alpha = material.alpha;
  const Corner* c = &mesh.corners[3 * static_cast<std::size_t>(triangle)];
  alpha *= (1 - u - v) * c[0].alpha + u * c[1].alpha + v * c[2].alpha;
  if (material.texture)
    alpha *= sample_alpha(*material.texture, texture_place(mesh, triangle, &Corner::uv, u, v), material.sampling);
  return alpha < material.cutoff;
}

// Colour of the hit surface in linear light.
Vector3f shaded(const Mesh& mesh, const RayHit& hit, const Vector3f& direction) {
  const std::size_t triangle = hit.triangle;
  const Corner* c = &mesh.corners[3 * triangle];
  const float u = hit.u, v = hit.v, w = 1 - u - v;
  const Material& material = mesh.palette[mesh.materials[triangle]];
  Vector3f colour = material.colour.cwiseProduct(w * c[0].colour + u * c[1].colour + v * c[2].colour);
  if (material.texture)
    colour = colour.cwiseProduct(
        sample(*material.texture, texture_place(mesh, triangle, &Corner::uv, u, v), material.sampling));
  Vector3f emission = material.emission;
  if (material.emission_texture)
    emission = emission.cwiseProduct(sample(*material.emission_texture,
                                            texture_place(mesh, triangle, &Corner::emission_uv, u, v),
                                            material.emission_sampling));
  Vector3f face(hit.normal[0], hit.normal[1], hit.normal[2]);
  if (face.dot(direction) > 0) face = -face;  // the visible side, regardless of the triangle's winding
  Vector3f normal = w * c[0].normal + u * c[1].normal + v * c[2].normal;
  if (!(normal.norm() > 1e-6f)) normal = face;
  if (normal.dot(face) < 0) normal = -normal;
  const float length = normal.norm();
  return light(length > 0 ? Vector3f(normal / length) : Vector3f(Vector3f::UnitY())) * colour + emission;
}

}  // namespace

void set_rays_module(const std::string& path) { named_module() = path; }

void RayTracer::Close::operator()(void* scene) const { rays().close(scene); }

RayTracer::RayTracer(const Mesh& mesh) : mesh_(mesh) {
  if (mesh.triangles() > std::numeric_limits<unsigned>::max() / 3)
    fail(Status::input, "{}: {} triangles are more than can be drawn", mesh.name, mesh.triangles());
  const bool holes =
      std::any_of(mesh.palette.begin(), mesh.palette.end(), [](const Material& m) { return m.cutoff > 0; });
  const float* first = mesh.corners.empty() ? nullptr : mesh.corners[0].position.data();
  const RayTriangles triangles{first, sizeof(Corner), mesh.triangles(), holes ? passes : nullptr, &mesh_};
  void* scene = nullptr;
  int error = 0;
  const int code = rays().open(&triangles, &scene, &error);
  if (code == 1)
    fail(Status::memory, "{}: not enough memory to trace rays through {} triangles", mesh.name, mesh.triangles());
  if (code != 0) fail(Status::internal, "{}: Embree's error {}", mesh.name, error);
  scene_.reset(scene);
}

Image RayTracer::picture(const Camera& camera, int samples, unsigned threads) const {
  Image out(camera.width, camera.height, 4);
  const Eigen::Matrix4d c2w = camera.c2w();
  const Vector3f eye = camera.centre().cast<float>();
  const auto trace = rays().trace;
  const auto pixel = [&](int x, int y) {
    Vector3f sum = Vector3f::Zero();
    int hits = 0;
    for (int i = 0; i < samples * samples; ++i) {
      const int row = i / samples, column = i % samples;
      const double across = x + (column + 0.5) / samples, down = y + (row + 0.5) / samples;
      const Eigen::Vector3d ray((across - camera.cx) / camera.fx, (down - camera.cy) / camera.fy, 1.0);
      const Vector3f direction = (c2w.topLeftCorner<3, 3>() * ray).cast<float>();
      RayHit hit;
      if (!trace(scene_.get(), eye.data(), direction.data(), &hit)) continue;
      sum += shaded(mesh_, hit, direction);
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
