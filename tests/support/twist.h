// Motions, as the self-test has them.
#pragma once
#include "model/diagnose/selftest/inputs/twist.h"

namespace vsplat::test {

using selftest::exp_twist;

}  // namespace vsplat::test
