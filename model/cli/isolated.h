// Runs work that may end its process, as a driver that crashes does, in a process of its own, and again in another if
// that one is ended.
#pragma once
#include <functional>
#include <string>

#include "command.h"

namespace command {

// Watches for progress of the work; usable from any thread.
class Patience {
 public:
  // From now on ends this process if heard() is not called for so many seconds.
  void begin(double seconds);
  void heard();
};

// Continues in another process, and returns only there: with "" in the first one, and in each later one with a
// description of how the one before was ended. The parent waits, forwards a stop, and exits with the last one's exit
// code. Throws if one was killed from outside, if too many were ended, or if no process can be started.
std::string in_another_process(const Common& common, const std::string& called);

}  // namespace command
