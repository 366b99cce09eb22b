// Losses on projected Gaussians, from the self-test.
#pragma once
#include "model/diagnose/selftest/inputs/projection_rows.h"

namespace vsplat::test {

using selftest::by_field;
using selftest::by_pose;
using selftest::ProjectionRows;
using selftest::surfel_rows;
using selftest::volume_rows;

}  // namespace vsplat::test
