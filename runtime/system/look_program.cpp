// vsplat-look: loads one OpenCL driver, or the loader with all of them, and prints what it finds. It is a separate
// program because drivers crash and hang; driver_look.h starts it.
//
//   vsplat-look driver|loader lazy|now LIBRARY PARENT
//
// It writes one fact a line to the third descriptor, with fields separated by tabs. Each is written at once, so that
// the output shows how far it came if it crashes.
#define CL_TARGET_OPENCL_VERSION 120
#define CL_USE_DEPRECATED_OPENCL_1_1_APIS
#include <CL/cl.h>
#include <CL/cl_icd.h>
#include <dlfcn.h>
#include <link.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cstdio>
#include <cstring>
#include <string>
#include <vector>

namespace {

void tell(const std::vector<std::string>& fields) {
  std::string line;
  for (const std::string& field : fields) {
    if (!line.empty()) line += '\t';
    for (const char c : field) line += static_cast<unsigned char>(c) < ' ' ? ' ' : c;
  }
  line += '\n';
  if (::write(3, line.data(), line.size()) < 0) ::_exit(3);
}

struct Functions {
  decltype(&::clGetPlatformInfo) platform_info = nullptr;
  decltype(&::clGetDeviceIDs) device_ids = nullptr;
  decltype(&::clGetDeviceInfo) device_info = nullptr;
};

template <class F>
F symbol(void* library, const char* name) {
  return reinterpret_cast<F>(::dlsym(library, name));
}

std::string text_of(cl_int code, const std::vector<char>& text) {
  return code == CL_SUCCESS ? std::string(text.data(), ::strnlen(text.data(), text.size())) : "";
}

std::string text(const Functions& f, cl_platform_id platform, cl_platform_info what) {
  std::vector<char> out(4096);
  return text_of(f.platform_info(platform, what, out.size(), out.data(), nullptr), out);
}

std::string text(const Functions& f, cl_device_id device, cl_device_info what) {
  std::vector<char> out(4096);
  return text_of(f.device_info(device, what, out.size(), out.data(), nullptr), out);
}

void tell_device(const Functions& f, cl_device_id device) {
  cl_device_type type = 0;
  cl_ulong memory = 0;
  f.device_info(device, CL_DEVICE_TYPE, sizeof type, &type, nullptr);
  f.device_info(device, CL_DEVICE_GLOBAL_MEM_SIZE, sizeof memory, &memory, nullptr);
  const char* name = type & CL_DEVICE_TYPE_GPU           ? "gpu"
                     : type & CL_DEVICE_TYPE_CPU         ? "cpu"
                     : type & CL_DEVICE_TYPE_ACCELERATOR ? "acc"
                                                         : "other";
  tell({"device", name, text(f, device, CL_DEVICE_NAME), text(f, device, CL_DEVICE_VENDOR),
        text(f, device, CL_DRIVER_VERSION), std::to_string(memory)});
}

void tell_platform(const Functions& f, cl_platform_id platform) {
  tell({"platform", text(f, platform, CL_PLATFORM_NAME), text(f, platform, CL_PLATFORM_VERSION)});
  cl_uint count = 0;
  const cl_int code = f.device_ids(platform, CL_DEVICE_TYPE_ALL, 0, nullptr, &count);
  if (code != CL_SUCCESS) tell({"no devices", std::to_string(code)});
  if (code != CL_SUCCESS || count == 0) return;
  std::vector<cl_device_id> devices(count);
  f.device_ids(platform, CL_DEVICE_TYPE_ALL, count, devices.data(), nullptr);
  for (cl_device_id device : devices) tell_device(f, device);
}

template <class Ids>
std::vector<cl_platform_id> platforms_of(Ids ids) {
  cl_uint count = 0;
  const cl_int code = ids(0, nullptr, &count);
  if (code != CL_SUCCESS) tell({"no platforms", std::to_string(code)});
  if (code != CL_SUCCESS || count == 0) return {};
  std::vector<cl_platform_id> out(count);
  ids(count, out.data(), nullptr);
  return out;
}

// Examines a driver as a loader does.
void look_at_driver(void* library) {
  const auto address = symbol<decltype(&::clGetExtensionFunctionAddress)>(library, "clGetExtensionFunctionAddress");
  if (!address) return tell({"no driver", "clGetExtensionFunctionAddress"});
  const auto function = [&](const char* name) {
    void* found = address(name);
    return found ? found : ::dlsym(library, name);
  };
  const auto ids = reinterpret_cast<decltype(&::clGetPlatformIDs)>(function("clIcdGetPlatformIDsKHR"));
  if (!ids) return tell({"no driver", "clIcdGetPlatformIDsKHR"});
  for (cl_platform_id platform : platforms_of(ids)) {
    const cl_icd_dispatch* dispatch = *reinterpret_cast<cl_icd_dispatch* const*>(platform);
    tell_platform({dispatch->clGetPlatformInfo, dispatch->clGetDeviceIDs, dispatch->clGetDeviceInfo}, platform);
  }
}

void look_at_loader(void* library) {
  const auto ids = symbol<decltype(&::clGetPlatformIDs)>(library, "clGetPlatformIDs");
  if (!ids) return tell({"no driver", "clGetPlatformIDs"});
  const Functions f = {symbol<decltype(&::clGetPlatformInfo)>(library, "clGetPlatformInfo"),
                       symbol<decltype(&::clGetDeviceIDs)>(library, "clGetDeviceIDs"),
                       symbol<decltype(&::clGetDeviceInfo)>(library, "clGetDeviceInfo")};
  for (cl_platform_id platform : platforms_of(ids)) tell_platform(f, platform);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 5) {
    std::fputs("vsplat-look: looks at one OpenCL driver for the library of vsplat, which starts it\n", stderr);
    return 2;
  }
  // A parent that had already ended sends no signal, so ask whether it is still there.
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (std::to_string(::getppid()) != argv[4]) return 2;
  const rlimit none = {0, 0};
  ::setrlimit(RLIMIT_CORE, &none);
  void* library = ::dlopen(argv[3], (std::strcmp(argv[2], "now") == 0 ? RTLD_NOW : RTLD_LAZY) | RTLD_LOCAL);
  if (!library) {
    const char* why = ::dlerror();
    tell({"not loaded", why ? why : "for an unknown reason"});
    return 0;
  }
  link_map* map = nullptr;
  if (::dlinfo(library, RTLD_DI_LINKMAP, &map) == 0 && map && map->l_name) tell({"loaded", map->l_name});
  if (std::strcmp(argv[1], "loader") == 0)
    look_at_loader(library);
  else
    look_at_driver(library);
  tell({"done"});
  std::fflush(nullptr);
  ::_exit(0);  // a driver's shutdown does not matter
}
