// Use with a program's own OpenCL.
#include "vsplat/opencl.h"

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "model/api/cameras.h"
#include "model/api/device.h"
#include "model/api/drawing.h"
#include "model/api/pixels.h"
#include "model/api/result_memory.h"
#include "model/api/scene.h"
#include "model/render/render_backward.h"
#include "runtime/fail.h"
#include "runtime/foreign.h"

using namespace vsplat;
using namespace vsplat::api;

namespace {

std::vector<void*> listed(cl_uint count, const cl_event* events) {
  need_array(events, count, "events");
  for (cl_uint i = 0; i < count; ++i)
    if (!events[i]) fail(Status::usage, "events[{}] is null", i);
  return {events, events + count};
}

void give_event(Context& ctx, cl_event* out) {
  if (out)
    *out = static_cast<cl_event>(ctx.mark());
  else
    ctx.flush();
}

// The buffers that a call writes, with the bytes that it writes there.
class BuffersOut {
 public:
  void add(cl_mem buffer, const Shape& shape, const char* name) {
    if (!buffer) return;
    const BufferPlace place = place_of(buffer);
    outputs_.add(place.whole, place.begin, bytes_of(shape), name);
    any_ = true;
  }
  bool any() const { return any_; }
  void refuse_shared() { outputs_.refuse_shared(); }
  void refuse_input(cl_mem buffer, const Shape& shape, const char* name) const {
    if (!buffer) return;
    const BufferPlace place = place_of(buffer);
    outputs_.refuse_input(place.whole, place.begin, bytes_of(shape), name);
  }

 private:
  static std::size_t bytes_of(const Shape& shape) {
    std::size_t out = sizeof(float);
    for (const long n : shape) out *= static_cast<std::size_t>(n);
    return out;
  }

  Outputs outputs_;
  bool any_ = false;
};

// A picture as bytes, in a caller's buffer or image.
class BytesOut {
 public:
  BytesOut(Context& ctx, const vsplat_opencl_picture& picture, const Camera& view)
      : image_(is_image(picture.rgba, "picture.rgba") ? picture.rgba : nullptr),
        width_(view.width),
        height_(view.height),
        premultiplied_(picture.premultiplied) {
    const std::size_t bytes = 4 * static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_);
    if (image_)
      check_image(ctx, image_, width_, height_, "picture.rgba");
    else
      buffer_ = Tensor(adopted(ctx, picture.rgba, bytes, true, "picture.rgba"), {height_, width_, 4}, Type::u8);
  }
  void write(Context& ctx, const DevicePicture& drawn, const std::array<float, 3>& background) const {
    const std::vector<float> colour = ctx.read<float>(drawn.colour), alpha = ctx.read<float>(drawn.alpha);
    std::vector<unsigned char> rgba(4 * alpha.size());
    vsplat_picture to = VSPLAT_PICTURE_INIT;
    to.data = rgba.data(), to.type = VSPLAT_PIXELS_U8, to.channels = 4, to.premultiplied = premultiplied_;
    const float behind[3] = {background[0], background[1], background[2]};
    CallersPixels(to, static_cast<int>(width_), static_cast<int>(height_), "picture.rgba")
        .write(colour.data(), alpha.data(), behind);
    if (image_)
      write_image(ctx, image_, width_, height_, rgba.data());
    else
      ctx.write(buffer_, rgba.data());
  }

 private:
  cl_mem image_;
  long width_, height_;
  int32_t premultiplied_;
  Tensor buffer_;
};

// Adopts the caller's buffer for reading; an empty tensor if it is null.
Tensor taken_from(Context& ctx, cl_mem buffer, const Shape& shape, const char* what) {
  return buffer ? ctx.adopt(buffer, shape, false, what) : Tensor();
}

// Adopts the caller's buffer for writing; a new tensor if it is null.
Tensor given_to(Context& ctx, cl_mem buffer, const Shape& shape, const char* what) {
  return buffer ? ctx.adopt(buffer, shape, true, what) : ctx.tensor(shape, Type::f32, what);
}

