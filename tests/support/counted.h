// Counters of kernels in a profiled run.
#pragma once
#include <string>

#include "runtime/context.h"
#include "runtime/profile/profiler.h"

namespace vsplat::test {

// Runs `work` with the profiler on, and then switches it off. Returns the row whose name begins with `name`; of
// several, the one with the most operations; zeros if there is none.
template <class F>
ProfileRow profiled_row(Context& ctx, const std::string& begin, const F& work) {
  ctx.finish();
  ctx.profiler().reset();
  ctx.profiler().enable(true);
  work();
  ctx.finish();
  ctx.profiler().enable(false);
  ProfileRow out;  // rows are sorted by time, which other programs on the processor may affect
  for (const ProfileRow& row : ctx.profiler().rows())
    if (row.name.rfind(begin, 0) == 0 && (out.calls == 0 || row.flops > out.flops)) out = row;
  return out;
}

}  // namespace vsplat::test
