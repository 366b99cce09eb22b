// Tests whether a device's matrix units compute correctly. Units are used only after a trial on the device itself:
// their kernel is compiled, and its products are compared with sums in double at odd sizes. The result is stored by
// device, driver and kernels, like a self-test's verdict (stored_finding.h); VSPLAT_SELFTEST=ignore ignores it, too.
// VSPLAT_MATRIX lists the units to try, separated by commas, instead of those that the device announces; `emulated`
// tries none. A processor's instructions (avx512bf16, amx) are never tried where it lacks them: there, their name is an
// error.
#pragma once
#include <string>

#include "runtime/context.h"

namespace vsplat {

// Empty if the context's units compute correctly; else what is wrong. Throws an Error if their kernel does not compile.
std::string wrong_with_matrix_unit(Context& ctx);

// The first of the device's units that has passed the trial, which runs now if it has not run yet; the emulated ones if
// none passes. `kernels`: auto, cpu or gpu; only units of those kernels are tried. With cpu, the emulated ones are used
// only if VSPLAT_MATRIX names them; else Error(usage).
MatrixUnit choose_matrix_unit(const DeviceInfo& device, const std::string& kernels, const SwitchedOff& off);

}  // namespace vsplat