DeviceGaussians whole_on_device(vsplat_device device, const std::shared_ptr<const Scene>& scene, double pixels) {
  if (scene->gaussians.sh_degree > kDrawnDegree)
    fail(Status::usage, "the scene's spherical harmonics have degree {}: buffers hold those of up to {}",
         scene->gaussians.sh_degree, kDrawnDegree);
  const GaussianChunks& there = on_device(device, scene, pixels);
  if (there.chunks() > 1)
    fail(Status::memory, "the scene's {} Gaussians are not on the device as a whole, only in parts of {}", there.count,
         there.chunk);
  return there.get(device->context, 0);
}

Shape sh_shape(const Gaussians& g) { return {static_cast<long>(g.count), static_cast<long>(g.sh_count()), 3}; }

// Refuses gradient buffers that are written and share memory with each other or with those that are read.
void refuse_aliases(const vsplat_opencl_picture& by, const vsplat_opencl_gaussians& to, long h, long w,
                    const Gaussians& g) {
  const long n = static_cast<long>(g.count);
  BuffersOut outputs;
  outputs.add(to.means, {n, 3}, "out.means");
  outputs.add(to.scales, {n, scales_of(g.kind)}, "out.scales");
  outputs.add(to.rotations, {n, 4}, "out.rotations");
  outputs.add(to.opacities, {n}, "out.opacities");
  outputs.add(to.sh, sh_shape(g), "out.sh");
  if (!outputs.any()) fail(Status::usage, "out: every buffer is null: there is no gradient to compute");
  outputs.refuse_shared();
  outputs.refuse_input(by.colour, {h, w, 3}, "gradient.colour");
  outputs.refuse_input(by.alpha, {h, w}, "gradient.alpha");
  outputs.refuse_input(by.depth, {h, w}, "gradient.depth");
}

}  // namespace

vsplat_status vsplat_opencl_open(const vsplat_opencl_handles* theirs, const vsplat_device_options* options,
                                 vsplat_device* out_device) {
  return guarded([&] {
    need(theirs, "theirs");
    need(out_device, "out_device");
    refuse_after_fork();
    const vsplat_opencl_handles h = taken(theirs, VSPLAT_OPENCL_HANDLES_INIT, "theirs");
    need(h.context, "theirs.context");
    need(h.device, "theirs.device");
    ContextOptions how = context_options(options);
    how.theirs = {h.context, h.device, h.queue};
    *out_device = new vsplat_device_impl(std::make_unique<Context>(how));
  });
}

vsplat_status vsplat_opencl_get_handles(vsplat_device device, vsplat_opencl_handles* out_handles) {
  return guarded([&] {
    need(device, "device");
    const ForeignHandles ours = device->context.handles();
    vsplat_opencl_handles out = VSPLAT_OPENCL_HANDLES_INIT;
    out.context = static_cast<cl_context>(ours.context);
    out.device = static_cast<cl_device_id>(ours.device);
    out.queue = static_cast<cl_command_queue>(ours.queue);
    give(out_handles, out, "out_handles");
  });
}

