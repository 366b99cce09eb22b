#include "runtime/context.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <atomic>
#include <climits>
#include <cstdlib>
#include <map>
#include <optional>

#include "runtime/clock.h"
#include "runtime/device_handles.h"
#include "runtime/device_limits.h"
#include "runtime/device_memory.h"
#include "runtime/fail.h"
#include "runtime/foreign.h"
#include "runtime/host_span.h"
#include "runtime/launch_arguments.h"
#include "runtime/launch_checks.h"
#include "runtime/launch_parts.h"
#include "runtime/log.h"
#include "runtime/option.h"
#include "runtime/pace.h"
#include "runtime/profile/counters.h"
#include "runtime/profile/profiler.h"
#include "runtime/program.h"
#include "runtime/rounding.h"
#include "runtime/system/environment.h"
#include "runtime/system/host_memory.h"
#include "runtime/tuning/matrix_probe.h"

namespace vsplat {

const char* name_of(Flavour flavour) { return flavour == Flavour::cpu ? "cpu" : "gpu"; }
const char* name_of(Precision precision) { return precision == Precision::fp32 ? "fp32" : "mixed"; }
const char* name_of(MatrixUnit unit) {
  constexpr std::array<const char*, kMatrixUnits.size()> names = {"emulated", "ptx", "dpas", "wmma", "mfma"};
  return names.at(static_cast<std::size_t>(unit));
}

namespace {

// A flavour that was requested by name is used or refused, whatever the default would be.
Flavour asked_for(Flavour flavour, const SwitchedOff& off) {
  if (flavour == Flavour::cpu ? off.cpu : off.gpu)
    fail(Status::device,
         "the {} kernels were asked for by name, and a self-test has found them wrong on this device and driver: leave "
         "the choice to the program, or set VSPLAT_SELFTEST=ignore to use them all the same",
         name_of(flavour));
  return flavour;
}

// Only the gpu kernels support mixed precision.
Flavour flavour_of_mixed(const std::string& name, const DeviceInfo& device, const SwitchedOff& off) {
  if (name == "cpu")
    fail(
        Status::usage,
        "mixed precision and the cpu kernels were asked for, and only the gpu kernels multiply in mixed precision: ask "
        "for those, or leave the choice to the program ({}, VSPLAT_KERNELS), or take fp32",
        Option::kernels);
  if (off.gpu)
    fail(
        Status::device,
        "mixed precision wants the gpu kernels, and a self-test has found them wrong on {} with this driver: take fp32 "
        "as {}",
        device.name, Option::precision);
  return Flavour::gpu;
}

Flavour choose_flavour(const std::string& asked, const DeviceInfo& device, const SwitchedOff& off,
                       Precision precision) {
  std::string name = asked;
  if (name.empty() || name == "auto") {
    const char* env = std::getenv("VSPLAT_KERNELS");
    name = env && *env ? env : "auto";
  }
  if (precision == Precision::mixed && (name == "auto" || name == "cpu")) return flavour_of_mixed(name, device, off);
  if (name == "cpu") return asked_for(Flavour::cpu, off);
  if (name == "gpu") return asked_for(Flavour::gpu, off);
  if (name != "auto")
    fail(Status::usage, "kernels are auto, cpu or gpu, not \"{}\" ({}, VSPLAT_KERNELS)", name, Option::kernels);
  if (off.cpu || off.gpu) return off.cpu ? Flavour::gpu : Flavour::cpu;
  // Tiling through local memory pays off only if that is dedicated memory.
  return device.type != DeviceType::cpu && device.local_is_fast ? Flavour::gpu
         : device.type == DeviceType::gpu                       ? Flavour::gpu
                                                                : Flavour::cpu;
}

ArenaLimits limits_of(const DeviceInfo& device, double max_memory_gib) {
  ArenaLimits limits;
  limits.align = static_cast<std::size_t>(device.align);
  constexpr double most_gib = 1ull << 32;  // more than any device has; sums of sizes stay within 64 bits
  if (max_memory_gib > 0)
    limits.total = static_cast<std::size_t>(std::min(max_memory_gib, most_gib) * (1ull << 30));
  else if (device.type == DeviceType::cpu)  // a CPU device uses the host's memory
    limits.total = std::min<std::size_t>(device.memory, host_memory_limit());
  else
    limits.total = device.memory;
  if (device.address_bits < 64)
    limits.total = std::min(limits.total, (std::size_t{1} << device.address_bits) - limits.align);
  limits.max_alloc = std::min<std::size_t>(device.max_alloc, limits.total);
  limits.on_host = device.type == DeviceType::cpu;
  if (guard_is_wanted()) limits.guard = round_up<std::size_t>(256, limits.align);
  return limits;
}

// A kernel, and the work-group sizes that it was launched with.
struct Built {
  cl::Kernel kernel;
  KernelLimits limits;
  std::vector<std::array<std::size_t, 4>> groups;

