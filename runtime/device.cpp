#include "runtime/device.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cctype>
#include <cstdlib>
#include <iterator>

#include "runtime/device_handles.h"
#include "runtime/device_limits.h"
#include "runtime/fail.h"
#include "runtime/host_span.h"
#include "runtime/missing_devices.h"
#include "runtime/opencl.h"
#include "runtime/option.h"
#include "runtime/system/environment.h"
#include "runtime/system/environment_check.h"
#include "runtime/system/system.h"
#include "runtime/system/system_processor.h"

namespace vsplat {

const char* name_of(DeviceType type) {
  switch (type) {
    case DeviceType::cpu:
      return "cpu";
    case DeviceType::gpu:
      return "gpu";
    case DeviceType::accelerator:
      return "acc";
    case DeviceType::other:
      break;
  }
  return "other";
}

namespace {

std::atomic<int> first_user{0};  // the process that first used OpenCL

std::string trimmed(std::string text) {
  while (!text.empty() && (text.back() == '\0' || std::isspace(static_cast<unsigned char>(text.back()))))
    text.pop_back();
  const auto begin = std::find_if_not(text.begin(), text.end(), [](unsigned char c) { return std::isspace(c); });
  return {begin, text.end()};
}

std::string lower(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

DeviceType type_of(cl_device_type type) {
  if (type & CL_DEVICE_TYPE_GPU) return DeviceType::gpu;
  if (type & CL_DEVICE_TYPE_CPU) return DeviceType::cpu;
  if (type & CL_DEVICE_TYPE_ACCELERATOR) return DeviceType::accelerator;
  return DeviceType::other;
}

// See DeviceInfo::sub_group. Fewer than 8 work-items would leave vector lanes idle.
int least_sub_group(const cl::Device& device) {
  constexpr cl_device_info sizes_of = 0x4108;  // CL_DEVICE_SUB_GROUP_SIZES_INTEL
  std::size_t bytes = 0, sizes[16] = {};
  if (device.getInfo<CL_DEVICE_TYPE>() != CL_DEVICE_TYPE_GPU) return 0;
  if (clGetDeviceInfo(device(), sizes_of, sizeof sizes, sizes, &bytes) != CL_SUCCESS) return 0;
  std::size_t least = 0;
  for (std::size_t i = 0; i < bytes / sizeof *sizes; ++i)
    if (sizes[i] >= 8 && (least == 0 || sizes[i] < least)) least = sizes[i];
  return static_cast<int>(least);
}

// Constants of extensions; some are missing from Debian's headers.
constexpr cl_device_info kUuid = 0x106A;          // CL_DEVICE_UUID_KHR: 16 bytes
constexpr cl_device_info kPciBusInfo = 0x410F;    // CL_DEVICE_PCI_BUS_INFO_KHR: domain, bus, device, function
constexpr cl_device_info kNvidiaBus = 0x4008;     // CL_DEVICE_PCI_BUS_ID_NV
constexpr cl_device_info kNvidiaSlot = 0x4009;    // CL_DEVICE_PCI_SLOT_ID_NV: device * 8 + function
constexpr cl_device_info kNvidiaDomain = 0x400A;  // CL_DEVICE_PCI_DOMAIN_ID_NV
constexpr cl_device_info kAmdTopology =
    0x4037;  // CL_DEVICE_TOPOLOGY_AMD: 24 bytes, the last three bus, device, function

template <class T>
std::optional<T> info_of(const cl::Device& device, cl_device_info what) {
  T out{};
  if (clGetDeviceInfo(device(), what, sizeof out, &out, nullptr) != CL_SUCCESS) return std::nullopt;
  return out;
}

std::optional<PciAddress> pci_of(const cl::Device& device, const std::string& extensions) {
  const auto has = [&](const char* name) {
    return extensions.find(std::string(" ") + name + " ") != std::string::npos;
  };
  if (has("cl_khr_pci_bus_info"))
    if (const auto at = info_of<std::array<cl_uint, 4>>(device, kPciBusInfo))
      return PciAddress{(*at)[0], (*at)[1], (*at)[2], (*at)[3]};
  if (has("cl_nv_device_attribute_query")) {
    const auto bus = info_of<cl_uint>(device, kNvidiaBus), slot = info_of<cl_uint>(device, kNvidiaSlot);
    if (bus && slot)
      return PciAddress{info_of<cl_uint>(device, kNvidiaDomain).value_or(0), *bus, *slot >> 3, *slot & 7u};
  }
  if (has("cl_amd_device_attribute_query"))
    if (const auto at = info_of<std::array<std::uint8_t, 24>>(device, kAmdTopology); at && (*at)[0] == 1)  // PCIe
      return PciAddress{0, (*at)[21], (*at)[22], (*at)[23]};
  return std::nullopt;
}

DeviceInfo describe(const cl::Platform& platform, const cl::Device& device) {
  DeviceInfo d;
  d.name = trimmed(device.getInfo<CL_DEVICE_NAME>());
  d.vendor = trimmed(device.getInfo<CL_DEVICE_VENDOR>());
  d.driver = trimmed(device.getInfo<CL_DRIVER_VERSION>());
  d.version = trimmed(device.getInfo<CL_DEVICE_VERSION>());
  d.platform_name = trimmed(platform.getInfo<CL_PLATFORM_NAME>());
  d.platform_version = trimmed(platform.getInfo<CL_PLATFORM_VERSION>());
  d.type = type_of(device.getInfo<CL_DEVICE_TYPE>());
  d.memory = device.getInfo<CL_DEVICE_GLOBAL_MEM_SIZE>();
  d.max_alloc = device.getInfo<CL_DEVICE_MAX_MEM_ALLOC_SIZE>();
  d.local_memory = device.getInfo<CL_DEVICE_LOCAL_MEM_SIZE>();
  d.local_is_fast = device.getInfo<CL_DEVICE_LOCAL_MEM_TYPE>() == CL_LOCAL;
  d.max_work_group = device.getInfo<CL_DEVICE_MAX_WORK_GROUP_SIZE>();
  if (const auto sizes = device.getInfo<CL_DEVICE_MAX_WORK_ITEM_SIZES>(); !sizes.empty())
    d.max_work_group = std::min(d.max_work_group, sizes[0]);
  d.compute_units = static_cast<int>(device.getInfo<CL_DEVICE_MAX_COMPUTE_UNITS>());
  d.native_float_width = static_cast<int>(device.getInfo<CL_DEVICE_NATIVE_VECTOR_WIDTH_FLOAT>());
  d.address_bits = static_cast<int>(device.getInfo<CL_DEVICE_ADDRESS_BITS>());
  d.align = std::max(static_cast<int>(device.getInfo<CL_DEVICE_MEM_BASE_ADDR_ALIGN>() / 8), 128);
  d.event_profiling = (device.getInfo<CL_DEVICE_QUEUE_PROPERTIES>() & CL_QUEUE_PROFILING_ENABLE) != 0;
  const std::string extensions = " " + device.getInfo<CL_DEVICE_EXTENSIONS>() + " ";
  d.fp16 = extensions.find(" cl_khr_fp16 ") != std::string::npos;
  d.fp64 = extensions.find(" cl_khr_fp64 ") != std::string::npos;
  d.subgroups = extensions.find(" cl_khr_subgroups ") != std::string::npos;
  if (extensions.find(" cl_intel_required_subgroup_size ") != std::string::npos) d.sub_group = least_sub_group(device);
  const std::pair<const char*, std::vector<MatrixUnit>> units[] = {
      {" cl_nv_device_attribute_query ", {MatrixUnit::ptx}},
      {" cl_intel_subgroup_matrix_multiply_accumulate ", {MatrixUnit::dpas}},
      {" cl_amd_device_attribute_query ", {MatrixUnit::wmma, MatrixUnit::mfma}}};
  for (const auto& [extension, of] : units)
    if (extensions.find(extension) != std::string::npos) d.matrix_units = of;
  // A CPU device computes in this process: its instructions are the processor's.
  if (d.type == DeviceType::cpu && has_avx512bf16()) {
    d.matrix_units = {MatrixUnit::avx512bf16};
    if (may_use_amx()) d.matrix_units.insert(d.matrix_units.begin(), MatrixUnit::amx);
  }
  if (extensions.find(" cl_khr_device_uuid ") != std::string::npos)
    d.uuid = info_of<std::array<std::uint8_t, 16>>(device, kUuid);
  d.pci = pci_of(device, extensions);
  d.is_pocl = d.platform_name == "Portable Computing Language";
  // On a GPU with many units a short launch would end while most units wait for the last one, and half a second is more
  // operations there; a CPU with few cores does fewer operations in a twentieth of a second.
  if (d.type == DeviceType::gpu) d.most_flops *= std::max(1.0, d.compute_units / 16.0);
  if (d.type == DeviceType::cpu) d.most_flops *= std::min(1.0, d.compute_units / 8.0);
  lower(d, environment("VSPLAT_LIMITS"));
  return d;
}

std::string menu(const std::vector<DeviceInfo>& devices) {
  std::string text;
  for (const DeviceInfo& d : devices)
    text += fmt::format("\n  {}  {}:{}  {}  {}", d.index, d.platform, d.device, name_of(d.type), d.name);
  return text;
}

bool number(const std::string& text) {
  return !text.empty() && text.size() < 6 &&
         std::all_of(text.begin(), text.end(), [](unsigned char c) { return std::isdigit(c); });
}

bool is_type(const std::string& key) { return key == "cpu" || key == "gpu" || key == "acc"; }

}  // namespace

std::vector<FoundDevice> find_devices() {
  const HostSpan span(HostKind::host, "look for devices");
  std::vector<cl::Platform> platforms;
  try {
    cl::Platform::get(&platforms);
  } catch (const cl::Error&) {  // how the loader reports that there is no platform
    return {};
  }
  std::vector<FoundDevice> out;
  for (std::size_t p = 0; p < platforms.size(); ++p) {
    std::vector<cl::Device> devices;
    try {
      platforms[p].getDevices(CL_DEVICE_TYPE_ALL, &devices);
    } catch (const cl::Error&) {  // a platform without devices
      continue;
    }
    for (std::size_t i = 0; i < devices.size(); ++i) {
      try {
        DeviceInfo info = describe(platforms[p], devices[i]);
        info.index = static_cast<int>(out.size());
        info.platform = static_cast<int>(p);
        info.device = static_cast<int>(i);
        out.push_back({info, devices[i]});
      } catch (const cl::Error&) {  // skip a device that its own driver cannot describe
      }
    }
  }
  return out;
}

bool is_forked() {
  const int first = first_user;
  return first != 0 && first != sys::process_id();
}

void refuse_after_fork() {
  int nobody = 0;
  first_user.compare_exchange_strong(nobody, sys::process_id());
  if (is_forked())
    fail(Status::device,
         "process {} forked after it had used OpenCL, and OpenCL's drivers do not work in the child: fork before, or "
         "start a new program there",
         static_cast<int>(first_user));
}

std::vector<DeviceInfo> list_devices() {
  refuse_after_fork();
  check_environment();
  std::vector<DeviceInfo> out;
  for (const FoundDevice& found : find_devices()) out.push_back(found.info);
  return out;
}

std::vector<DeviceInfo> that_match(const std::string& spec, const std::vector<DeviceInfo>& devices) {
  const std::string key = lower(spec);
  const std::size_t colon = key.find(':');
  const bool pair = colon != std::string::npos && number(key.substr(0, colon)) && number(key.substr(colon + 1));
  const auto those = [&](const auto& matches) {
    std::vector<DeviceInfo> out;
    std::copy_if(devices.begin(), devices.end(), std::back_inserter(out), matches);
    return out;
  };
  if (number(key)) return those([&](const DeviceInfo& d) { return d.index == std::stoi(key); });
  if (pair)
    return those([&](const DeviceInfo& d) {
      return d.platform == std::stoi(key.substr(0, colon)) && d.device == std::stoi(key.substr(colon + 1));
    });
  if (is_type(key)) return those([&](const DeviceInfo& d) { return key == name_of(d.type); });
  const auto has = [&](const std::string& text) { return lower(text).find(key) != std::string::npos; };
  return those([&](const DeviceInfo& d) { return has(d.name) || has(d.platform_name) || has(d.vendor); });
}

DeviceInfo choose_device(const std::string& asked) {
  const std::vector<DeviceInfo> devices = list_devices();
  if (devices.empty()) fail(Status::device, "no OpenCL device: {}; {} tells more", why_no_device(), Option::doctor);
  std::string spec = trimmed(asked);
  std::string from = option_name(Option::device);
  if (spec.empty()) {
    if (const char* env = std::getenv("VSPLAT_DEVICE")) spec = trimmed(env);
    from = "VSPLAT_DEVICE";
  }
  if (spec.empty()) {
    for (const DeviceInfo& d : devices)
      if (d.type == DeviceType::gpu) return d;
    return devices.front();
  }
  const std::vector<DeviceInfo> matching = that_match(spec, devices);
  if (!matching.empty() && (is_type(lower(spec)) || matching.size() == 1)) return matching.front();
  if (!matching.empty())
    fail(Status::device, "\"{}\" ({}) is a part of the names of {} devices: choose one by its index{}", spec, from,
         matching.size(), menu(matching));
  const std::string missing = unusable_drivers();
  fail(Status::device,
       "no device is \"{}\" ({}): it is neither an index, a platform:device, a type (cpu, gpu, acc) nor a part of the "
       "name of a device, its platform or its vendor. The devices are:{}{}",
       spec, from, menu(devices), missing.empty() ? "" : "\nBesides, " + missing);
}

const char* cl_error_name(cl_int code) {
  switch (code) {
    case CL_SUCCESS:
      return "CL_SUCCESS";
    case CL_DEVICE_NOT_FOUND:
      return "CL_DEVICE_NOT_FOUND";
    case CL_DEVICE_NOT_AVAILABLE:
      return "CL_DEVICE_NOT_AVAILABLE";
    case CL_COMPILER_NOT_AVAILABLE:
      return "CL_COMPILER_NOT_AVAILABLE";
    case CL_MEM_OBJECT_ALLOCATION_FAILURE:
      return "CL_MEM_OBJECT_ALLOCATION_FAILURE";
    case CL_OUT_OF_RESOURCES:
      return "CL_OUT_OF_RESOURCES";
    case CL_OUT_OF_HOST_MEMORY:
      return "CL_OUT_OF_HOST_MEMORY";
    case CL_PROFILING_INFO_NOT_AVAILABLE:
      return "CL_PROFILING_INFO_NOT_AVAILABLE";
    case CL_BUILD_PROGRAM_FAILURE:
      return "CL_BUILD_PROGRAM_FAILURE";
    case CL_MISALIGNED_SUB_BUFFER_OFFSET:
      return "CL_MISALIGNED_SUB_BUFFER_OFFSET";
    case CL_INVALID_VALUE:
      return "CL_INVALID_VALUE";
    case CL_INVALID_DEVICE:
      return "CL_INVALID_DEVICE";
    case CL_INVALID_CONTEXT:
      return "CL_INVALID_CONTEXT";
    case CL_INVALID_COMMAND_QUEUE:
      return "CL_INVALID_COMMAND_QUEUE";
    case CL_INVALID_MEM_OBJECT:
      return "CL_INVALID_MEM_OBJECT";
    case CL_INVALID_BINARY:
      return "CL_INVALID_BINARY";
    case CL_INVALID_BUILD_OPTIONS:
      return "CL_INVALID_BUILD_OPTIONS";
    case CL_INVALID_PROGRAM:
      return "CL_INVALID_PROGRAM";
    case CL_INVALID_KERNEL_NAME:
      return "CL_INVALID_KERNEL_NAME";
    case CL_INVALID_KERNEL:
      return "CL_INVALID_KERNEL";
    case CL_INVALID_ARG_INDEX:
      return "CL_INVALID_ARG_INDEX";
    case CL_INVALID_ARG_VALUE:
      return "CL_INVALID_ARG_VALUE";
    case CL_INVALID_ARG_SIZE:
      return "CL_INVALID_ARG_SIZE";
    case CL_INVALID_KERNEL_ARGS:
      return "CL_INVALID_KERNEL_ARGS";
    case CL_INVALID_WORK_DIMENSION:
      return "CL_INVALID_WORK_DIMENSION";
    case CL_INVALID_WORK_GROUP_SIZE:
      return "CL_INVALID_WORK_GROUP_SIZE";
    case CL_INVALID_WORK_ITEM_SIZE:
      return "CL_INVALID_WORK_ITEM_SIZE";
    case CL_INVALID_GLOBAL_OFFSET:
      return "CL_INVALID_GLOBAL_OFFSET";
    case CL_INVALID_BUFFER_SIZE:
      return "CL_INVALID_BUFFER_SIZE";
    case CL_INVALID_GLOBAL_WORK_SIZE:
      return "CL_INVALID_GLOBAL_WORK_SIZE";
    default:
      return "an unnamed error";
  }
}

}  // namespace vsplat
