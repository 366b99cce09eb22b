// vsplat kernels: lists every OpenCL program with its build options and what launches it, and writes it all to a folder
// for compiler developers.
#include <cstdio>
#include <nlohmann/json.hpp>
#include <set>
#include <vsplat/vsplat.hpp>

#include "arguments.h"
#include "command.h"
#include "job_names.h"
#include "outputs.h"
#include "session.h"

namespace command {
namespace {

using Json = nlohmann::ordered_json;

struct KernelsOptions {
  Common common;
  std::string folder, model, jobs = "reconstruct,render,fit,train", flavour = "gpu";
  bool no_build = false;
};

// The library's list of programs for one flavour.
Json description(const KernelsOptions& o, const std::string& flavour) {
  Common common = o.common;
  common.kernels = flavour;
  Session session(common);
  vsplat_programs_options options = VSPLAT_PROGRAMS_OPTIONS_INIT;
  options.jobs = jobs_of("--for", o.jobs);
  options.sources = o.folder.empty() ? 0 : 1;
  options.build = o.no_build ? 0 : 1;
  options.progress = Session::on_progress;
  options.user = &session;
  session.start(flavour + " kernels");
  vsplat::Model model;
  if (options.jobs & (VSPLAT_PROGRAMS_OF_RECONSTRUCT | VSPLAT_PROGRAMS_OF_TRAIN)) model = load_model(o.model);
  Json out = Json::parse(session.device().programs(model.get(), options));
  clear_progress();
  return out;
}

// "train (volume, heads)": the jobs that launch it, with their stages.
std::string launched_by(const Json& kernel) {
  std::vector<std::pair<std::string, std::set<std::string>>> jobs;
  for (const Json& launch : kernel["launches"]) {
    const std::string job = launch["job"], stage = launch["stage"];
    if (jobs.empty() || jobs.back().first != job) jobs.push_back({job, {}});
    if (!stage.empty()) jobs.back().second.insert(stage);
  }
  std::string out;
  for (const auto& [job, stages] : jobs) {
    out += (out.empty() ? "" : "; ") + job;
    std::string names;
    for (const std::string& stage : stages) names += (names.empty() ? "" : ", ") + stage;
    if (!names.empty()) out += " (" + names + ")";
  }
  return out.empty() ? "nothing here" : out;
}

// "256", "16x16": each work-group size once; "-" if the driver chooses it or nothing launches the kernel.
std::string groups_of(const Json& kernel) {
  std::set<std::string> sizes;
  for (const Json& launch : kernel["launches"]) {
    if (launch["group"].is_null()) continue;
    std::string size = launch["group"][0].dump();
    if (launch["group"][1] > 1 || launch["group"][2] > 1) size += "x" + launch["group"][1].dump();
    if (launch["group"][2] > 1) size += "x" + launch["group"][2].dump();
    sizes.insert(size);
  }
  std::string out;
  for (const std::string& size : sizes) out += (out.empty() ? "" : ",") + size;
  return out.empty() ? "-" : out;
}

// What the kernel declares, plus the most that a launch passes as an argument.
std::string local_memory_of(const Json& kernel) {
  uint64_t most = 0;
  for (const Json& launch : kernel["launches"]) most = std::max(most, launch["local_bytes"].get<uint64_t>());
  if (!kernel.contains("local_memory")) return most > 0 ? std::to_string(most) + "+?" : "?";
  if (kernel["local_memory"].is_null()) return "does not compile";
  return std::to_string(kernel["local_memory"].get<uint64_t>() + most);
}

void print_table(const std::vector<Json>& all) {
  std::printf("%-34s %-12s %-10s %-26s %-36s %s\n", "kernel", "group", "local", "file", "options", "launched by");
  std::size_t programs = 0, kernels = 0;
  for (const Json& one : all)
    for (const Json& program : one["programs"]) {
      ++programs;
      for (const Json& kernel : program["kernels"]) {
        ++kernels;
        const std::string name = kernel["name"], file = program["name"], options = program["options"];
        std::printf("%-34s %-12s %-10s %-26s %-36s %s\n", name.c_str(), groups_of(kernel).c_str(),
                    local_memory_of(kernel).c_str(), file.c_str(), options.c_str(),
                    for_terminal(launched_by(kernel)).c_str());
      }
    }
  std::printf("%zu kernels in %zu programs\n", kernels, programs);
}

// kernels.json: one program a line, its kernels by name, with what is known about them.
Json listed(const std::vector<Json>& all) {
  Json out = Json::array();
  for (const Json& one : all)
    for (const Json& program : one["programs"]) {
      Json row;
      row["name"] = program["name"];
      row["source"] = program["name"].get<std::string>() + ".cl";
      row["options"] = program["options"];
      row["flavour"] = one["flavour"];
      if (program.contains("targets")) row["targets"] = program["targets"];
      row["kernels"] = Json::array();
      row["about"] = program["kernels"];
      for (const Json& kernel : program["kernels"]) row["kernels"].push_back(kernel["name"]);
      out.push_back(std::move(row));
    }
  return out;
}

std::string lines_of(const Json& list) {
  std::string out = "[";
  for (std::size_t i = 0; i < list.size(); ++i) out += (i > 0 ? ",\n " : "") + list[i].dump();
  return out + "]\n";
}

std::string about(const Json& one) {
  return std::string("The OpenCL programs of vsplat ") + vsplat_version_string() + ", listed on " +
         one["device"].get<std::string>() + ", driver " + one["driver"].get<std::string>() +
         ".\n\n"
         "kernels.json: one program a line. `source` is a file of this folder that includes nothing, `options` what\n"
         "it is built with (clBuildProgram), `kernels` its kernels that are used, `about` who launches each and how:\n"
         "`group` is the size of its work-groups (null: the driver chooses), `local_bytes` the local memory that is\n"
         "an argument, and `local_memory` what the kernel declares, in bytes. `targets`, if present: the only\n"
         "vendors (or chips) whose compiler can read the program. allowed.txt: which kernels are known to keep\n"
         "scratch memory on which targets, and why.\n\n"
         "One program by the compilers that drivers are built on:\n"
         "  clang -x cl OPTIONS -target amdgcn-amd-amdhsa -mcpu=gfx90a -Xclang -finclude-default-header -O3 -S -o - "
         "SOURCE\n"
         "  ocloc compile -file SOURCE -device dg2 -options \"OPTIONS\"\n";
}

void write_folder(const KernelsOptions& o, Outputs& outputs, const std::vector<Json>& all) {
  const auto path = [&](const std::string& name) { return o.folder + "/" + name; };
  std::vector<std::pair<std::string, std::string>> files = {{"kernels.json", lines_of(listed(all))},
                                                            {"about.txt", about(all.front())}};
  if (!all.front()["allowed"].get<std::string>().empty()) files.emplace_back("allowed.txt", all.front()["allowed"]);
  std::set<std::string> sources;
  for (const Json& one : all)
    for (const Json& program : one["programs"])
      if (const std::string name = program["name"].get<std::string>() + ".cl"; sources.insert(name).second)
        files.emplace_back(name, program["text"]);
  for (const auto& [name, text] : files) outputs.expect(path(name));
  for (const auto& [name, text] : files) write_text(outputs.begin(path(name)), text);
}

void kernels(const KernelsOptions& o) {
  set_up_library(o.common);
  if (o.common.kernels != "auto") throw UsageError("--kernels: say --flavour " + o.common.kernels);
  Outputs outputs(o.common.overwrite);
  outputs.input(o.model);
  std::vector<Json> all;
  for (const std::string flavour : {"gpu", "cpu"})
    if (o.flavour == flavour || o.flavour == "all") all.push_back(description(o, flavour));
  if (!o.folder.empty()) write_folder(o, outputs, all);
  outputs.commit();
  if (o.common.json)
    print_json(listed(all));
  else
    print_table(all);
}

}  // namespace

void add_kernels(CLI::App& app, Run& run) {
  auto o = std::make_shared<KernelsOptions>();
  CLI::App* sub = app.add_subcommand("kernels", "List the OpenCL programs, and write them for other compilers");
  sub->add_option("--dump", o->folder, "Write kernels.json and every source, includes expanded, into this folder")
      ->type_name("DIR");
  sub->add_option("--model", o->model, "The model whose sizes decide what is launched (default: the built-in model)")
      ->type_name("MODEL.safetensors");
  sub->add_option("--for", o->jobs, "Jobs whose programs are listed (default: reconstruct,render,fit,train)")
      ->type_name("JOBS");
  sub->add_option("--flavour", o->flavour, "Flavour of the dense kernels: gpu, cpu or all (default: gpu)")
      ->check(one_of({"gpu", "cpu", "all"}))
      ->type_name("gpu|cpu|all");
  sub->add_flag(
      "--no-build", o->no_build,
      "Compile nothing, for drivers that fail at it; how much local memory a kernel declares is then unknown");
  add_common(*sub, o->common, {.profile = false, .outside = false, .precision = true});
  sub->footer(
      "The jobs are planned, not run: nothing is launched. The list also has the flavour's kernels that no job\n"
      "launches, built with no options of their own. --json shows everything, such as the parts of a launch's local\n"
      "memory; its objects are those of kernels.json.\n"
      "Examples:\n"
      "  vsplat kernels\n"
      "  vsplat kernels --for render --json\n"
      "  vsplat kernels --dump kernels/ --flavour all --no-build");
  sub->callback([o, &run] { run = [o] { kernels(*o); }; });
}

}  // namespace command
