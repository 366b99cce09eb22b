// What a device's table chooses, tried again on the driver that there is now: for the self-test.
#pragma once
#include <string>
#include <vector>

#include "runtime/context.h"

namespace vsplat {

// Whether an error may be the device's fault. A shortage of memory, a file and the request say nothing of whether it
// computes rightly: they end what finds that out, and nothing is remembered.
bool tells_of_the_device(const Error& error);

struct CheckedChoice {
  TunedShape shape;  // a class of the table's
  TunedValues values;
  std::string name;  // "gemm m=4096 n=768 k=768 taps=1, tile=128 unroll=0"
  double error = 0;  // the worst, by what may be; more than 1 is wrong, infinite where it did not run
  std::string why;   // it did not run
  bool right() const { return error <= 1; }
};

// Each choice of the context's table once, at an odd shape and at one of its class that takes little time. Errors that
// tell nothing of the device pass.
std::vector<CheckedChoice> check_chosen(Context& ctx);
// The same without trying them: none is right, for what is known of them all.
std::vector<CheckedChoice> unchecked_chosen(const Context& ctx, const std::string& why);

// Takes these out of the device's table in the cache's folder, where that is the context's; contexts that are made
// after it run with the defaults there, and a search does not choose them again. None while a search has the folder.
// How many were taken out.
int refuse_chosen(const Context& ctx, const std::vector<CheckedChoice>& wrong);

}  // namespace vsplat
