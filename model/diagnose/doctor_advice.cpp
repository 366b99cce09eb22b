// Finds the faults in the examined facts, and how to mend each of them.
#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>

#include "model/diagnose/doctor.h"
#include "runtime/device.h"
#include "runtime/files/disk_cache.h"
#include "runtime/printable.h"
#include "runtime/system/environment.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;
using Findings = std::vector<Finding>;
using State = SeenDriver::State;

const char* const usual_folder = "/etc/OpenCL/vendors";

std::string quoted(const std::string& text) { return "\"" + printable(text) + "\""; }

bool crashes(const SeenDriver& seen) { return seen.state == State::crashed || seen.state == State::too_late; }

// The file or variable that lists the driver.
std::string name_of(const Looked& looked, const DriverEntry& entry) {
  if (!entry.file.empty()) return entry.file;
  const bool filenames = looked.entries.place != entry.library;
  return (filenames ? "OCL_ICD_FILENAMES" : looked.entries.variable) + "=" + entry.library;
}

// How to remove the entry.
std::string without(const DriverEntry& entry) {
  if (entry.file.empty()) return "remove it from that variable";
  return fmt::format(
      "remove the entry (`mv {0} {0}.off`), or set OCL_ICD_VENDORS to a folder that holds copies of the other entries",
      entry.file);
}

// The line that a driver's entry must contain, and in which file.
std::string entry_mend(const Looked& looked, const InstalledDriver& driver) {
  const bool own = looked.entries.folder && !looked.entries.variable.empty() && looked.entries.problem.empty();
  const std::string folder = own ? looked.entries.place : usual_folder;
  std::string out = fmt::format("write the line `{1}` into {0}/{2} (`mkdir -p {0} && echo {1} > {0}/{2}`)", folder,
                                driver.path, driver.entry);
  if (!own)
    out += fmt::format(
        "; if that folder cannot be written, use a file of that name in a folder of your own, with copies of the files "
        "in {}, and set OCL_ICD_VENDORS to that folder",
        folder);
  if (!driver.found)
    out += fmt::format("; and add {} to LD_LIBRARY_PATH, since the system does not look for libraries there",
                       fs::path(driver.path).parent_path().string());
  return out;
}

void look_at_place(const Looked& looked, Findings& out) {
  const DriverEntries& entries = looked.entries;
  if (!environment("OCL_ICD_FILENAMES").empty() && looked.loader.ocl_icd)
    out.push_back(
        {"variable_ignored", "OCL_ICD_FILENAMES",
         fmt::format("OCL_ICD_FILENAMES is set, but the loader here, {} (ocl-icd), ignores it", looked.loader.path),
         "set OCL_ICD_VENDORS to the library's path instead, or to a folder of entries"});
  const std::string place =
      entries.variable.empty() ? entries.place : fmt::format("{}={}", entries.variable, printable(entries.place));
  std::error_code error;
  if (!entries.problem.empty() && !entries.variable.empty()) {
    const bool usual = fs::is_directory(usual_folder, error);
    out.push_back({"variable_names_nothing", entries.variable,
                   fmt::format("{} {}: the loader looks for drivers there, and nowhere else", place, entries.problem),
                   fmt::format("`unset {}`{}, or set it to a folder of entries (*.icd)", entries.variable,
                               usual ? fmt::format(", so that the loader looks in {}", usual_folder) : "")});
  } else if (entries.entries.empty()) {
    std::string mend = "install a driver: of the GPU's vendor, or for a processor the Debian package pocl-opencl-icd";
    if (!looked.installed.empty()) mend = entry_mend(looked, looked.installed.front());
    out.push_back({"no_entry", entries.place,
                   fmt::format("{} {}: no entry names a driver to the loader", place,
                               entries.problem.empty() ? "holds no entry (*.icd)" : entries.problem),
                   mend});
  }
}

// "libcuda.so.1" of "libcuda.so.1: cannot open shared object file: No such file or directory"; "" of other errors.
std::string missing_of(const std::string& error) {
  const std::size_t at = error.find(": cannot open shared object file");
  return at == std::string::npos ? "" : error.substr(0, at);
}

