// Looks into an OpenCL driver from a separate process, because the driver may crash or hang.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

namespace vsplat {

struct SeenDevice {
  std::string type, name, vendor, driver;  // type: as in `vsplat devices`
  std::uint64_t memory = 0;                // bytes
};
struct SeenPlatform {
  std::string name, version;
  std::vector<SeenDevice> devices;
};

struct SeenDriver {
  enum class State {
    loaded,      // loaded and asked for all its devices, possibly none
    not_loaded,  // `error` says why
    no_driver,   // a library that lacks the function `error`
    crashed,     // by the signal or with the exit code in `error`
    too_late
  };
  State state = State::loaded;
  std::string path;   // where the library was found; "" if it was not loaded
  std::string error;  // error of the system's loader
  std::string doing;  // when it crashed or hung: "when it is loaded", "when it is asked for its devices"
  std::string said;   // the last line that it printed
  std::vector<SeenPlatform> platforms;

  std::size_t devices() const;
};

// Examines one driver library. `now`: resolves all of its symbols at once, as Khronos' loader does.
SeenDriver look_at_driver(const std::string& library, bool now, double seconds);
// Examines all drivers through the loader, as a program sees them.
SeenDriver look_at_loader(const std::string& loader, double seconds);

}  // namespace vsplat
