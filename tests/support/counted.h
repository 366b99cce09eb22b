// What kernels count in a profiled run.
#pragma once
#include <string>

#include "runtime/context.h"
#include "runtime/profile/profiler.h"

namespace vsplat::test {

// Runs `work` with the profiler on, which is off again then. -> the row whose name begins so, of several that with the
// most operations; one of zeros: none
template <class F>
ProfileRow profiled_row(Context& ctx, const std::string& begin, const F& work) {
  ctx.finish();
  ctx.profiler().reset();
  ctx.profiler().enable(true);
  work();
  ctx.finish();
  ctx.profiler().enable(false);
  ProfileRow out;  // rows come by their times, which another program on the processor may turn about
  for (const ProfileRow& row : ctx.profiler().rows())
    if (row.name.rfind(begin, 0) == 0 && (out.calls == 0 || row.flops > out.flops)) out = row;
  return out;
}

}  // namespace vsplat::test
