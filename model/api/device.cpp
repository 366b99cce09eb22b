#include "model/api/device.h"

#include "runtime/fail.h"

using namespace vsplat;
using namespace vsplat::api;

namespace {

template <std::size_t size>
void copy_name(char (&out)[size], const std::string& text) {
  std::strncpy(out, text.c_str(), size - 1);
  out[size - 1] = '\0';
}

vsplat_device_info describe(const DeviceInfo& d) {
  vsplat_device_info out = VSPLAT_DEVICE_INFO_INIT;
  out.index = d.index;
  out.platform = d.platform;
  out.device = d.device;
  out.type = static_cast<vsplat_device_type>(d.type);
  copy_name(out.name, d.name);
  copy_name(out.vendor, d.vendor);
  copy_name(out.driver, d.driver);
  copy_name(out.version, d.version);
  copy_name(out.platform_name, d.platform_name);
  out.memory = d.memory;
  out.max_alloc = d.max_alloc;
  out.local_memory = d.local_memory;
  out.max_work_group = d.max_work_group;
  out.compute_units = d.compute_units;
  out.event_profiling = d.event_profiling;
  out.fp16 = d.fp16;
  out.fp64 = d.fp64;
  out.subgroups = d.subgroups;
  out.has_uuid = d.uuid.has_value();
  if (d.uuid) std::copy(d.uuid->begin(), d.uuid->end(), out.uuid);
  out.has_pci = d.pci.has_value();
  if (d.pci) out.pci_domain = d.pci->domain, out.pci_bus = d.pci->bus;
  if (d.pci) out.pci_device = d.pci->device, out.pci_function = d.pci->function;
  copy_name(out.limits, d.lowered);
  if (const auto verdict = remembered_verdict(d)) out.fitness = static_cast<int32_t>(verdict->fitness);
  return out;
}

const char* flavour_named(const vsplat_kernels& kernels) {
  switch (value_of(kernels)) {
    case VSPLAT_KERNELS_AUTO:
      return "auto";
    case VSPLAT_KERNELS_CPU:
      return "cpu";
    case VSPLAT_KERNELS_GPU:
      return "gpu";
  }
  fail(Status::usage, "options.kernels is {}, not a value of vsplat_kernels", value_of(kernels));
}

GemmChoice choice_of(const vsplat_gemm& gemm) {
  switch (value_of(gemm)) {
    case VSPLAT_GEMM_AUTO:
      return GemmChoice::auto_;
    case VSPLAT_GEMM_OWN:
      return GemmChoice::own;
    case VSPLAT_GEMM_CLBLAST:
      return GemmChoice::clblast;
  }
  fail(Status::usage, "options.gemm is {}, not a value of vsplat_gemm", value_of(gemm));
}

Precision precision_of(const vsplat_precision& precision) {
  switch (value_of(precision)) {
    case VSPLAT_PRECISION_FP32:
    case VSPLAT_PRECISION_AUTO:
      return Precision::fp32;
    case VSPLAT_PRECISION_MIXED:
      return Precision::mixed;
  }
  fail(Status::usage, "options.precision is {}, not a value of vsplat_precision", value_of(precision));
}

}  // namespace

DeviceUse::DeviceUse(vsplat_device device) : device_(device), of_job_(JobQueue::borrow(device)) {
  need(device, "device");
  JobQueue::watch_this_thread();
  if (of_job_) return;
  refuse_after_fork();
  if (device->in_use.test_and_set(std::memory_order_acquire))
    fail(
        Status::busy,
        "the device is in use by another call, either of another thread or the one whose callback makes this call; "
        "open a device or a stream (vsplat_stream_create) for each thread, and call after the other call has returned");
  device->context.go_on();  // clears a stop requested for an earlier call
}

DeviceUse::~DeviceUse() {
  if (of_job_)
    JobQueue::give_back(device_);
  else
    device_->in_use.clear(std::memory_order_release);
}

vsplat_status vsplat_device_count(size_t* out_count) {
  return guarded([&] {
    need(out_count, "out_count");
    *out_count = list_devices().size();
  });
}

vsplat_status vsplat_device_describe(size_t index, vsplat_device_info* out_info) {
  return guarded([&] {
    const std::vector<DeviceInfo> devices = list_devices();
    if (index >= devices.size()) fail(Status::device, "there is no device {}: {} in all", index, devices.size());
    give(out_info, describe(devices[index]), "out_info");
  });
}

ContextOptions vsplat::api::context_options(const vsplat_device_options* options) {
  const vsplat_device_options o = taken(options, VSPLAT_DEVICE_OPTIONS_INIT, "options");
  if (!(o.max_memory_gib >= 0)) fail(Status::usage, "options.max_memory_gib is {}", o.max_memory_gib);
  ContextOptions out;
  out.device = o.device ? o.device : "";
  out.kernels = flavour_named(o.kernels);
  out.gemm = choice_of(o.gemm);
  out.max_memory_gib = o.max_memory_gib;
  out.precision = precision_of(o.precision);
  out.mixed_if_as_good = o.precision == VSPLAT_PRECISION_AUTO;
  if (o.on_compile)
    out.on_compile = [call = o.on_compile, user = o.user](const std::string& kernel, int compiled) {
      call(user, kernel.c_str(), compiled);
    };
  return out;
}

vsplat_status vsplat_device_open(const vsplat_device_options* options, vsplat_device* out_device) {
  return guarded([&] {
    need(out_device, "out_device");
    JobQueue::watch_this_thread();
    *out_device = new vsplat_device_impl(std::make_unique<Context>(context_options(options)));
  });
}

vsplat_status vsplat_stream_create(vsplat_device device, vsplat_device* out_stream) {
  return guarded([&] {
    need(device, "device");
    need(out_stream, "out_stream");
    refuse_after_fork();
    *out_stream = new vsplat_device_impl(*device);
  });
}

vsplat_status vsplat_device_cancel(vsplat_device device) {
  // A signal handler may call this: it allocates nothing and takes no lock.
  if (!device) return guarded([&] { need(device, "device"); });
  device->context.cancel();
  return VSPLAT_OK;
}

vsplat_status vsplat_device_trim(vsplat_device device) {
  return guarded([&] {
    const DeviceUse use(device);
    device->scene.reset();
    device->scene_key.reset();
    device->residents->drop_idle();
    device->context.memory().trim();
  });
}

void vsplat_device_retain(vsplat_device device) { retain(device); }
void vsplat_device_release(vsplat_device device) {
  // (In a child of fork() a driver would wait for threads that do not exist there; the end of the process frees the
  // rest.)
  if (!is_forked()) release(device);
}

vsplat_status vsplat_device_get_info(vsplat_device device, vsplat_device_info* out_info) {
  return guarded([&] {
    need(device, "device");
    vsplat_device_info info = describe(device->context.device());
    info.kernels = static_cast<vsplat_kernels>(device->context.flavour());
    copy_name(info.tuning, device->context.tuning().hash());
    copy_name(info.switched_off, in_words(device->context.switched_off()));
    info.precision = static_cast<vsplat_precision>(device->context.precision());
    if (device->context.precision() == Precision::mixed)
      copy_name(info.matrix_unit, name_of(device->context.matrix_unit()));
    give(out_info, info, "out_info");
  });
}