  // Whether this is the first launch with that group size, or with that size and an offset: some drivers compile again
  // for each.
  bool first(const std::array<std::size_t, 3>& local, const std::array<std::size_t, 3>& offset) {
    const std::size_t moved = offset == std::array<std::size_t, 3>{} ? 0 : 1;
    const std::array<std::size_t, 4> key{local[0], local[1], local[2], moved};
    if (std::find(groups.begin(), groups.end(), key) != groups.end()) return false;
    groups.push_back(key);
    return true;
  }
};

}  // namespace

struct Context::Impl {
  DeviceInfo info;
  Flavour flavour = Flavour::cpu;
  GemmChoice gemm = GemmChoice::auto_;
  Precision precision = Precision::fp32;
  MatrixUnit matrix_unit = MatrixUnit::emulated;
  SwitchedOff off;
  bool planning = false;
  NotedKernels* collected = nullptr;  // where launched kernels are noted
  NotedShapes* shapes = nullptr;      // in a planner: where shapes are noted
  std::shared_ptr<const Tuning> tuning;
  bool checks_nan = false, guards = false;  // see launch_checks.h
  cl::Context context;
  cl::Device handle;
  cl::CommandQueue queue;
  std::shared_ptr<ProgramCache> programs;
  std::map<std::string, Built> kernels;
  std::shared_ptr<std::atomic<bool>> cancelled = std::make_shared<std::atomic<bool>>(false);
  int uncancelled = 0;  // see Uncancelled
  Pace pace;
  Profiler profiler{[this] { return energy_sources(); }};
  Counters counters;
  std::unique_ptr<Arena> arena;  // destroyed before the OpenCL context, since it holds the buffers: see ~Context
  std::string stage;
  std::vector<StageMemory> stage_memory;
  std::optional<double> fill_seconds;  // see event_times()

  // Sets what depends on the device and the limits; creates a queue if there is none yet.
  void open(const ArenaLimits& limits) {
    if (!queue()) make_queue();
    checks_nan = nan_check_is_wanted();
    guards = limits.guard > 0;
    arena = std::make_unique<Arena>(&context, limits, &queue);
  }

  // Energy counters of the processor, and of an NVIDIA GPU, whose driver reports its place on the PCI bus.
  std::vector<EnergySource> energy_sources() const {
    std::vector<EnergySource> out = rapl_sources();
    constexpr cl_device_info bus = 0x4008, slot = 0x4009, domain = 0x400A;  // cl_nv_device_attribute_query
    cl_uint at[3] = {};
    const bool told = info.type == DeviceType::gpu && info.vendor.find("NVIDIA") != std::string::npos &&
                      clGetDeviceInfo(handle(), domain, sizeof at[0], &at[0], nullptr) == CL_SUCCESS &&
                      clGetDeviceInfo(handle(), bus, sizeof at[1], &at[1], nullptr) == CL_SUCCESS &&
                      clGetDeviceInfo(handle(), slot, sizeof at[2], &at[2], nullptr) == CL_SUCCESS;
    if (told)  // (the upper five bits of the slot are the device number)
      for (EnergySource& source : nvml_sources(fmt::format("{:08x}:{:02x}:{:02x}.0", at[0], at[1], at[2] >> 3 & 31)))
        out.push_back(std::move(source));
    return out;
  }

  void make_queue() {
    try {
      const cl_command_queue_properties properties = info.event_profiling ? CL_QUEUE_PROFILING_ENABLE : 0;
      queue = cl::CommandQueue(context, handle, properties);
    } catch (const cl::Error& e) {
      fail_cl(e, "opening " + info.name);
    }
  }