vsplat_status vsplat_opencl_render(vsplat_device device, vsplat_scene scene, const vsplat_camera* camera,
                                   const vsplat_render_options* options, const vsplat_opencl_picture* picture,
                                   cl_uint num_events, const cl_event* events, cl_event* out_event) {
  return guarded([&] {
    const DeviceUse use(device);
    need(scene, "scene");
    need(camera, "camera");
    need(picture, "picture");
    const std::shared_ptr<const Scene> seen = scene->now();
    const Camera view = in_frame(*seen, camera_of(*camera, "camera"));
    const vsplat_opencl_picture p = taken(picture, VSPLAT_OPENCL_PICTURE_INIT, "picture");
    const RenderOptions how = drawn_as(taken(options, VSPLAT_RENDER_OPTIONS_INIT, "options"), *seen, view);
    const std::vector<void*> before = listed(num_events, events);
    Context& ctx = device->context;
    const GaussianChunks& there = on_device(device, seen, drawn_pixels(view, how));
    const long h = view.height, w = view.width;
    const DevicePicture out{given_to(ctx, p.colour, {h, w, 3}, "picture.colour"),
                            given_to(ctx, p.alpha, {h, w}, "picture.alpha"),
                            given_to(ctx, p.depth, {h, w}, "picture.depth")};
    BuffersOut outputs;
    outputs.add(p.colour, {h, w, 3}, "picture.colour");
    outputs.add(p.alpha, {h, w}, "picture.alpha");
    outputs.add(p.depth, {h, w}, "picture.depth");
    outputs.add(p.rgba, {h, w}, "picture.rgba");  // four bytes a pixel, the size of one float
    if (!outputs.any())
      fail(Status::usage, "picture: colour, alpha, depth and rgba are all null: there is nothing to draw into");
    std::optional<BytesOut> bytes;
    if (p.rgba) bytes.emplace(ctx, p, view);
    outputs.refuse_shared();
    ctx.wait_for(before);
    render_into(ctx, there, view, how, out);
    if (bytes) bytes->write(ctx, out, how.background);
    give_event(ctx, out_event);
  });
}

vsplat_status vsplat_opencl_render_backward(vsplat_device device, vsplat_scene scene, const vsplat_camera* camera,
                                            const vsplat_render_options* options, const vsplat_opencl_picture* gradient,
                                            const vsplat_opencl_gaussians* out, cl_uint num_events,
                                            const cl_event* events, cl_event* out_event) {
  return guarded([&] {
    const DeviceUse use(device);
    need(scene, "scene");
    need(camera, "camera");
    need(gradient, "gradient");
    need(out, "out");
    const std::shared_ptr<const Scene> seen = scene->now();
    const Camera view = in_frame(*seen, camera_of(*camera, "camera"));
    const vsplat_opencl_picture p = taken(gradient, VSPLAT_OPENCL_PICTURE_INIT, "gradient");
    const vsplat_opencl_gaussians o = taken(out, VSPLAT_OPENCL_GAUSSIANS_INIT, "out");
    const RenderOptions how = derived_as(taken(options, VSPLAT_RENDER_OPTIONS_INIT, "options"), *seen);
    const std::vector<void*> before = listed(num_events, events);
    Context& ctx = device->context;
    const Gaussians& g = seen->gaussians;
    const DeviceGaussians there = whole_on_device(device, seen, static_cast<double>(view.width) * view.height);
    const long h = view.height, w = view.width, n = static_cast<long>(g.count);
    const PictureGradient by{taken_from(ctx, p.colour, {h, w, 3}, "gradient.colour"),
                             taken_from(ctx, p.alpha, {h, w}, "gradient.alpha"),
                             taken_from(ctx, p.depth, {h, w}, "gradient.depth")};
    const GaussianGradients to{
        given_to(ctx, o.means, {n, 3}, "out.means"), given_to(ctx, o.scales, {n, scales_of(g.kind)}, "out.scales"),
        given_to(ctx, o.rotations, {n, 4}, "out.rotations"), given_to(ctx, o.opacities, {n}, "out.opacities"),
        given_to(ctx, o.sh, sh_shape(g), "out.sh")};
    refuse_aliases(p, o, h, w, g);
    ctx.wait_for(before);
    for (const Tensor& t : {to.means, to.scales, to.quats, to.opacities, to.sh}) ctx.fill_zero(t);
    render_backward(ctx, there, view, how, by, {to}, nullptr);
    give_event(ctx, out_event);
  });
}

