#include "model/diagnose/doctor.h"

#include "runtime/files/disk_cache.h"
#include "runtime/system/environment.h"

namespace vsplat {
namespace {

std::vector<LookedDevice> devices_of(const SeenDriver& all) {
  std::vector<LookedDevice> out;
  for (std::size_t p = 0; p < all.platforms.size(); ++p)
    for (std::size_t d = 0; d < all.platforms[p].devices.size(); ++d)
      out.push_back({static_cast<int>(out.size()), static_cast<int>(p), static_cast<int>(d), all.platforms[p].name,
                     all.platforms[p].devices[d]});
  return out;
}

bool has_pocl(const Looked& looked) {
  for (const LookedDriver& driver : looked.drivers)
    for (const SeenPlatform& platform : driver.seen.platforms)
      if (platform.name == "Portable Computing Language") return true;
  return false;
}

std::vector<Cache> caches_of(const Looked& looked) {
  std::vector<Cache> out;
  if (const CacheFolder own = own_cache(); !own.path.empty()) out.push_back({own, "vsplat", is_writable(own.path), {}});
  if (has_pocl(looked)) {
    const CacheFolder pocl = pocl_cache();
    out.push_back({pocl, "PoCL", is_writable(pocl.path), damaged_files(pocl.path)});
  }
  return out;
}

}  // namespace

Diagnosis diagnose(double seconds) {
  unset_empty_variables();
  Diagnosis out;
  Looked& looked = out.looked;
  looked.seconds = seconds;
  looked.loader = opencl_loader();
  looked.entries = driver_entries(looked.loader.ocl_icd);
  for (const DriverEntry& entry : looked.entries.entries) {
    LookedDriver& driver = looked.drivers.emplace_back();
    driver.entry = entry;
    if (entry.problem.empty()) driver.seen = look_at_driver(entry.library, !looked.loader.ocl_icd, seconds);
  }
  if (!looked.loader.path.empty()) looked.all = look_at_loader(looked.loader.path, 2 * seconds);
  looked.devices = devices_of(looked.all);
  looked.installed = installed_drivers();
  looked.files = gpu_files();
  looked.caches = caches_of(looked);
  looked.variables = environment_problems();
  if (environment("VSPLAT_SELFTEST") != "ignore") looked.verdicts = stored_verdicts();
  out.findings = findings_of(looked);
  return out;
}

}  // namespace vsplat
