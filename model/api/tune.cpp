#include <vsplat/tune.h>

#include <algorithm>

#include "model/api/device.h"
#include "model/api/job_plans.h"
#include "model/diagnose/tune/search.h"
#include "runtime/fail.h"
#include "runtime/log.h"

using namespace vsplat;
using namespace vsplat::api;

namespace {

NotedShapes shapes_of(const Context& ctx, vsplat_model model, vsplat_program_jobs job, bool limited) {
  NotedShapes out;
  const auto planner = ctx.planner(limited);
  planner->collect(out);
  plan_job(*planner, model, job);
  return out;
}

// The shapes of a job in the available memory; without limits if the job does not fit.
NotedShapes shapes_of(const Context& ctx, vsplat_model model, vsplat_program_jobs job) {
  try {
    return shapes_of(ctx, model, job, true);
  } catch (const Error& e) {
    if (e.status() != Status::memory) throw;
    return shapes_of(ctx, model, job, false);
  }
}

}  // namespace

vsplat_status vsplat_tune(vsplat_device device, vsplat_model model, const vsplat_tune_options* options,
                          char** out_text) {
  return guarded([&] {
    const DeviceUse use(device);
    need(out_text, "out_text");
    const vsplat_tune_options o = taken(options, VSPLAT_TUNE_OPTIONS_INIT, "options");
    if (!(o.seconds >= 0 && o.seconds <= 1e9))
      fail(Status::usage, "options.seconds is {}, 0 to 1e9 expected", o.seconds);
    const uint32_t jobs = checked_jobs(o.jobs, VSPLAT_PROGRAMS_OF_RECONSTRUCT | VSPLAT_PROGRAMS_OF_RENDER, model);
    Context& ctx = device->context;
    TuneRequest request;
    for (const PlannedJob& job : kPlannedJobs)
      if (jobs & job.bit)
        for (const auto& [shape, noted] : shapes_of(ctx, model, job.bit)) {
          NotedShape& all = request.shapes[shape];
          all.largest = std::max(all.largest, noted.largest);
          all.calls += noted.calls;
        }
    request.full = o.full != 0, request.again = o.again != 0;
    if (o.seconds > 0) request.seconds = o.seconds;
    if (o.path) request.path = o.path;
    if (o.progress)
      request.progress = [&](const std::string& what, double done) {
        return o.progress(o.user, what.c_str(), done) != 0;
      };
    const TuneResult result = tune(ctx, request);
    *out_text = new_text(tune_json(ctx, result));
  });
}