  void take(const ForeignHandles& theirs);
  void leave_out(const std::vector<std::string>& refused);

  void stop_if_cancelled() const {
    if (uncancelled == 0 && cancelled->load(std::memory_order_relaxed))
      fail(Status::cancelled, "stopped on request{}", stage.empty() ? "" : " in stage " + stage);
  }

  // Records the peaks of reserved and used memory of the current stage.
  void note_stage_memory() {
    auto it =
        std::find_if(stage_memory.begin(), stage_memory.end(), [&](const StageMemory& m) { return m.stage == stage; });
    if (it == stage_memory.end()) it = stage_memory.insert(it, {stage, 0, 0});
    it->peak_reserved = std::max(it->peak_reserved, arena->reserved());
    it->peak_live = std::max(it->peak_live, arena->live());
  }

  // Whether events carry times. Some drivers claim so, but report one nanosecond for everything (Mesa 22's rusticl). To
  // find out, times a fill that takes longer than a microsecond on any device, when the first time is needed.
  bool event_times() {
    if (!info.event_profiling) return false;
    if (!fill_seconds) {
      fill_seconds = 0;
      try {
        const std::size_t bytes = 16 << 20;
        const cl::Buffer buffer(context, CL_MEM_READ_WRITE, bytes);
        cl::Event event;
        queue.enqueueFillBuffer(buffer, cl_uint{0}, 0, bytes, nullptr, &event);
        event.wait();
        const auto start = event.getProfilingInfo<CL_PROFILING_COMMAND_START>(),
                   end = event.getProfilingInfo<CL_PROFILING_COMMAND_END>();
        if (end > start) fill_seconds = static_cast<double>(end - start) * 1e-9;
      } catch (const cl::Error&) {  // then times come from the host's clock
      }
    }
    return *fill_seconds > 1e-6;
  }

  // Runs `enqueue(event pointer or null)` and records it.
  template <class F>
  void record(LaunchRecord launch, const F& enqueue) {
    if (!profiler.enabled()) {
      enqueue(nullptr);
      return;
    }
    if (event_times()) {
      cl::Event event;
      launch.before = now_ns();
      enqueue(&event);
      launch.after = now_ns();
      profiler.add_event(launch, event);
      return;
    }
    queue.finish();
    const std::uint64_t start = now_ns();
    enqueue(nullptr);
    queue.finish();
    profiler.add_host(launch, start, now_ns());
  }

  // Builds the kernel at first use, with information about its arguments, which check_marks() reads. Every build has
  // it, so that the checks run on the same program as other runs.
  Built& kernel(const KernelId& id) {
    const std::string defines = id.defines + " -cl-kernel-arg-info";
    const std::string key = std::string(id.file) + "\n" + id.name + "\n" + defines;
    const auto it = kernels.find(key);
    if (it != kernels.end()) return it->second;
    const HostSpan span(HostKind::compile, "programs", id.name);
    Built built{programs->kernel(id.file, id.name, defines), {}, {}};
    try {
      built.limits.group = built.kernel.getWorkGroupInfo<CL_KERNEL_WORK_GROUP_SIZE>(handle);
      built.limits.local = built.kernel.getWorkGroupInfo<CL_KERNEL_LOCAL_MEM_SIZE>(handle);
      // Some drivers report the SIMD width here (Mesa 22's rusticl: 32 for every kernel) but run larger groups. Values
      // below our smallest group are ignored; if one is true, the launch fails.
      if (built.limits.group < kLeastGroup) built.limits.group = info.max_work_group;
    } catch (const cl::Error& e) {
      fail_cl(e, std::string("asking about kernel ") + id.name);
    }
    profiler.add_compilation();
    return kernels.emplace(key, std::move(built)).first->second;
  }

  bool counts(const KernelId& id) const { return id.flops_per_count > 0 && profiler.enabled(); }

  // The kernel as launched: with -DCOUNT in a profiled run, if it can count.
  KernelId counting(const KernelId& id) const {
    KernelId out = id;
    if (counts(id)) out.defines += " -DCOUNT";
    return out;
  }

