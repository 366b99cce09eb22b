// What a context shares with programs and libraries that use OpenCL themselves.
#include <vector>

#include "runtime/context_impl.h"
#include "runtime/foreign.h"

namespace vsplat {

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
  const KernelArg args[] = {out};
  impl_->check_launch(name, args);
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

}  // namespace vsplat
