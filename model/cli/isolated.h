// Work that may end its process, as a driver that crashes does: it is done in a process of its own, and once more in
// another where that one was ended.
#pragma once
#include <functional>
#include <string>

#include "command.h"

namespace command {

// Since when the work has been heard of last; of any thread.
class Patience {
 public:
  // Ends this process where nothing was heard for so many seconds. Until the process ends.
  void begin(double seconds);
  void heard();
};

// Goes on in another process, and returns there alone: with "" in the first one, and in each that follows with how the
// one before was ended, in words. This one waits, passes a stop on, and leaves with the exit code of the last. An error
// where one was killed from outside, where so many were ended that there must be something else, or none can be had.
std::string in_another_process(const Common& common, const std::string& called);

}  // namespace command
