// Cameras around the origin, from the self-test.
#pragma once
#include "model/diagnose/selftest/inputs/camera_ring.h"

namespace vsplat::test {

using selftest::orbit;

}  // namespace vsplat::test
