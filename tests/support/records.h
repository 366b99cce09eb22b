// Random projected Gaussians in tiles, from the self-test.
#pragma once
#include "model/diagnose/selftest/inputs/records.h"

namespace vsplat::test {

using selftest::make_records;
using selftest::offsets_of;
using selftest::Records;
using selftest::rows_in_order;
using selftest::slots_of;

}  // namespace vsplat::test
