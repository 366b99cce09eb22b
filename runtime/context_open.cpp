// Opening and closing contexts.
#include <algorithm>
#include <vector>

#include "runtime/context_choices.h"
#include "runtime/context_impl.h"
#include "runtime/device_memory.h"
#include "runtime/host_span.h"
#include "runtime/option.h"
#include "runtime/tuning/matrix_probe.h"

namespace vsplat {

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

namespace {

bool gains_by_mixed(const DeviceInfo& info, const std::string& kernels, const SwitchedOff& off, GemmChoice gemm) {
  if (gemm == GemmChoice::clblast || off.mixed || !mixed_is_as_good(info)) return false;
  try {
    return choose_matrix_unit(info, kernels, off) != MatrixUnit::emulated;
  } catch (const Error& e) {  // these kernels have no unit
    if (e.status() != Status::usage) throw;
    return false;
  }
}

}  // namespace

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
  impl_->gemm = options.gemm;
  const std::string kernels = asked_kernels(options.kernels);
  impl_->precision = options.mixed_if_as_good && gains_by_mixed(impl_->info, kernels, impl_->off, impl_->gemm)
                         ? Precision::mixed
                         : options.precision;
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
  const bool mixed = impl_->precision == Precision::mixed;
  if (options.matrix_unit)
    impl_->matrix_unit = *options.matrix_unit;
  else if (mixed)
    impl_->matrix_unit = choose_matrix_unit(impl_->info, kernels, impl_->off);
  impl_->flavour =
      choose_flavour(kernels, impl_->info, impl_->off, mixed ? std::optional(impl_->matrix_unit) : std::nullopt);
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
  impl->take_choices(*impl_);
  impl->handle = impl_->handle;
  impl->context = impl_->context;
  impl->programs = impl_->programs;
  impl->open(impl_->arena->limits());
  return std::unique_ptr<Context>(new Context(std::move(impl)));
}

Context::~Context() {
  if (!impl_ || impl_->planning) return;
  try {
    wait_for_all(impl_->queue);
  } catch (const cl::Error&) {  // a queue that fails on closing cannot be helped
  }
}

std::unique_ptr<Context> Context::planner(bool limited) const {
  auto impl = std::make_unique<Impl>();
  impl->take_choices(*impl_);
  impl->planning = true;
  impl->collected = impl_->collected;
  impl->shapes = impl_->shapes;
  impl->queue = impl_->queue;  // a planner asks libraries about the queue, but enqueues nothing
  impl->stage = impl_->stage;
  impl->arena = std::make_unique<Arena>(impl_->arena->plan(limited));
  return std::unique_ptr<Context>(new Context(std::move(impl)));
}

}  // namespace vsplat
