// The state of a context, for the sources of class Context alone.
#pragma once
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "runtime/clock.h"
#include "runtime/context.h"
#include "runtime/device_handles.h"
#include "runtime/device_limits.h"
#include "runtime/fail.h"
#include "runtime/launch_arguments.h"
#include "runtime/launch_checks.h"
#include "runtime/launch_parts.h"
#include "runtime/pace.h"
#include "runtime/profile/counters.h"
#include "runtime/profile/profiler.h"
#include "runtime/program.h"

namespace vsplat {

struct Context::Impl {
  // A kernel, and the work-group sizes that it was launched with.
  struct Built {
    cl::Kernel kernel;
    KernelLimits limits;
    std::vector<std::array<std::size_t, 4>> groups;

    // Whether this is the first launch with that group size, or with that size and an offset: some drivers compile
    // again for each.
    bool first(const std::array<std::size_t, 3>& local, const std::array<std::size_t, 3>& offset) {
      const std::size_t moved = offset == std::array<std::size_t, 3>{} ? 0 : 1;
      const std::array<std::size_t, 4> key{local[0], local[1], local[2], moved};
      if (std::find(groups.begin(), groups.end(), key) != groups.end()) return false;
      groups.push_back(key);
      return true;
    }
  };

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
  Profiler profiler;
  Counters counters;
  std::unique_ptr<Arena> arena;  // destroyed before the OpenCL context, since it holds the buffers: see ~Context
  std::string stage;
  std::vector<StageMemory> stage_memory;
  std::optional<double> fill_seconds;  // see event_times()
  // Small data that write() has enqueued without waiting, until all commands before some moment are done.
  std::deque<std::vector<char>> written;
  std::size_t written_bytes = 0;

  // To be called when the device has done all that was enqueued.
  void forget_written() {
    written.clear();
    written_bytes = 0;
  }

  // Sets what depends on the device and the limits; creates a queue if there is none yet.
  void open(const ArenaLimits& limits) {
    if (!queue()) make_queue();
    checks_nan = nan_check_is_wanted();
    guards = limits.guard > 0;
    arena = std::make_unique<Arena>(&context, limits, &queue);
  }

  void make_queue() {
    try {
      const cl_command_queue_properties properties = info.event_profiling ? CL_QUEUE_PROFILING_ENABLE : 0;
      queue = cl::CommandQueue(context, handle, properties);
    } catch (const cl::Error& e) {
      fail_cl(e, "opening " + info.name);
    }
  }

  // What streams and planners have of the context that they are made from.
  void take_choices(const Impl& other) {
    info = other.info;
    flavour = other.flavour;
    gemm = other.gemm;
    precision = other.precision;
    matrix_unit = other.matrix_unit;
    tuning = other.tuning;
    off = other.off;
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
    wait_for_all(queue);
    const std::uint64_t start = now_ns();
    enqueue(nullptr);
    wait_for_all(queue);
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

  void enqueue(Built& built, const KernelId& id, const Range& range, const LaunchPart& part, KernelArgs args) {
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
    record({name, stage, part.cost, first, 0, 0, variant, &range, args},
           [&](cl::Event* event) { queue.enqueueNDRangeKernel(built.kernel, offset, global, local, nullptr, event); });
    keep_pace(part.cost);
  }

  // Runs the checks that the environment asks for after each launch. Red zones come first: an overwritten one may cause
  // a NaN.
  void check_launch(const std::string& name, KernelArgs args) {
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

}  // namespace vsplat
