#include "runtime/context.h"

#include <fmt/format.h>

#include <algorithm>

#include "runtime/context_impl.h"
#include "runtime/host_span.h"

namespace vsplat {

void Context::collect(NotedKernels& to) { impl_->collected = &to; }
void Context::stop_collecting() { impl_->collected = nullptr; }
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

void Context::launch(const KernelId& id, const Range& range, Cost cost, KernelArgs args) {
  for (const std::size_t size : range.global)
    if (size == 0) return;
  if (impl_->planning || impl_->collected) note(id, range, cost, local_bytes_of(args));
  if (impl_->planning) return;
  impl_->stop_if_cancelled();
  if (impl_->counts(id)) {
    KernelId counting = impl_->counting(id);
    counting.flops_per_count = 0;
    std::vector<KernelArg> more(args.begin(), args.end());
    more.emplace_back(written_somewhere(impl_->counters.numbers(impl_->context, impl_->queue)));
    more.emplace_back(impl_->counters.number_of(impl_->stage, id.label ? id.label : id.name, id.flops_per_count));
    return launch(counting, range, cost, KernelArgs(more));
  }
  Impl::Built& built = impl_->kernel(id);
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

void Context::cancel() { impl_->cancelled->store(true, std::memory_order_relaxed); }
void Context::go_on() { impl_->cancelled->store(false, std::memory_order_relaxed); }
void Context::stop_with(const Context& other) { impl_->cancelled = other.impl_->cancelled; }

void Context::finish() {
  if (impl_->planning) return;
  try {
    const HostSpan span(HostKind::wait, "finishing");
    wait_for_all(impl_->queue);
  } catch (const cl::Error& e) {
    fail_cl(e, "waiting for " + impl_->info.name);
  }
  impl_->forget_written();
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
