// Cameras around the origin, as the self-test has them.
#pragma once
#include "model/diagnose/selftest/inputs/orbit.h"

namespace vsplat::test {

using selftest::orbit;

}  // namespace vsplat::test
