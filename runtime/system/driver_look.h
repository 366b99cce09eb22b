// What is in an OpenCL driver, seen from a process of its own: it may crash, or never come back.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

namespace vsplat {

struct SeenDevice {
  std::string type, name, vendor, driver;  // type: as `vsplat devices` has it
  std::uint64_t memory = 0;                // bytes
};
struct SeenPlatform {
  std::string name, version;
  std::vector<SeenDevice> devices;
};

struct SeenDriver {
  enum class State {
    loaded,      // and asked for all that it has, which may be nothing
    not_loaded,  // `error` says why
    no_driver,   // a library, but one without the function `error`
    crashed,     // of the signal or with the exit code `error`
    too_late
  };
  State state = State::loaded;
  std::string path;   // where the library was found; "" where it was not loaded
  std::string error;  // of the system's loader
  std::string doing;  // when it crashed or hung: "when it is loaded", "when it is asked for its devices"
  std::string said;   // the last line that it printed
  std::vector<SeenPlatform> platforms;

  std::size_t devices() const;
};

// One driver's library; `now`: all of its symbols are looked for at once, as Khronos' loader does.
SeenDriver look_at_driver(const std::string& library, bool now, double seconds);
// All of them by the loader, as a program has them.
SeenDriver look_at_loader(const std::string& loader, double seconds);

}  // namespace vsplat
