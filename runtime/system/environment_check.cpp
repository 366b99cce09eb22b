#include "runtime/system/environment_check.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <vector>

#include "runtime/fail.h"
#include "runtime/precision.h"
#include "runtime/printable.h"
#include "runtime/system/environment.h"
#include "runtime/system/system.h"

namespace vsplat {
namespace {

struct Words {
  const char* name;
  std::vector<std::string> allowed;
};

bool is_number(const std::string& text) {
  return !text.empty() && text.size() < 10 &&
         std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
}

}  // namespace

std::vector<VariableProblem> environment_problems() {
  std::vector<VariableProblem> out;
  const auto refuse = [&](const std::string& name, const std::string& expected) {
    out.push_back({name, fmt::format("{} is \"{}\", {} expected", name, printable(environment(name.c_str())), expected),
                   fmt::format("set {} to that, or `unset {}`", name, name)});
  };
  const auto value = [](const char* name) { return environment(name); };
  for (const Words& words : {Words{"VSPLAT_ARENA", {"guard"}}, Words{"VSPLAT_CHECK", {"nan"}},
                             Words{"VSPLAT_KERNELS", {"auto", "cpu", "gpu"}}, Words{"VSPLAT_SELFTEST", {"ignore"}},
                             Words{"POCL_WORK_GROUP_METHOD",
                                   {"auto", "cbs", "loops", "loopvec", "repl", "workitemloops", "workitemrepl"}}}) {
    const std::string found = value(words.name);
    if (!found.empty() && std::find(words.allowed.begin(), words.allowed.end(), found) == words.allowed.end())
      refuse(words.name, fmt::format("{}", fmt::join(words.allowed, ", ")));
  }
  std::string units = value("VSPLAT_MATRIX");
  while (!units.empty()) {
    const std::string unit = units.substr(0, units.find(','));
    if (std::none_of(kMatrixUnits.begin(), kMatrixUnits.end(), [&](MatrixUnit u) { return unit == name_of(u); })) {
      std::vector<const char*> names;
      names.reserve(kMatrixUnits.size());
      for (const MatrixUnit each : kMatrixUnits) names.push_back(name_of(each));
      refuse("VSPLAT_MATRIX", fmt::format("a comma-separated list of {}", fmt::join(names, ", ")));
      break;
    }
    units.erase(0, unit.size() + 1);
  }
  // PoCL ends the process if it does not understand a variable of its own, or goes on without it.
  for (const char* name : {"POCL_CPU_LOCAL_MEM_SIZE", "POCL_CPU_MAX_CU_COUNT", "POCL_MAX_COMPUTE_UNITS",
                           "POCL_MAX_PTHREAD_COUNT", "POCL_MAX_WORK_GROUP_SIZE", "POCL_MEMORY_LIMIT"})
    if (const std::string found = value(name); !found.empty() && !is_number(found)) refuse(name, "a whole number");
  for (const char* name :
       {"VSPLAT_MATRIX_LEAST", "OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "MPI_LOCALNRANKS", "SLURM_STEP_NUM_TASKS"})
    if (const std::string found = value(name); !found.empty() && !is_number(found)) refuse(name, "a whole number");
  // These variables begin the paths of the cache folders: a relative path would place them in whatever folder a program
  // runs in.
  const bool own = !value("VSPLAT_CACHE_DIR").empty() && !value("POCL_CACHE_DIR").empty();
  const auto is_absolute = [&](const char* name) {
    const std::string found = value(name);
    return found.empty() || std::filesystem::path(found).is_absolute();
  };
  if (!own && !is_absolute("XDG_CACHE_HOME")) refuse("XDG_CACHE_HOME", "an absolute path");
  if (!own && value("XDG_CACHE_HOME").empty() && !is_absolute("HOME")) refuse("HOME", "an absolute path");
  return out;
}

void unset_empty_variables() { sys::unset_if_empty("POCL_CACHE_DIR"); }

void check_environment() {
  unset_empty_variables();
  for (const VariableProblem& problem : environment_problems())
    fail(Status::usage, "{}: {}", problem.found, problem.mend);
}

}  // namespace vsplat