Finding not_loaded(const Looked& looked, const LookedDriver& driver) {
  const std::string name = name_of(looked, driver.entry), &library = driver.entry.library;
  const std::string missing = missing_of(driver.seen.error), error = printable(driver.seen.error);
  const std::string bare = library.substr(0, library.find_last_not_of(" \t\r") + 1);
  if (bare != library && missing.starts_with(bare))
    return {"entry_wrong", name,
            fmt::format("{} names {}, with blanks or a carriage return at the end", name, quoted(library)),
            fmt::format("write the line `{}` into it, ended by a line end alone", printable(bare))};
  if (missing == library) {
    const std::vector<std::string> there = installed_libraries(fs::path(library).filename().string());
    return {"library_missing", name, fmt::format("{} names the library {}, which is not there", name, quoted(library)),
            there.empty() ? fmt::format("install the driver's package again, or {}", without(driver.entry))
                          : fmt::format("it is at {0}: write that line into {1}, or add {2} to LD_LIBRARY_PATH",
                                        there.front(), name, fs::path(there.front()).parent_path().string())};
  }
  if (missing.empty())
    return {
        "library_broken", name,
        fmt::format("{} names the library {}, which cannot be loaded: {}", name, quoted(library), error),
        fmt::format("install the driver's package again, of this system and processor, or {}", without(driver.entry))};
  const std::vector<std::string> there = installed_libraries(fs::path(missing).filename().string());
  return {
      "dependency_missing", name,
      fmt::format("{} names the library {}, which needs {}: that is not there", name, quoted(library), quoted(missing)),
      there.empty() ? fmt::format("install the package with {} (`apt-file search {}` finds it), or {}", missing,
                                  missing, without(driver.entry))
                    : fmt::format("it is at {}: add {} to LD_LIBRARY_PATH", there.front(),
                                  fs::path(there.front()).parent_path().string())};
}

void look_at_driver(const Looked& looked, const LookedDriver& driver, Findings& out) {
  const std::string name = name_of(looked, driver.entry), library = quoted(driver.entry.library);
  const SeenDriver& seen = driver.seen;
  if (!driver.entry.problem.empty()) {
    out.push_back({"entry_wrong", name, fmt::format("{} {}: it names no driver", name, driver.entry.problem),
                   "write the path of the driver's library into it, or delete it"});
    return;
  }
  const std::string said = seen.said.empty() ? "" : fmt::format("; the last that it printed: {}", seen.said);
  switch (seen.state) {
    case State::not_loaded:
      out.push_back(not_loaded(looked, driver));
      break;
    case State::no_driver:
      out.push_back(
          {"no_driver", name,
           fmt::format("{} names the library {}, which is no OpenCL driver: it has no {}", name, library, seen.error),
           without(driver.entry)});
      break;
    case State::crashed:
      out.push_back(
          {"driver_crashes", name,
           fmt::format(
               "{} names the library {}, which crashes {} ({}){}: every program that uses OpenCL here crashes with it",
               name, library, seen.doing, seen.error, said),
           "install another version of this driver; until then " + without(driver.entry)});
      break;
    case State::too_late:
      out.push_back({"driver_hangs", name,
                     fmt::format("{} names the library {}, which hangs {} ({}){}: every program that uses OpenCL here "
                                 "waits for it",
                                 name, library, seen.doing, seen.error, said),
                     "install another version of this driver; until then " + without(driver.entry)});
      break;
    case State::loaded:
      break;
  }
}

// Whether the entry is of this known driver.
bool is_of(const LookedDriver& driver, const InstalledDriver& known) {
  const auto stem = [](const std::string& path) {
    const std::string name = fs::path(path).filename().string();
    return name.substr(0, name.find(".so"));
  };
  return stem(driver.entry.library) == stem(known.path);
}

bool is_named(const Looked& looked, const InstalledDriver& known) {
  return std::any_of(looked.drivers.begin(), looked.drivers.end(),
                     [&](const LookedDriver& driver) { return is_of(driver, known); });
}

// Drivers for processors count only if no other driver offers a device.
void look_for_entries(const Looked& looked, Findings& out) {
  for (const InstalledDriver& known : looked.installed) {
    if (is_named(looked, known) || (!known.is_gpu && !looked.devices.empty())) continue;
    const bool said = std::any_of(out.begin(), out.end(), [&](const Finding& finding) {
      return finding.kind == "no_entry" && finding.mend.find(known.path) != std::string::npos;
    });
    if (said) continue;
    out.push_back({"library_without_entry", known.path,
                   fmt::format("{}: the driver of {} is there, but no entry names it to the loader, which looks in {}",
                               known.path, known.vendor, looked.entries.place),
                   entry_mend(looked, known)});
  }
}

