// Jobs as they are planned to see what they launch, and at which shapes, rather than what memory they take.
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
                                                     {VSPLAT_PROGRAMS_OF_REFINE, "refine"},
                                                     {VSPLAT_PROGRAMS_OF_TRAIN, "train"}}};

// Of options that name jobs, `usual` where they name none: those, with a model where one of them takes one.
std::uint32_t checked_jobs(std::uint32_t jobs, std::uint32_t usual, vsplat_model model);

// With a planner that collects. The model may be of nothing where the job takes none.
void plan_job(Context& planner, vsplat_model model, vsplat_program_jobs job);

}  // namespace vsplat::api
