// The one object passed around: a device with its queue, kernels, memory and profile.
// Not thread-safe: one thread at a time uses a context. Several threads use a context each, of devices of their own or
// streams of one.
//
// Debugging: VSPLAT_CHECK=nan looks for NaN in what each launch has written, VSPLAT_ARENA=guard for what it has written
// beside its tensors (runtime/launch_checks.h); a context asks the environment once, when it is made.
#pragma once
#include <array>
#include <compare>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "runtime/arena.h"
#include "runtime/device.h"
#include "runtime/error.h"
#include "runtime/host_span.h"
#include "runtime/launch.h"
#include "runtime/precision.h"
#include "runtime/tensor.h"
#include "runtime/tuning/tuning.h"
#include "runtime/tuning/verdict.h"

namespace vsplat {

class Profiler;

// Which family of dense kernels runs. cpu: one work-item owns a register tile, float16 vectors, no local memory, no
// barrier. gpu: a work-group tiles through local memory. Both run on every device.
enum class Flavour : int { cpu = 1, gpu = 2 };
const char* name_of(Flavour flavour);

// Who multiplies plain matrices. auto_: our own kernels.
enum class GemmChoice : int { auto_ = 0, own = 1, clblast = 2 };

// Another's OpenCL, as the C interface of it has the handles. All null: our own.
struct ForeignHandles {
  void* context = nullptr;
  void* device = nullptr;
  void* queue = nullptr;  // in order; null: one of our own in that context
};

struct ContextOptions {
  std::string device;            // as choose_device() takes it
  std::string kernels = "auto";  // auto (VSPLAT_KERNELS, else by the device's traits), cpu, gpu
  GemmChoice gemm = GemmChoice::auto_;
  double max_memory_gib = 0;              // 0: what the device reports
  Precision precision = Precision::fp32;  // mixed: with the gpu kernels alone
  // Whose matrix units multiply in mixed precision; none: those of the device that were tried and are right
  // (matrix_probe.h), else the emulated ones.
  std::optional<MatrixUnit> matrix_unit = std::nullopt;
  ForeignHandles theirs;  // in place of `device`
  // What is not used; none: what a self-test has left behind of this device (verdict.h).
  std::optional<SwitchedOff> off = std::nullopt;
  std::shared_ptr<const Tuning> tuning = nullptr;  // in place of the device's table, which is not read then
  // Called before each kernel that is compiled: its name and how many were compiled so far in this context.
  std::function<void(const std::string&, int)> on_compile;
};

// A kernel, by the fields of its KernelId.
struct NamedKernel {
  std::string file, name, defines;
  auto operator<=>(const NamedKernel&) const = default;  // NOLINT(modernize-use-nullptr): it has none
};

// How a planner was asked to launch a kernel: the size of its work-groups (0: the driver's choice), and the local
// memory that arguments ask for, beside what the kernel declares.
struct NotedLaunch {
  std::string stage;
  std::array<std::size_t, 3> group{};
  std::size_t local_bytes = 0;
  auto operator<=>(const NotedLaunch&) const = default;  // NOLINT(modernize-use-nullptr): it has none
};
struct NotedKernel {
  std::set<NotedLaunch> launches;
  double work = 0;              // of the longest part of a launch, see launch_parts.h
  std::size_t most_groups = 0;  // of a part, in the second or the third direction
};
using NotedKernels = std::map<NamedKernel, NotedKernel>;

// Device memory while a stage ran: bytes of slabs, and of tensors alive in them.
struct StageMemory {
  std::string stage;
  std::size_t peak_reserved = 0, peak_live = 0;
};

class Context {
 public:
  explicit Context(const ContextOptions& options);
  ~Context();
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;

  // A context of its own on the same opened device, which it may outlive: queue, working memory, kernels' arguments and
  // profile are its own; programs and the limit of memory are one device's. Tensors of one may be read by launches of
  // the other once their values are there (finish()).
  std::unique_ptr<Context> stream() const;

  // A context that computes nothing and only counts memory: launches, writes and reads are skipped, tensors have no
  // memory behind them, and its arena starts as a virtual copy of this one's. Used to plan a run by running it. Without
  // limits: see Arena::plan.
  std::unique_ptr<Context> planner(bool limited = true) const;
  bool planning() const;
  // From now on the kernels that are launched, in a planner and planners made of it those that would be, are put into
  // `to`: before they are compiled.
  void collect(NotedKernels& to);
  // The same of the shapes that it is asked for tuned parameters of.
  void collect(NotedShapes& to);
  // Compiles what is not compiled yet.
  void build(const NamedKernel& kernel);
  // The local memory that a kernel declares, in bytes, by its compiler, with what this context's last launch of it gave
  // as arguments.
  std::size_t local_memory(const NamedKernel& kernel);

