// Jobs as they are planned to see what they launch, and at which shapes, rather than what memory they take.
#pragma once
#include "model/api/device.h"
#include "model/api/model.h"

namespace vsplat::api {

// With a planner that collects. The model may be of nothing where the job takes none.
void plan_job(Context& planner, vsplat_model model, vsplat_program_jobs job);

}  // namespace vsplat::api
