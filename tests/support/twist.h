// Motions, as the self-test has them.
#pragma once
#include "model/selftest/inputs/twist.h"

namespace vsplat::test {

using selftest::exp_twist;

}  // namespace vsplat::test
