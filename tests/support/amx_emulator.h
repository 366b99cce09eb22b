// Computes AMX's instructions on processors that lack them, from the handler of the signal that each raises, as Intel's
// manual defines them. What would be a fault on a processor that has them ends the process.
#pragma once

namespace vsplat::test {

// From now on, in all threads. False if this is no x86-64 Linux. Nothing changes on a processor that has AMX.
bool emulate_amx();

// Instructions computed so far.
long emulated_instructions();

}  // namespace vsplat::test