  void enqueue(Built& built, const KernelId& id, const Range& range, const LaunchPart& part,
               const std::vector<KernelArg>& args) {
    const auto at_least_1 = [](std::size_t size) { return std::max<std::size_t>(size, 1); };
    const cl::NDRange offset(part.offset[0], part.offset[1], part.offset[2]);
    const cl::NDRange global(part.global[0], part.global[1], part.global[2]);
    const cl::NDRange local = range.local[0]
                                  ? cl::NDRange(range.local[0], at_least_1(range.local[1]), at_least_1(range.local[2]))
                                  : cl::NullRange;
    const bool first = built.first(range.local, part.offset);
    if (first) profiler.add_compilation();
    const std::string name = id.label ? id.label : id.name;
    const std::uint64_t variant = profiler.enabled() ? hash_of(range, args) : 0;
    record({name, stage, part.cost, first, 0, 0, variant, &range, &args},
           [&](cl::Event* event) { queue.enqueueNDRangeKernel(built.kernel, offset, global, local, nullptr, event); });
    keep_pace(part.cost);
  }

  // Runs the checks that the environment asks for after each launch. Red zones come first: an overwritten one may cause
  // a NaN.
  void check_launch(const std::string& name, const std::vector<KernelArg>& args) {
    if (guards) check_red_zones(queue, *arena, name, args);
    if (checks_nan) check_for_nan(queue, name, args);
  }

  void keep_pace(Cost cost) {
    const HostSpan span(HostKind::wait, "keeping pace");
    pace.add(queue, cost);
  }

