// The object that all layers pass around: a device with its queue, kernels, memory and profile. Not thread-safe: one
// thread at a time uses a context. Several threads use one context each, on different devices or on streams of one
// device.
//
// Debugging: VSPLAT_CHECK=nan looks for NaN in the output of each launch, and VSPLAT_ARENA=guard for writes outside of
// its tensors (runtime/launch_checks.h). A context reads these variables once, on construction.
#pragma once
#include <array>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "runtime/arena.h"
#include "runtime/context_options.h"
#include "runtime/device.h"
#include "runtime/error.h"
#include "runtime/launch.h"
#include "runtime/planned_launches.h"
#include "runtime/stage.h"
#include "runtime/tensor.h"

namespace vsplat {

class Profiler;

class Context {
 public:
  explicit Context(const ContextOptions& options);
  ~Context();
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;

  // A second context on the same opened device, which it may outlive. It has its own queue, working memory, kernel
  // arguments and profile; programs and the memory limit belong to the device. A launch of one context may read tensors
  // of the other once their values are complete (finish()).
  std::unique_ptr<Context> stream() const;

  // A context that computes nothing and only counts memory: it skips launches, writes and reads, its tensors have no
  // memory, and its arena starts as a virtual copy of this one's. Running a stage on it plans the stage. For `limited`
  // see Arena::plan.
  std::unique_ptr<Context> planner(bool limited = true) const;
  bool planning() const;
  // From now on, adds every launched kernel to `to`, before it is compiled. A planner, and planners made from it, add
  // the kernels that they would launch.
  void collect(NotedKernels& to);
  void stop_collecting();
  // Adds to `to` every shape whose tuned parameters are asked for.
  void collect(NotedShapes& to);
  // Compiles the kernel if it is not compiled yet.
  void build(const NamedKernel& kernel);
  // Local memory of a kernel in bytes: what it declares, according to its compiler, plus the arguments of this
  // context's last launch of it.
  std::size_t local_memory(const NamedKernel& kernel);

  const DeviceInfo& device() const;
  Flavour flavour() const;
  GemmChoice gemm_choice() const;
  Precision precision() const;
  // The units that multiply fragments, in any precision: see runtime/gemm_matrix.h.
  MatrixUnit matrix_unit() const;
  // The parameters that an operation of that shape is built and launched with where only speed depends on them
  // (runtime/tuning/tuning.h).
  TunedValues tuned(const TunedShape& shape) const;
  const Tuning& tuning() const;
  // Replaces the device's table, for trials and tests. Later streams and planners of this context use it, too.
  void use_tuning(std::shared_ptr<const Tuning> tuning);
  const SwitchedOff& switched_off() const;
  Arena& memory();
  const Arena& memory() const;
  Profiler& profiler();

  // Uninitialised memory.
  Tensor tensor(const Shape& shape, Type type = Type::f32, const std::string& what = "tensor");
  // Allocates a tensor and copies `data` into it: count() elements of the type.
  Tensor upload(const Shape& shape, const void* data, Type type = Type::f32, const std::string& what = "tensor");
  template <class T>
  Tensor upload(const Shape& shape, const std::vector<T>& data, Type type = Type::f32,
                const std::string& what = "tensor") {
    return upload(shape, data.data(), type, what);
  }
  void write(const Tensor& tensor, const void* data);
  void fill_zero(const Tensor& tensor);
  void copy(const Tensor& from, const Tensor& to);
  // Waits for all earlier work: keep such calls few, and say why at each.
  void read(const Tensor& tensor, void* data);
  template <class T>
  std::vector<T> read(const Tensor& tensor) {
    check_element(tensor, sizeof(T));
    std::vector<T> out(static_cast<std::size_t>(tensor.count()));
    if (!out.empty()) read(tensor, out.data());
    return out;
  }

  // The only function that enqueues our kernels. A long launch is split into parts (launch_parts.h). It checks the
  // number and sizes of arguments and the work-group against the device's limits before the driver does, names the
  // launch for the profile, and records its event. Outputs of the kernel are passed as written(): ctx.launch(kernel,
  // range, cost, x, rows, columns, written(y)).
  template <class... Args>
  void launch(const KernelId& kernel, const Range& range, Cost cost, const Args&... args) {
    if (planning())
      note(kernel, range, cost, (std::size_t{0} + ... + local_bytes_of(args)));
    else
      launch(kernel, range, cost, KernelArgs(std::array<KernelArg, sizeof...(args)>{KernelArg(args)...}));
  }
  void launch(const KernelId& kernel, const Range& range, Cost cost, KernelArgs args);
  // Whether the kernel can run in groups of `group` work-items with `local_bytes` of local memory: by the limits that
  // the device reports and, except in a planner, by what its compiler reports for the kernel. Used to choose among
  // variants, largest first.
  bool takes(const KernelId& kernel, std::size_t group, std::size_t local_bytes);

  // Sharing with a program that uses OpenCL itself. adopt() wraps the program's buffer as a tensor, which keeps it
  // alive. Error(usage), naming `what`, if the buffer is of another context or too small, or if `to_write` is set and
  // the buffer may not be written.
  Tensor adopt(void* buffer, const Shape& shape, bool to_write, const std::string& what);
  // All work that is enqueued from now on waits for these events.
  void wait_for(const std::vector<void*>& events);
  // An event that completes with all work enqueued so far. The caller releases it.
  void* mark();
  ForeignHandles handles() const;  // our handles, valid as long as this context

  // For libraries that enqueue by themselves (CLBlast; runtime/ only): raw handles, and a way to record their event
  // under our name with the tensors that they write.
  void* raw_queue();
  void* raw_buffer(const Tensor& tensor);
  void record_foreign(const std::string& name, Cost cost, void* event, const Written& out);

  // May be called from any thread. The next launch or transfer, and each one after it, fails with Error(cancelled)
  // until go_on(). The device then has at most some 40 ms of work and one launch left.
  void cancel();
  void go_on();
  // From now on a cancel() of `other` stops this context, too: for the private streams of a call.
  void stop_with(const Context& other);

  // Waits for the queue and collects the profile.
  void finish();
  // Starts enqueued work, without waiting.
  void flush();

  const std::string& stage() const;
  const std::vector<StageMemory>& stage_memory() const;  // in order of first use

 private:
  friend class Stage;
  friend class Uncancelled;
  struct Impl;
  void note(const KernelId& kernel, const Range& range, const Cost& cost, std::size_t local_bytes);
  static std::size_t local_bytes_of(const Local& local) { return local.bytes; }
  template <class Arg>
  static std::size_t local_bytes_of(const Arg&) {
    return 0;
  }
  static void check_element(const Tensor& tensor, std::size_t bytes);
  explicit Context(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace vsplat
