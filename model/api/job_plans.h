// Plans of jobs that show what they launch, and at which shapes, rather than what memory they need.
#pragma once
#include <array>

#include "model/api/device.h"
#include "model/api/model.h"

namespace vsplat::api {

struct PlannedJob {
  vsplat_program_jobs bit;
  const char* name;
};
constexpr std::array<PlannedJob, 4> kPlannedJobs = {{{VSPLAT_PROGRAMS_OF_RECONSTRUCT, "reconstruct"},
                                                     {VSPLAT_PROGRAMS_OF_RENDER, "render"},
                                                     {VSPLAT_PROGRAMS_OF_FIT, "fit"},
                                                     {VSPLAT_PROGRAMS_OF_TRAIN, "train"}}};

// The jobs that options name, or `usual` if they name none. Checked; Error(usage) if one of them needs a model and
// `model` is null.
std::uint32_t checked_jobs(std::uint32_t jobs, std::uint32_t usual, vsplat_model model);

// Plans a job with a planner that collects launches. The model may be null if the job needs none.
void plan_job(Context& planner, vsplat_model model, vsplat_program_jobs job);

}  // namespace vsplat::api