  const DeviceInfo& device() const;
  Flavour flavour() const;
  GemmChoice gemm_choice() const;
  Precision precision() const;
  // Who multiplies fragments, whatever the precision: see runtime/gemm_matrix.h.
  MatrixUnit matrix_unit() const;
  // What an operation of that shape is built and launched with, where it is a matter of speed (runtime/tuning/tuning.h).
  TunedValues tuned(const TunedShape& shape) const;
  const Tuning& tuning() const;
  // In place of the device's table: for trials, and tests. Streams and planners that are made after it have the same.
  void use_tuning(std::shared_ptr<const Tuning> tuning);
  const SwitchedOff& switched_off() const;
  Arena& memory();
  const Arena& memory() const;
  Profiler& profiler();

  // Uninitialised memory.
  Tensor tensor(const Shape& shape, Type type = Type::f32, const std::string& what = "tensor");
  // With a copy of `data`, count() elements of the type.
  Tensor upload(const Shape& shape, const void* data, Type type = Type::f32, const std::string& what = "tensor");
  template <class T>
  Tensor upload(const Shape& shape, const std::vector<T>& data, Type type = Type::f32,
                const std::string& what = "tensor") {
    return upload(shape, data.data(), type, what);
  }
  void write(const Tensor& tensor, const void* data);
  void fill_zero(const Tensor& tensor);
  void copy(const Tensor& from, const Tensor& to);
  // Waits for everything before it: keep such calls few, and say why at each.
  void read(const Tensor& tensor, void* data);
  template <class T>
  std::vector<T> read(const Tensor& tensor) {
    check_element(tensor, sizeof(T));
    std::vector<T> out(static_cast<std::size_t>(tensor.count()));
    if (!out.empty()) read(tensor, out.data());
    return out;
  }

  // The one place that enqueues kernels of ours, a long launch in parts (launch_parts.h). Checks the number and sizes
  // of arguments and the work-group against the device's limits before the driver does, names the launch for the
  // profile, and records its event. What the kernel writes is given as written(): ctx.launch(kernel, range, cost, x,
  // rows, columns, written(y)).
  template <class... Args>
  void launch(const KernelId& kernel, const Range& range, Cost cost, const Args&... args) {
    if (planning())
      note(kernel, range, cost, (std::size_t{0} + ... + local_bytes_of(args)));
    else
      launch(kernel, range, cost, std::vector<KernelArg>{KernelArg(args)...});
  }
  void launch(const KernelId& kernel, const Range& range, Cost cost, const std::vector<KernelArg>& args);
  // Whether the kernel runs in groups of so many items with so much local memory: by what the device claims and, but
  // for a planner, by what its compiler has made of it. For choosing among variants, largest first.
  bool takes(const KernelId& kernel, std::size_t group, std::size_t local_bytes);

  // Between us and a program with OpenCL of its own. Another's buffer as a tensor, which keeps it alive: Error(usage),
  // naming `what`, where it is of another context, too small, or may not be written and is `to_write`.
  Tensor adopt(void* buffer, const Shape& shape, bool to_write, const std::string& what);
  // Whatever is enqueued from now on waits for these events.
  void wait_for(const std::vector<void*>& events);
  // An event, the caller's to release, of all that has been enqueued.
  void* mark();
  ForeignHandles handles() const;  // ours; they live as long as this context

  // For libraries that enqueue by themselves (CLBlast; runtime/ only): raw handles, and their event under our name with
  // what they write.
  void* raw_queue();
  void* raw_buffer(const Tensor& tensor);
  void record_foreign(const std::string& name, Cost cost, void* event, const Written& out);

  // From any thread: the next launch or transfer fails with Error(cancelled), and so does each after it, until
  // go_on(). No more is ahead of the device then than it does in some 40 ms, and one launch.
  void cancel();
  void go_on();
  // What stops that one stops this one, too, from now on: for work on a stream that is a call's own.
  void stop_with(const Context& other);

  // Waits for the queue and gathers the profile.
  void finish();
  // Enqueued work starts now, without waiting.
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

// The stage that launches belong to while it lives: "encoder", "modulation", "lifting", "volume", "heads", "selection",
// "refinement", "decode", "splat". Memory peaks are kept per stage, too.
class Stage {
 public:
  Stage(Context& context, const std::string& name);
  ~Stage();
  Stage(const Stage&) = delete;
  Stage& operator=(const Stage&) = delete;

 private:
  Context& context_;
  std::string before_, before_of_host_;
  std::optional<HostSpan> span_;
};

// While it lives, nothing is cancelled: for changes that are made whole or not at all.
class Uncancelled {
 public:
  explicit Uncancelled(Context& context);
  ~Uncancelled();
  Uncancelled(const Uncancelled&) = delete;
  Uncancelled& operator=(const Uncancelled&) = delete;

 private:
  Context& context_;
};

}  // namespace vsplat
