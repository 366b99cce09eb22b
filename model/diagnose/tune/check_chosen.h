// Retries a device table's choices on the present driver, for the self-test.
#pragma once
#include <string>
#include <vector>

#include "runtime/context.h"

namespace vsplat {

// Whether an error may be the device's fault. Lack of memory, file errors and usage errors say nothing about the
// device: they end the test, and nothing is recorded.
bool tells_of_the_device(const Error& error);

struct CheckedChoice {
  TunedShape shape;  // a class of the table
  TunedValues values;
  std::string name;  // "gemm m=4096 n=768 k=768 taps=1, tile=128 unroll=0"
  double error = 0;  // largest error relative to its tolerance; more than 1 is wrong, infinite if it did not run
  std::string why;   // the error, if it did not run
  bool right() const { return error <= 1; }
};

// Tries each choice of the context's table once, at an odd shape and at a fast one of its class. Throws errors that are
// not the device's fault.
std::vector<CheckedChoice> check_chosen(Context& ctx);
// The same without running them: treats all as wrong.
std::vector<CheckedChoice> unchecked_chosen(const Context& ctx, const std::string& why);

// Removes these choices from the device's table in the cache folder, if the context uses that table. Contexts made
// later use the defaults there, and a search does not choose them again. Removes none while a search holds the folder.
// Returns how many it removed.
int refuse_chosen(const Context& ctx, const std::vector<CheckedChoice>& wrong);

}  // namespace vsplat