bool has_gpu(const Looked& looked) {
  return std::any_of(looked.devices.begin(), looked.devices.end(),
                     [](const LookedDevice& device) { return device.seen.type == "gpu"; });
}

// If a GPU can be used, faults of other GPUs' files do not matter to this program.
void look_at_files(const Looked& looked, Findings& out) {
  const GpuFiles& files = looked.files;
  if (has_gpu(looked)) return;
  for (const auto* all : {&files.nvidia, &files.amd, &files.render})
    for (const DeviceFile& file : *all) {
      if (file.problem.empty()) continue;
      const std::string group = file.group.empty() || file.group == "root" ? "render" : file.group;
      std::string mend = fmt::format("`sudo usermod -aG {} $USER` and log in again", group);
      if (all == &files.nvidia) mend = fmt::format("`sudo chmod a+rw {}` (the driver's usual mode)", file.path);
      if (files.container)
        mend += all == &files.nvidia
                    ? "; a container: start it with `--gpus all`"
                    : fmt::format("; a container: start it with `--device {} --group-add {}`", file.path, group);
      out.push_back({"device_file", file.path,
                     fmt::format("{}: cannot be opened for reading and writing: {}", file.path, file.problem), mend});
    }
}

bool is_installed(const Looked& looked, const char* vendor) {
  return std::any_of(looked.installed.begin(), looked.installed.end(),
                     [&](const InstalledDriver& driver) { return driver.vendor == vendor; });
}

void look_at_nvidia(const Looked& looked, Findings& out) {
  const GpuFiles& files = looked.files;
  std::vector<std::string> cuda = installed_libraries("libcuda.so.1");
  std::erase_if(cuda, [](const std::string& path) {  // installed by CUDA, whatever the machine
    return path.find("/compat/") != std::string::npos || path.find("/stubs/") != std::string::npos;
  });
  const bool library = is_installed(looked, "NVIDIA");
  const std::string capabilities = environment("NVIDIA_DRIVER_CAPABILITIES");
  const bool computes = capabilities.empty() || capabilities.find("compute") != std::string::npos ||
                        capabilities.find("all") != std::string::npos;
  if (!files.nvidia_gpu() && (files.has_nvidia || library || !cuda.empty())) {
    const std::string what = library        ? looked.installed.front().path
                             : cuda.empty() ? "/proc/driver/nvidia"
                                            : cuda.front();
    out.push_back(
        {"no_gpu_files", "/dev/nvidia0",
         fmt::format("/dev/nvidia0 is not there, though {} is: this {} has no NVIDIA GPU to use",
                     files.has_nvidia ? "an NVIDIA GPU or its kernel's driver" : what,
                     files.container ? "container" : "system"),
         "a container: start it with `--gpus all` and `-e NVIDIA_DRIVER_CAPABILITIES=compute,utility` (Docker), or "
         "`--device nvidia.com/gpu=all` (Podman); otherwise `nvidia-smi` tells whether the kernel's driver runs"});
  } else if (files.nvidia_gpu() && !library) {
    out.push_back({"no_gpu_driver", "libnvidia-opencl.so.1",
                   "libnvidia-opencl.so.1 is in none of the usual folders, though there is an NVIDIA GPU",
                   "a container: start it with `-e NVIDIA_DRIVER_CAPABILITIES=compute,utility`; otherwise install the "
                   "driver's OpenCL part (Debian: nvidia-opencl-icd, of the driver's version)"});
  }
  if (files.has_nvidia && !computes)
    out.push_back({"container_flags", "NVIDIA_DRIVER_CAPABILITIES",
                   fmt::format("NVIDIA_DRIVER_CAPABILITIES={} is without compute: the container is not given the "
                               "driver's OpenCL part",
                               printable(capabilities)),
                   "start the container with `-e NVIDIA_DRIVER_CAPABILITIES=compute,utility`"});
}

