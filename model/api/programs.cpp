// Every OpenCL program that jobs launch, found by planning them, and the kernels that no job of that model launches.
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "model/api/device.h"
#include "model/api/job_plans.h"
#include "runtime/fail.h"
#include "runtime/kernel_files.h"
#include "runtime/program.h"

using namespace vsplat;
using namespace vsplat::api;
using Json = nlohmann::ordered_json;

namespace {

NotedKernels launched_by(const Context& ctx, vsplat_model model, vsplat_program_jobs job) {
  NotedKernels out;
  const auto planner = ctx.planner(false);
  planner->collect(out);
  plan_job(*planner, model, job);
  return out;
}

// A kernel's launches, by job.
using Launches = std::map<std::string, NotedKernel>;
struct Program {
  std::string file, defines;
  auto operator<=>(const Program&) const = default;
};
using Programs = std::map<Program, std::map<std::string, Launches>>;

void add_launched(Programs& to, const Context& ctx, vsplat_model model, uint32_t jobs) {
  for (const PlannedJob& job : kPlannedJobs) {
    if (!(jobs & job.bit)) continue;
    for (const auto& [kernel, noted] : launched_by(ctx, model, job.bit))
      to[{kernel.file, kernel.defines}][kernel.name][job.name] = noted;
  }
}

// Adds each kernel that is not in the list yet, with its file's own defines.
void add_others(Programs& to, const std::vector<KernelFile>& files, Flavour flavour) {
  std::set<std::string> there;
  for (const auto& [program, kernels] : to)
    for (const auto& [name, launches] : kernels) there.insert(program.file + "\n" + name);
  for (const KernelFile& file : files)
    for (const std::string& kernel : file.kernels)
      if ((flavour == Flavour::gpu ? is_of_gpu(file, kernel) : is_of_cpu(file, kernel)) &&
          there.count(file.name + "\n" + kernel) == 0)
        to[{file.name, ""}][kernel];
}

Json json_of(const Launches& by) {
  Json out = Json::array();
  for (const auto& [job, noted] : by)
    for (const NotedLaunch& launch : noted.launches) {
      Json one;
      one["job"] = job;
      one["stage"] = launch.stage;
      one["group"] = launch.group[0] > 0 ? Json(launch.group) : Json();
      one["local_bytes"] = launch.local_bytes;
      out.push_back(std::move(one));
    }
  return out;
}

// Adds the work of the longest launch, and the most work-groups of a launch in its second or third dimension; a launch
// in slices counts by slice.
void add_longest(Json& to, const Launches& by) {
  double work = 0;
  std::size_t groups = 0;
  for (const auto& [job, noted] : by) work = std::max(work, noted.work), groups = std::max(groups, noted.most_groups);
  to["longest"] = work;
  to["most_groups"] = groups;
}

// Adds the bytes of local memory that a kernel declares; null, with the error, if the device's compiler rejects it.
void add_local_memory(Json& to, Context& ctx, const NamedKernel& kernel) {
  try {
    to["local_memory"] = ctx.local_memory(kernel);
  } catch (const Error& e) {
    if (e.status() == Status::cancelled) throw;
    to["local_memory"] = Json();
    to["error"] = e.what();
  }
}

}  // namespace

vsplat_status vsplat_device_programs(vsplat_device device, vsplat_model model, const vsplat_programs_options* options,
                                     char** out_text) {
  return guarded([&] {
    const DeviceUse use(device);
    need(out_text, "out_text");
    const vsplat_programs_options o = taken(options, VSPLAT_PROGRAMS_OPTIONS_INIT, "options");
    const uint32_t jobs = checked_jobs(o.jobs, 0, model);
    Context& ctx = device->context;
    const std::vector<KernelFile> files = kernel_files();
    Programs programs;
    add_launched(programs, ctx, model, jobs);
    if (o.others) add_others(programs, files, ctx.flavour());
    Json out;
    out["device"] = ctx.device().name;
    out["driver"] = ctx.device().driver;
    out["flavour"] = name_of(ctx.flavour());
    out["allowed"] = allowed_scratch();
    out["programs"] = Json::array();
    double done = 0;
    for (const auto& [program, kernels] : programs) {
      if (o.progress && !o.progress(o.user, "programs", done++ / static_cast<double>(programs.size())))
        fail(Status::cancelled, "stopped with {} of {} programs listed", done - 1, programs.size());
      Json one;
      one["name"] = program.file;
      one["options"] = build_options(program.defines);
      for (const KernelFile& file : files)
        if (file.name == program.file && !file.targets.empty()) one["targets"] = file.targets;
      if (o.sources) one["text"] = expanded_source(program.file);
      one["kernels"] = Json::array();
      for (const auto& [name, by] : kernels) {
        Json kernel;
        kernel["name"] = name;
        kernel["launches"] = json_of(by);
        add_longest(kernel, by);
        if (o.build && !one.contains("targets")) add_local_memory(kernel, ctx, {program.file, name, program.defines});
        one["kernels"].push_back(std::move(kernel));
      }
      out["programs"].push_back(std::move(one));
    }
    *out_text = new_text(out.dump(-1, ' ', false, Json::error_handler_t::replace));
  });
}
