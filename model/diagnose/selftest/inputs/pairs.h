// Which contexts multiply pairs of rounded operands (runtime/gemm_pairs.h), whatever their precision.
#pragma once
#include "model/diagnose/selftest/checks.h"
#include "runtime/gemm_pairs.h"

namespace vsplat::selftest {

inline bool multiplies_pairs(const Checks& c) {
  const Context& ctx = c.ctx;
  return ctx.flavour() == Flavour::cpu && ctx.device().native_float_width >= 4 && !ctx.switched_off().mixed;
}

}  // namespace vsplat::selftest
