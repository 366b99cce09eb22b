// The one exception type of the library, and the statuses that cross the C boundary.
#pragma once
#include <stdexcept>
#include <string>

namespace vsplat {

// What kind of thing went wrong. Values equal those of `vsplat_status` in vsplat.h.
enum class Status : int {
  ok = 0,
  usage = 1,      // the request itself is wrong: an unknown option or field, a missing view (exit code 2)
  file = 2,       // a file cannot be read or written, or exists already
  format = 3,     // a file's content is damaged or not what its format says
  input = 4,      // well-formed input that cannot be used: a singular pose, a cube behind the cameras
  device = 5,     // no such device, no platform, a driver's error
  compile = 6,    // a kernel did not compile; the message holds the build log
  memory = 7,     // more memory is needed than there is; the message holds both figures
  cancelled = 8,  // the caller's progress function asked to stop
  internal = 9,   // a defect of ours
  busy = 10       // another call is using the device
};

// Carries one message for people: what was asked, what was found and where.
class Error : public std::runtime_error {
 public:
  Error(Status status, const std::string& message) : std::runtime_error(message), status_(status) {}
  Status status() const noexcept { return status_; }

 private:
  Status status_;
};

}  // namespace vsplat
