// Options of vsplat_reconstruct about its passes and what follows them, for all that reconstruct.
#pragma once
#include <algorithm>

#include "model/api/include/vsplat/reconstruct.h"
#include "model/reconstruct/reconstruct.h"
#include "runtime/fail.h"
#include "runtime/option.h"

namespace vsplat::api {

inline void set_passes(ReconstructOptions& out, const vsplat_reconstruct_options& o) {
  if (o.passes < 0 || o.passes > 16) fail(Status::usage, "{} is {}: 1 to 16 expected", Option::passes, o.passes);
  if (!(o.merge_cell <= 16)) fail(Status::usage, "{} is {}: at most 16 expected", Option::merge_cell, o.merge_cell);
  if (o.fit_epochs > 1000) fail(Status::usage, "{} is {}: at most 1000 expected", Option::fit_epochs, o.fit_epochs);
  if (o.fit_epochs != 0) out.fit_epochs = std::max(o.fit_epochs, 0);
  if (o.passes > 0) out.passes = o.passes;
  if (o.merge_cell != 0) out.merge_cell = o.merge_cell < 0 ? 0 : o.merge_cell;
}

}  // namespace vsplat::api
