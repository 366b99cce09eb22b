// Distributes independent items of work over workers, according to their speed.
#pragma once
#include <cstddef>
#include <functional>
#include <vector>

#include "runtime/error.h"

namespace vsplat {

struct ShareOut {
  std::size_t items = 0;
  std::size_t workers = 1;
  // How many items may be started beyond the first unfinished one; this bounds the results that wait for their turn in
  // `done`. At least `workers` items are always started.
  std::size_t ahead = 0;
  // The worker of each item, as long as it has not retired; empty: any free worker.
  std::vector<std::size_t> owner = {};
  // Processes an item: the first worker on the calling thread, the others on a thread each. A free worker takes the
  // next item in order. An Error of its device (device, compile, memory) retires the worker, and another worker repeats
  // the item. Any other exception ends the whole call.
  std::function<void(std::size_t worker, std::size_t item)> work = {};
  // Called when all items up to this one are finished: in order, one call at a time, on any worker's thread. May be
  // empty. An exception ends the whole call.
  std::function<void(std::size_t item)> done = {};
  // Called when a worker retires from an item that others will repeat; one call at a time. May be empty.
  std::function<void(std::size_t worker, std::size_t item, const Error& error)> lost = {};
};

// Waits for all workers. Rethrows the exception that ended the call; of several, that of the first item. With no worker
// left, throws the last worker's error. Before it throws, items that were started are finished, and `done` is called
// for them as far as all items before them are finished.
void share_out(const ShareOut& shared);

}  // namespace vsplat