void look_at_others(const Looked& looked, Findings& out) {
  const GpuFiles& files = looked.files;
  const bool amd = is_installed(looked, "AMD"), intel = is_installed(looked, "Intel");
  if (files.amd.empty() && (files.has_amd || amd) && !has_gpu(looked))
    out.push_back(
        {"no_gpu_files", "/dev/kfd",
         fmt::format("/dev/kfd is not there, though {} is", files.has_amd ? "an AMD GPU" : "AMD's driver"),
         "a container: start it with `--device /dev/kfd --device /dev/dri`; otherwise `sudo modprobe amdgpu`"});
  if (files.render.empty() && (files.has_intel || intel) && !has_gpu(looked))
    out.push_back({"no_gpu_files", "/dev/dri",
                   fmt::format("/dev/dri has no render node, though {} is there",
                               files.has_intel ? "an Intel GPU" : "Intel's driver"),
                   "a container: start it with `--device /dev/dri`; otherwise `sudo modprobe i915`, or xe"});
  if (files.has_amd && !amd && !has_gpu(looked))
    out.push_back({"no_gpu_driver", "libamdocl64.so",
                   "libamdocl64.so is in none of the usual folders, though there is an AMD GPU",
                   "install ROCm's OpenCL driver (rocm-opencl-runtime; Debian: rocm-opencl-icd), or Mesa's "
                   "(mesa-opencl-icd) and set RUSTICL_ENABLE=radeonsi"});
  if (files.has_intel && !intel && !has_gpu(looked))
    out.push_back({"no_gpu_driver", "libigdrcl.so",
                   "libigdrcl.so is in none of the usual folders, though there is an Intel GPU",
                   "install Intel's driver (Debian: intel-opencl-icd), or Mesa's (mesa-opencl-icd) and set "
                   "RUSTICL_ENABLE=iris"});
}

void look_at_variables(const Looked& looked, Findings& out) {
  for (const VariableProblem& problem : looked.variables)
    out.push_back({"variable", problem.name, problem.found, problem.mend});
}

void look_at_caches(const Looked& looked, Findings& out) {
  for (const Cache& cache : looked.caches) {
    const std::string from = cache.folder.variable.empty() ? "" : fmt::format(" ({} says so)", cache.folder.variable);
    const std::string own = cache.of == "PoCL" ? "POCL_CACHE_DIR" : "VSPLAT_CACHE_DIR";
    if (!cache.writable)
      out.push_back(
          {"cache_folder", cache.folder.path,
           fmt::format("{}: the folder in which {} keeps compiled kernels{} cannot be written: {}", cache.folder.path,
                       cache.of, from, cache.of == "PoCL" ? "PoCL gives no device" : "every run compiles them again"),
           fmt::format("set {} to a folder that can be written{}", own,
                       cache.folder.variable == own ? ""
                       : cache.folder.variable.empty()
                           ? ""
                           : fmt::format(", or {} to one above it", cache.folder.variable))});
    else if (cache.of == "vsplat" && !DiskCache().enabled())
      out.push_back({"cache_folder", cache.folder.path,
                     fmt::format("{}: others may write to this folder{}: no compiled kernel, self-test's verdict or "
                                 "table of tuned parameters is read from it or stored there",
                                 cache.folder.path, from),
                     fmt::format("`chmod go-w {}` if it is yours, or set {} to another", cache.folder.path, own)});
    for (const DamagedFile& file : cache.damaged)
      out.push_back(
          {"damaged_kernel", file.path,
           fmt::format("{}: a kernel that PoCL keeps compiled is damaged ({}), and programs that load it crash",
                       file.path, file.what),
           fmt::format("`rm -r {}`: PoCL compiles again; vsplat removes such a file itself before it computes",
                       file.path)});
  }
}

// Drivers that load without error but have no device: reported if they are for GPUs, or if there is no other device.
void look_at_empty(const Looked& looked, Findings& out) {
  for (const LookedDriver& driver : looked.drivers) {
    if (driver.seen.state != State::loaded || !driver.entry.problem.empty() || driver.seen.devices() > 0) continue;
    const auto known = std::find_if(looked.installed.begin(), looked.installed.end(),
                                    [&](const InstalledDriver& one) { return is_of(driver, one); });
    const bool gpu = known != looked.installed.end() && known->is_gpu;
    if (!gpu && !looked.devices.empty()) continue;
    const std::string name =
        driver.seen.platforms.empty() ? printable(driver.entry.library) : driver.seen.platforms[0].name;
    std::string mend = "check that its GPU is there and that this user may open the device's files";
    if (name == "rusticl")
      mend = "RUSTICL_ENABLE names the drivers that it may use: radeonsi, iris, nouveau; llvmpipe for a processor";
    if (name == "Portable Computing Language")
      mend = "check that its folder for compiled kernels can be written (POCL_CACHE_DIR)";
    for (const char* hides :
         {"CUDA_VISIBLE_DEVICES", "ROCR_VISIBLE_DEVICES", "HIP_VISIBLE_DEVICES", "GPU_DEVICE_ORDINAL"})
      if (gpu && std::getenv(hides)) mend += fmt::format("; {}={} may hide it", hides, printable(environment(hides)));
    out.push_back({"no_devices", name_of(looked, driver.entry),
                   fmt::format("{}: the driver {} is there, but gives no device", name_of(looked, driver.entry), name),
                   mend});
  }
}

