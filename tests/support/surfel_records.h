// Random projected surfels in tiles, from the self-test.
#pragma once
#include "model/diagnose/selftest/inputs/surfel_records.h"
#include "tests/support/records.h"

namespace vsplat::test {

using selftest::make_surfel_records;

}  // namespace vsplat::test