vsplat_status vsplat_opencl_scene_create(vsplat_device device, const vsplat_scene_info* info,
                                         const vsplat_opencl_gaussians* buffers, cl_uint num_events,
                                         const cl_event* events, vsplat_scene* out_scene) {
  return guarded([&] {
    const DeviceUse use(device);
    need(info, "info");
    need(buffers, "buffers");
    need(out_scene, "out_scene");
    const vsplat_scene_info i = taken(info, VSPLAT_SCENE_INFO_INIT, "info");
    const vsplat_opencl_gaussians b = taken(buffers, VSPLAT_OPENCL_GAUSSIANS_INIT, "buffers");
    if (i.count > INT32_MAX) fail(Status::usage, "info.count is {}: at most {} Gaussians", i.count, INT32_MAX);
    if (i.sh_degree < 0 || i.sh_degree > 3) fail(Status::usage, "info.sh_degree is {}: 0 to 3 expected", i.sh_degree);
    Context& ctx = device->context;
    ctx.wait_for(listed(num_events, events));
    const long n = static_cast<long>(i.count), s = (i.sh_degree + 1L) * (i.sh_degree + 1);
    const auto values = [&](cl_mem buffer, const Shape& shape, const char* what) {
      if (n == 0) return std::vector<float>();
      need(buffer, what);
      return ctx.read<float>(ctx.adopt(buffer, shape, false, what));
    };
    std::vector<float> means = values(b.means, {n, 3}, "buffers.means"),
                       scales = values(b.scales, {n, 3}, "buffers.scales"),
                       rotations = values(b.rotations, {n, 4}, "buffers.rotations"),
                       opacities = values(b.opacities, {n}, "buffers.opacities"),
                       sh = values(b.sh, {n, s, 3}, "buffers.sh");
    vsplat_gaussians arrays = VSPLAT_GAUSSIANS_INIT;
    arrays.capacity = i.count;
    arrays.means = means.data(), arrays.scales = scales.data(), arrays.rotations = rotations.data();
    arrays.opacities = opacities.data(), arrays.sh = sh.data();
    const vsplat_status status = vsplat_scene_create(&i, &arrays, out_scene);
    if (status != VSPLAT_OK) throw Error(static_cast<Status>(status), vsplat_last_error());
  });
}

vsplat_status vsplat_opencl_scene_buffers(vsplat_device device, vsplat_scene scene,
                                          vsplat_opencl_gaussians* out_buffers) {
  return guarded([&] {
    const DeviceUse use(device);
    need(scene, "scene");
    require_output(out_buffers, "out_buffers");
    Context& ctx = device->context;
    const DeviceGaussians there = whole_on_device(device, scene->now(), 0);
    const auto buffer = [&](const Tensor& t) { return static_cast<cl_mem>(ctx.raw_buffer(t)); };
    vsplat_opencl_gaussians out = VSPLAT_OPENCL_GAUSSIANS_INIT;
    out.means = buffer(there.means);
    out.scales = buffer(there.scales);
    out.rotations = buffer(there.quats);
    out.opacities = buffer(there.opacities);
    out.sh = buffer(there.sh);
    give(out_buffers, out, "out_buffers");
  });
}

vsplat_status vsplat_opencl_scene_store(vsplat_device device, vsplat_scene scene) {
  return guarded([&] {
    const DeviceUse use(device);
    need(scene, "scene");
    const DeviceGaussians there = whole_on_device(device, scene->now(), 0);
    Gaussians g = download(device->context, there);
    std::vector<float> scales;  // three each, as in the C interface
    if (g.kind == GaussianKind::surfel)
      for (size_t k = 0; k < g.count; ++k) scales.insert(scales.end(), {g.scales[2 * k], g.scales[2 * k + 1], 0});
    vsplat_gaussians arrays = VSPLAT_GAUSSIANS_INIT;
    arrays.capacity = g.count;
    arrays.means = g.means.data(), arrays.rotations = g.quats.data(), arrays.opacities = g.opacities.data();
    arrays.scales = scales.empty() ? g.scales.data() : scales.data();
    arrays.sh = g.sh.data();
    const vsplat_status status = vsplat_scene_update(scene, &arrays);
    if (status != VSPLAT_OK) throw Error(static_cast<Status>(status), vsplat_last_error());
    device->scene_key = scene->now();  // the change is already on the device
  });
}
