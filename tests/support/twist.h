// Motions, from the self-test.
#pragma once
#include "model/diagnose/selftest/inputs/twist.h"

namespace vsplat::test {

using selftest::exp_twist;

}  // namespace vsplat::test
