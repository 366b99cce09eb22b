// What a context is opened with.
#pragma once
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "runtime/precision.h"
#include "runtime/tuning/tuning.h"
#include "runtime/tuning/verdict.h"

namespace vsplat {

// The family of dense kernels. cpu: one work-item owns a register tile, float16 vectors, no local memory, no barrier.
// gpu: a work-group tiles through local memory. Both run on every device.
enum class Flavour : int { cpu = 1, gpu = 2 };
const char* name_of(Flavour flavour);

// The implementation of plain matrix products. auto_: our own kernels.
enum class GemmChoice : int { auto_ = 0, own = 1, clblast = 2 };

// OpenCL handles of the calling program, as OpenCL's C interface has them. All null: our own.
struct ForeignHandles {
  void* context = nullptr;
  void* device = nullptr;
  void* queue = nullptr;  // in order; null: a queue of our own in that context
};

struct ContextOptions {
  std::string device;            // see choose_device()
  std::string kernels = "auto";  // auto (VSPLAT_KERNELS, else from the device's traits), cpu, gpu
  GemmChoice gemm = GemmChoice::auto_;
  double max_memory_gib = 0;              // 0: what the device reports
  Precision precision = Precision::fp32;  // mixed: with the kernels of the matrix unit
  // Mixed precision by the device's own matrix units where a self-test has found it as good (verdict.h), else fp32.
  bool mixed_if_as_good = false;
  // The matrix units for mixed precision. Unset: the device's units if a trial has shown them to be right
  // (matrix_probe.h), else the emulated ones.
  std::optional<MatrixUnit> matrix_unit = std::nullopt;
  ForeignHandles theirs;  // used instead of `device`
  // What this context must not use. Unset: what a self-test has recorded for this device (verdict.h).
  std::optional<SwitchedOff> off = std::nullopt;
  std::shared_ptr<const Tuning> tuning = nullptr;  // replaces the device's table, which then is not read
  // Called before each kernel is compiled, with its name and how many kernels this context has compiled so far.
  std::function<void(const std::string&, int)> on_compile;
};

}  // namespace vsplat
