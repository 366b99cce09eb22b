// vsplat devices: lists the devices to compute on.
#include <cstdio>
#include <nlohmann/json.hpp>
#include <vsplat/vsplat.hpp>

#include "command.h"

namespace command {
namespace {

const char* type_name(vsplat_device_type type) {
  switch (type) {
    case VSPLAT_DEVICE_CPU:
      return "cpu";
    case VSPLAT_DEVICE_GPU:
      return "gpu";
    case VSPLAT_DEVICE_ACCELERATOR:
      return "acc";
    case VSPLAT_DEVICE_OTHER:
      break;
  }
  return "other";
}

// In the notation of lspci and nvidia-smi; null if the driver does not report it.
nlohmann::ordered_json uuid_of(const vsplat_device_info& d) {
  if (!d.has_uuid) return nullptr;
  std::string out;
  for (int i = 0; i < 16; ++i) {
    char byte[4];
    std::snprintf(byte, sizeof byte, "%02x", d.uuid[i]);
    out += (i == 4 || i == 6 || i == 8 || i == 10 ? "-" : "") + std::string(byte);
  }
  return out;
}

nlohmann::ordered_json pci_of(const vsplat_device_info& d) {
  if (!d.has_pci) return nullptr;
  char out[32];
  std::snprintf(out, sizeof out, "%04x:%02x:%02x.%x", d.pci_domain, d.pci_bus, d.pci_device, d.pci_function);
  return out;
}

std::string limits_text(const vsplat_device_info& d) {
  return *d.limits ? std::string(" [VSPLAT_LIMITS=") + d.limits + "]" : "";
}

const char* fitness_of(const vsplat_device_info& d) {
  switch (d.fitness) {
    case VSPLAT_FITNESS_OK:
      return "ok";
    case VSPLAT_FITNESS_DEGRADED:
      return "degraded";
    case VSPLAT_FITNESS_UNUSABLE:
      return "unusable";
    default:
      return nullptr;
  }
}

std::string fitness_text(const vsplat_device_info& d) {
  if (!fitness_of(d) || d.fitness == VSPLAT_FITNESS_OK) return "";
  return std::string(" [its self-test: ") + fitness_of(d) + "]";
}

nlohmann::ordered_json json_of(const vsplat_device_info& d) {
  return {{"index", d.index},
          {"platform", d.platform},
          {"device", d.device},
          {"type", type_name(d.type)},
          {"name", d.name},
          {"vendor", d.vendor},
          {"driver", d.driver},
          {"version", d.version},
          {"platform_name", d.platform_name},
          {"memory", d.memory},
          {"max_alloc", d.max_alloc},
          {"local_memory", d.local_memory},
          {"max_work_group", d.max_work_group},
          {"compute_units", d.compute_units},
          {"event_profiling", d.event_profiling != 0},
          {"fp16", d.fp16 != 0},
          {"fp64", d.fp64 != 0},
          {"subgroups", d.subgroups != 0},
          {"uuid", uuid_of(d)},
          {"pci", pci_of(d)},
          {"limits", d.limits},
          {"fitness", fitness_of(d) ? nlohmann::ordered_json(fitness_of(d)) : nlohmann::ordered_json()}};
}

void list_devices(const Common& common) {
  const std::vector<vsplat_device_info> devices = vsplat::Device::list();
  if (devices.empty()) {
    if (common.json) std::printf("[]\n");
    const vsplat_device_options any = VSPLAT_DEVICE_OPTIONS_INIT;
    const vsplat::Device none(any);  // throws an error that says what is missing
    return;
  }
  if (common.json) {
    nlohmann::ordered_json out = nlohmann::ordered_json::array();
    for (const vsplat_device_info& d : devices) out.push_back(json_of(d));
    print_json(out);
    return;
  }
  std::printf("index  p:d  type   memory     largest    units  name (platform, driver)\n");
  for (const vsplat_device_info& d : devices)
    std::printf(
        "%5d  %d:%d  %-5s  %-9s  %-9s  %5d  %s (%s, %s)%s\n", d.index, d.platform, d.device, type_name(d.type),
        bytes_text(d.memory).c_str(), bytes_text(d.max_alloc).c_str(), d.compute_units, d.name, d.platform_name,
        d.driver,
        (fitness_text(d) + limits_text(d) + (d.event_profiling ? "" : " [profiles are timed on the host]")).c_str());
}

}  // namespace

void add_devices(CLI::App& app, Run& run) {
  auto common = std::make_shared<Common>();
  CLI::App* sub = app.add_subcommand("devices", "List the OpenCL devices");
  add_common(*sub, *common, {.device = false, .profile = false, .overwrite = false, .outside = false});
  sub->footer(
      "Examples:\n"
      "  vsplat devices\n"
      "  vsplat devices --json\n"
      "Choose one by index, platform:device, type, or a part of the name of the device, its platform or its vendor:\n"
      "  vsplat render scene.ply --cameras orbit:8 --images out/ --device 0:1\n"
      "  VSPLAT_DEVICE=pthread vsplat ...");
  sub->callback([common, &run] {
    run = [common] {
      set_up_library(*common);
      list_devices(*common);
    };
  });
}

}  // namespace command