  template <class F>
  void transfer(const std::string& name, double bytes, const F& enqueue) {
    stop_if_cancelled();
    const std::string before = stage;
    stage = "transfer";
    try {
      record({name, stage, {0, bytes}}, enqueue);
    } catch (const cl::Error& e) {
      stage = before;
      fail_cl(e, name);
    }
    stage = before;
  }
};

Context::Context(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

// Removes refused choices from any table. A search may have found other values for these shapes meanwhile.
void Context::Impl::leave_out(const std::vector<std::string>& refused) {
  if (refused.empty()) return;
  auto rest = std::make_shared<Tuning>(*tuning);
  const bool defaults = rest->refuse(flavour, refused);
  off.tuned = defaults && (off.tuned || rest->chosen().size() < tuning->chosen().size());
  tuning = std::move(rest);
}

// Uses the context, device and queue of a program that uses OpenCL itself.
void Context::Impl::take(const ForeignHandles& theirs) {
  for (const FoundDevice& found : find_devices())
    if (found.handle() == theirs.device) {
      info = found.info;
      handle = found.handle;
    }
  if (!handle()) fail(Status::device, "the given cl_device_id is none of the devices that OpenCL lists");
  try {
    context = cl::Context(static_cast<cl_context>(theirs.context), true);
    const auto devices = context.getInfo<CL_CONTEXT_DEVICES>();
    if (std::find(devices.begin(), devices.end(), handle) == devices.end())
      fail(Status::usage, "the given cl_context is not of the given cl_device_id, {}", info.name);
    if (!theirs.queue) return;
    queue = cl::CommandQueue(static_cast<cl_command_queue>(theirs.queue), true);
    if (queue.getInfo<CL_QUEUE_CONTEXT>()() != context() || queue.getInfo<CL_QUEUE_DEVICE>()() != handle())
      fail(Status::usage, "the given cl_command_queue is of another context or device");
    const cl_command_queue_properties properties = queue.getInfo<CL_QUEUE_PROPERTIES>();
    if (properties & CL_QUEUE_OUT_OF_ORDER_EXEC_MODE_ENABLE)
      fail(Status::usage, "the given cl_command_queue runs out of order: one in order is expected");
    info.event_profiling = info.event_profiling && (properties & CL_QUEUE_PROFILING_ENABLE);
  } catch (const cl::Error& e) {
    fail_cl(e, "asking about the given handles");
  }
}

Context::Context(const ContextOptions& options) : impl_(std::make_unique<Impl>()) {
  const bool theirs = options.theirs.context != nullptr;
  if (theirs)
    impl_->take(options.theirs);
  else
    impl_->info = choose_device(options.device);
  refuse_too_small(impl_->info);
  impl_->off = options.off ? *options.off : fit_for_use(impl_->info);
  if (impl_->off.sub_groups && impl_->info.sub_group > 0) impl_->info.sub_group = 0;
  if (impl_->off.vectors) impl_->info.native_float_width = 1;
  impl_->precision = options.precision;
  impl_->flavour = choose_flavour(options.kernels, impl_->info, impl_->off, options.precision);
  impl_->gemm = options.gemm;
  if (impl_->gemm == GemmChoice::clblast && impl_->precision == Precision::mixed)
    fail(Status::usage,
         "CLBlast and mixed precision were asked for, and CLBlast multiplies in fp32: leave who multiplies to the "
         "program ({}), or take fp32",
         Option::gemm);
  if (impl_->precision == Precision::mixed && impl_->off.mixed)
    fail(
        Status::device,
        "mixed precision was asked for, and a self-test has found its products wrong on {} with this driver: take fp32 "
        "as {}, or set VSPLAT_SELFTEST=ignore to use it all the same",
        impl_->info.name, Option::precision);
  if (options.matrix_unit)
    impl_->matrix_unit = *options.matrix_unit;
  else if (impl_->precision == Precision::mixed)
    impl_->matrix_unit = choose_matrix_unit(impl_->info);
  if (impl_->gemm == GemmChoice::clblast && impl_->off.clblast)
    fail(
        Status::device,
        "CLBlast was asked for by name, and a self-test has found its products wrong on {} with this driver: leave the "
        "choice to the program, or set VSPLAT_SELFTEST=ignore to use it all the same",
        impl_->info.name);
  if (!theirs) {
    const HostSpan span(HostKind::host, "open the device");
    impl_->handle = find_devices().at(static_cast<std::size_t>(impl_->info.index)).handle;
    try {
      impl_->context = cl::Context(impl_->handle);
    } catch (const cl::Error& e) {
      fail_cl(e, "opening " + impl_->info.name);
    }
  }
  impl_->tuning = options.tuning ? options.tuning : tuning_for(impl_->info, impl_->flavour);
  if (!options.off) impl_->leave_out(refused_choices(impl_->info));
  impl_->programs = std::make_shared<ProgramCache>(impl_->context, impl_->handle, impl_->info, options.on_compile);
  ArenaLimits limits = limits_of(impl_->info, options.max_memory_gib);
  limits.device = std::make_shared<DeviceMemory>();
  impl_->open(limits);
}

std::unique_ptr<Context> Context::stream() const {
  auto impl = std::make_unique<Impl>();
  impl->info = impl_->info;
  impl->flavour = impl_->flavour;
  impl->gemm = impl_->gemm;
  impl->precision = impl_->precision;
  impl->matrix_unit = impl_->matrix_unit;
  impl->tuning = impl_->tuning;
  impl->off = impl_->off;
  impl->handle = impl_->handle;
  impl->context = impl_->context;
  impl->programs = impl_->programs;
  impl->open(impl_->arena->limits());
  return std::unique_ptr<Context>(new Context(std::move(impl)));
}

Context::~Context() {
  if (!impl_ || impl_->planning) return;
  try {
    impl_->queue.finish();
  } catch (const cl::Error&) {  // a queue that fails on closing cannot be helped
  }
}

std::unique_ptr<Context> Context::planner(bool limited) const {
  auto impl = std::make_unique<Impl>();
  impl->info = impl_->info;
  impl->flavour = impl_->flavour;
  impl->gemm = impl_->gemm;
  impl->precision = impl_->precision;
  impl->matrix_unit = impl_->matrix_unit;
  impl->tuning = impl_->tuning;
  impl->off = impl_->off;
  impl->planning = true;
  impl->collected = impl_->collected;
  impl->shapes = impl_->shapes;
  impl->queue = impl_->queue;  // a planner asks libraries about the queue, but enqueues nothing
  impl->stage = impl_->stage;
  impl->arena = std::make_unique<Arena>(impl_->arena->plan(limited));
  return std::unique_ptr<Context>(new Context(std::move(impl)));
}

void Context::collect(NotedKernels& to) { impl_->collected = &to; }
void Context::collect(NotedShapes& to) { impl_->shapes = &to; }

TunedValues Context::tuned(const TunedShape& shape) const {
  if (impl_->shapes)
    if (const TunedDeclaration* of = tuned_declaration(shape.op, impl_->flavour)) {
      NotedShape& noted = (*impl_->shapes)[class_of(*of, shape)];
      noted.largest = std::max(noted.largest, shape);
      ++noted.calls;
    }
  return impl_->tuning->values(impl_->flavour, shape);
}

const Tuning& Context::tuning() const { return *impl_->tuning; }
void Context::use_tuning(std::shared_ptr<const Tuning> tuning) { impl_->tuning = std::move(tuning); }

void Context::note(const KernelId& kernel, const Range& range, const Cost& cost, std::size_t local_bytes) {
  for (const std::size_t size : range.global)
    if (size == 0) return;
  const std::vector<LaunchPart> parts = parts_of(kernel, range, cost, impl_->info);
  if (!impl_->collected) return;
  NotedLaunch launch{impl_->stage, range.local, local_bytes};
  if (launch.group[0] > 0)
    for (std::size_t& size : launch.group) size = std::max<std::size_t>(size, 1);
  NotedKernel& noted = (*impl_->collected)[{kernel.file, kernel.name, kernel.defines}];
  noted.launches.insert(std::move(launch));
  for (const LaunchPart& part : parts) {
    noted.work = std::max(noted.work, work_of(part.cost));
    for (std::size_t d = 1; d < 3; ++d)
      noted.most_groups = std::max(noted.most_groups, part.global[d] / std::max<std::size_t>(range.local[d], 1));
  }
}

void Context::build(const NamedKernel& kernel) {
  impl_->stop_if_cancelled();
  impl_->kernel({kernel.file.c_str(), kernel.name.c_str(), kernel.defines});
}

bool Context::planning() const { return impl_->planning; }
const DeviceInfo& Context::device() const { return impl_->info; }
Flavour Context::flavour() const { return impl_->flavour; }
GemmChoice Context::gemm_choice() const { return impl_->gemm; }
Precision Context::precision() const { return impl_->precision; }
MatrixUnit Context::matrix_unit() const { return impl_->matrix_unit; }
const SwitchedOff& Context::switched_off() const { return impl_->off; }
Arena& Context::memory() { return *impl_->arena; }
const Arena& Context::memory() const { return *impl_->arena; }
Profiler& Context::profiler() { return impl_->profiler; }
const std::vector<StageMemory>& Context::stage_memory() const { return impl_->stage_memory; }
const std::string& Context::stage() const { return impl_->stage; }

Tensor Context::tensor(const Shape& shape, Type type, const std::string& what) {
  std::size_t bytes = size_of(type);
  for (const long size : shape) bytes *= static_cast<std::size_t>(size);
  std::string where = what;
  if (!impl_->stage.empty()) where += " (stage " + impl_->stage + ")";
  if (impl_->guards) where = fmt::format("{} [{}], {}", name_of(type), fmt::join(shape, ", "), where);
  Tensor out(impl_->arena->allocate(bytes, where), shape, type);
  impl_->note_stage_memory();
  if (impl_->guards && !impl_->planning) fill_red_zones(impl_->queue, *out.block());
  if (impl_->checks_nan && !impl_->planning) fill_with_nan(impl_->queue, out);
  return out;
}

Tensor Context::upload(const Shape& shape, const void* data, Type type, const std::string& what) {
  Tensor out = tensor(shape, type, what);
  write(out, data);
  return out;
}

void Context::write(const Tensor& tensor, const void* data) {
  if (impl_->planning || tensor.count() == 0) return;
  const HostSpan span(HostKind::upload, "write");
  impl_->transfer("write", static_cast<double>(tensor.bytes()), [&](cl::Event* event) {
    impl_->queue.enqueueWriteBuffer(*tensor.block()->buffer(), CL_TRUE, 0, tensor.bytes(), data, nullptr, event);
  });
}

void Context::fill_zero(const Tensor& tensor) {
  if (impl_->planning || tensor.count() == 0) return;
  impl_->transfer("fill", static_cast<double>(tensor.bytes()), [&](cl::Event* event) {
    impl_->queue.enqueueFillBuffer(*tensor.block()->buffer(), cl_uchar{0}, 0, tensor.bytes(), nullptr, event);
  });
}

void Context::copy(const Tensor& from, const Tensor& to) {
  if (from.bytes() != to.bytes()) fail(Status::internal, "copy of {} to {}", from.describe(), to.describe());
  if (impl_->planning || from.count() == 0) return;
  impl_->transfer("copy", 2.0 * static_cast<double>(from.bytes()), [&](cl::Event* event) {
    impl_->queue.enqueueCopyBuffer(*from.block()->buffer(), *to.block()->buffer(), 0, 0, from.bytes(), nullptr, event);
  });
}

void Context::check_element(const Tensor& tensor, std::size_t bytes) {
  if (bytes != size_of(tensor.type()))
    fail(Status::internal, "read of {} as elements of {} bytes", tensor.describe(), bytes);
}

void Context::read(const Tensor& tensor, void* data) {
  if (impl_->planning) fail(Status::internal, "a plan cannot read {}", tensor.describe());
  if (tensor.count() == 0) return;
  const HostSpan span(HostKind::wait, "reading back");
  impl_->transfer("read", static_cast<double>(tensor.bytes()), [&](cl::Event* event) {
    impl_->queue.enqueueReadBuffer(*tensor.block()->buffer(), CL_TRUE, 0, tensor.bytes(), data, nullptr, event);
  });
}

void Context::launch(const KernelId& id, const Range& range, Cost cost, const std::vector<KernelArg>& args) {
  for (const std::size_t size : range.global)
    if (size == 0) return;
  if (impl_->planning || impl_->collected) note(id, range, cost, local_bytes_of(args));
  if (impl_->planning) return;
  impl_->stop_if_cancelled();
  if (impl_->counts(id)) {
    KernelId counting = impl_->counting(id);
    counting.flops_per_count = 0;
    std::vector<KernelArg> more = args;
    more.emplace_back(written_somewhere(impl_->counters.numbers(impl_->context, impl_->queue)));
    more.emplace_back(impl_->counters.number_of(impl_->stage, id.label ? id.label : id.name, id.flops_per_count));
    return launch(counting, range, cost, more);
  }
  Built& built = impl_->kernel(id);
  const std::size_t group = check_range(id, range, built.limits, local_bytes_of(args), impl_->info);
  const std::vector<LaunchPart> parts = parts_of(id, range, cost, impl_->info);
  try {
    set_arguments(built.kernel, id.name, args, impl_->info);
    if (impl_->checks_nan) check_marks(built.kernel, id.name, args);
    for (const LaunchPart& part : parts) {
      impl_->stop_if_cancelled();
      impl_->enqueue(built, id, range, part, args);
    }
    impl_->check_launch(id.name, args);
  } catch (const cl::Error& e) {
    fail_cl(e, fmt::format("kernel {} over {}x{}x{} in groups of {}", id.name, range.global[0], range.global[1],
                           range.global[2], group));
  }
}

bool Context::takes(const KernelId& id, std::size_t group, std::size_t local_bytes) {
  if (group > impl_->info.max_work_group || local_bytes > impl_->info.local_memory) return false;
  if (impl_->planning) return true;
  const KernelLimits limits = impl_->kernel(impl_->counting(id)).limits;
  return group <= limits.group && limits.local <= impl_->info.local_memory;
}

std::size_t Context::local_memory(const NamedKernel& kernel) {
  impl_->stop_if_cancelled();
  const KernelId id{kernel.file.c_str(), kernel.name.c_str(), kernel.defines};
  try {
    return impl_->kernel(id).kernel.getWorkGroupInfo<CL_KERNEL_LOCAL_MEM_SIZE>(impl_->handle);
  } catch (const cl::Error& e) {
    fail_cl(e, std::string("asking about kernel ") + id.name);
  }
}

void* Context::raw_queue() { return impl_->queue(); }

void* Context::raw_buffer(const Tensor& tensor) {
  return tensor && tensor.block()->buffer() ? (*tensor.block()->buffer())() : nullptr;
}

void Context::record_foreign(const std::string& name, Cost cost, void* event, const Written& out) {
  cl::Event owned(static_cast<cl_event>(event));                            // takes over the reference
  const LaunchRecord launch{name, impl_->stage, cost, false, 0, now_ns()};  // enqueued earlier
  if (impl_->profiler.enabled() && impl_->event_times()) {
    impl_->profiler.add_event(launch, owned);
  } else if (impl_->profiler.enabled()) {
    const std::uint64_t start = now_ns();
    owned.wait();
    impl_->profiler.add_host(launch, start, now_ns());
  }
  impl_->check_launch(name, {out});
  impl_->keep_pace(cost);
}

Tensor Context::adopt(void* buffer, const Shape& shape, bool to_write, const std::string& what) {
  std::size_t bytes = size_of(Type::f32);
  for (const long size : shape) bytes *= static_cast<std::size_t>(size);
  return {adopted(*this, buffer, bytes, to_write, what), shape, Type::f32};
}

// The host waits itself: if an event in a wait list fails, some drivers report an error at a later call, and others
// never finish the queue.
void Context::wait_for(const std::vector<void*>& events) {
  std::vector<cl::Event> list;
  list.reserve(events.size());
  const auto refuse_failed = [&] {
    for (std::size_t i = 0; i < list.size(); ++i)
      if (const cl_int status = list[i].getInfo<CL_EVENT_COMMAND_EXECUTION_STATUS>(); status < 0)
        fail(Status::device, "events[{}] has failed with {}: what was to wait for it is not done", i,
             cl_error_name(status));
  };
  try {
    for (void* event : events) {
      list.emplace_back(static_cast<cl_event>(event), true);
      if (list.back().getInfo<CL_EVENT_CONTEXT>()() != impl_->context())
        fail(Status::usage, "events[{}] is an event of another cl_context than the device's", list.size() - 1);
    }
    refuse_failed();
    for (const cl::Event& event : list) event.wait();
  } catch (const cl::Error& e) {
    if (e.err() != CL_INVALID_EVENT) refuse_failed();
    fail(Status::usage, "the events to wait for: {}", cl_error_name(e.err()));
  }
}

void* Context::mark() {
  try {
    cl::Event out;
    impl_->queue.enqueueMarkerWithWaitList(nullptr, &out);
    impl_->queue.flush();
    clRetainEvent(out());
    return out();
  } catch (const cl::Error& e) {
    fail_cl(e, "marking what was enqueued");
  }
}

ForeignHandles Context::handles() const { return {impl_->context(), impl_->handle(), impl_->queue()}; }

void Context::cancel() { impl_->cancelled->store(true, std::memory_order_relaxed); }
void Context::go_on() { impl_->cancelled->store(false, std::memory_order_relaxed); }
void Context::stop_with(const Context& other) { impl_->cancelled = other.impl_->cancelled; }

void Context::finish() {
  if (impl_->planning) return;
  try {
    const HostSpan span(HostKind::wait, "finishing");
    impl_->queue.finish();
  } catch (const cl::Error& e) {
    fail_cl(e, "waiting for " + impl_->info.name);
  }
  impl_->profiler.collect();
  try {
    for (const Counters::Count& count : impl_->counters.take(impl_->queue))
      impl_->profiler.add_count(count.stage, count.name, count.count, count.flops);
  } catch (const cl::Error& e) {
    fail_cl(e, "reading what kernels have counted");
  }
}

void Context::flush() {
  if (impl_->planning) return;
  try {
    impl_->queue.flush();
  } catch (const cl::Error& e) {
    fail_cl(e, "sending work to " + impl_->info.name);
  }
}

Stage::Stage(Context& context, const std::string& name) : context_(context), before_(context.impl_->stage) {
  context_.impl_->stage = name;
  if (context.planning()) return;
  before_of_host_ = set_host_stage(name);
  span_.emplace(HostKind::host, "stage " + name);
}

Stage::~Stage() {
  context_.impl_->stage = before_;
  if (!span_) return;
  span_.reset();
  set_host_stage(before_of_host_);
}

Uncancelled::Uncancelled(Context& context) : context_(context) { ++context_.impl_->uncancelled; }
Uncancelled::~Uncancelled() { --context_.impl_->uncancelled; }

}  // namespace vsplat