void look_at_whole(const Looked& looked, Findings& out) {
  const bool explained = std::any_of(looked.drivers.begin(), looked.drivers.end(),
                                     [](const LookedDriver& driver) { return crashes(driver.seen); });
  if (crashes(looked.all) && !explained)
    out.push_back(
        {"loader_fails", looked.loader.path,
         fmt::format("{}: the loader {} {} ({}), though each driver alone does not", looked.loader.path,
                     looked.all.state == State::crashed ? "crashes" : "hangs", looked.all.doing, looked.all.error),
         "two drivers do not work together: set OCL_ICD_VENDORS to a folder with the entry of one of them"});
  const std::string wanted = environment("VSPLAT_DEVICE");
  std::vector<DeviceInfo> devices;
  std::string names;
  for (const LookedDevice& device : looked.devices) {
    DeviceInfo& info = devices.emplace_back();
    info.index = device.index, info.platform = device.platform, info.device = device.device;
    info.name = device.seen.name, info.platform_name = device.platform_name, info.vendor = device.seen.vendor;
    info.type = device.seen.type == "gpu"   ? DeviceType::gpu
                : device.seen.type == "cpu" ? DeviceType::cpu
                : device.seen.type == "acc" ? DeviceType::accelerator
                                            : DeviceType::other;
    names += fmt::format("{}{} ({})", names.empty() ? "" : ", ", info.index, info.name);
  }
  if (!wanted.empty() && !devices.empty() && that_match(wanted, devices).empty())
    out.push_back({"device_not_there", "VSPLAT_DEVICE",
                   fmt::format("VSPLAT_DEVICE={} names none of the devices: {}", printable(wanted), names),
                   "`unset VSPLAT_DEVICE`, or set it to an index or a part of a name"});
  if (looked.devices.empty() && out.empty())
    out.push_back({"no_device", looked.entries.place, "no driver gives a device",
                   "install a driver: of the GPU's vendor, or for a processor the Debian package pocl-opencl-icd"});
}

// A device may load without error and still compute wrong results.
void look_at_verdicts(const Looked& looked, Findings& out) {
  for (const LookedDevice& device : looked.devices)
    for (const StoredVerdict& kept : looked.verdicts) {
      const Verdict& verdict = kept.verdict;
      const std::string name = device.seen.name;
      if (verdict.fitness == Fitness::ok || printable(kept.device) != name ||
          printable(kept.driver) != device.seen.driver)
        continue;
      const std::string with = fmt::format("{} with driver {}", name, device.seen.driver),
                        test = fmt::format("the self-test of {} found: {}", verdict.date, verdict.worst);
      if (verdict.fitness == Fitness::unusable)
        out.push_back({"device_unusable", name, fmt::format("{} computes wrongly and is not opened, {}", with, test),
                       "install another version of its driver, or take another device; VSPLAT_SELFTEST=ignore uses it "
                       "all the same"});
      else
        out.push_back({"device_degraded", name,
                       fmt::format("{} computes some things wrongly, which are not used ({}), {}", with,
                                   in_words(verdict.off), test),
                       "install another version of its driver, and run the self-test again; until then, results are "
                       "right, but may take longer"});
    }
}

}  // namespace

std::vector<Finding> findings_of(const Looked& looked) {
  Findings out;
  look_at_place(looked, out);
  for (const LookedDriver& driver : looked.drivers) look_at_driver(looked, driver, out);
  look_for_entries(looked, out);
  look_at_nvidia(looked, out);
  look_at_others(looked, out);
  look_at_files(looked, out);
  look_at_variables(looked, out);
  look_at_caches(looked, out);
  look_at_empty(looked, out);
  look_at_whole(looked, out);
  look_at_verdicts(looked, out);
  return out;
}

}  // namespace vsplat
