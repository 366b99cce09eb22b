// Whether a device's matrix units compute rightly. None is used that has not been tried on the device itself: its
// kernel compiled, and its products held against sums in double at odd sizes. What came of it is kept by device, driver
// and kernels, as a self-test's verdict is (kept_finding.h), and VSPLAT_SELFTEST=ignore does not look at that either.
// VSPLAT_MATRIX names the units to try, with commas between them, in place of those that the device's extensions tell
// of; `emulated` tries none.
#pragma once
#include <string>

#include "runtime/context.h"

namespace vsplat {

// Empty where the context's units, whatever they are, compute rightly; else what is wrong. The kernel that does not
// compile is an Error.
std::string wrong_with_matrix_unit(Context& ctx);

// The first of the device's units that was tried and is right, or is tried now; the emulated ones where there is none.
MatrixUnit choose_matrix_unit(const DeviceInfo& device);

}  // namespace vsplat
