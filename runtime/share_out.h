// Independent items of work, shared out over workers by how fast each of them is.
#pragma once
#include <cstddef>
#include <functional>
#include <vector>

#include "runtime/error.h"

namespace vsplat {

struct ShareOut {
  std::size_t items = 0;
  std::size_t workers = 1;
  // How many items may be begun beyond the first that is not done: bounds what waits for its turn in `done`. At least
  // `workers` are.
  std::size_t ahead = 0;
  // Which worker does each item, while it is there; empty: whichever is free.
  std::vector<std::size_t> owner = {};
  // Does an item: the first worker's on the calling thread, each other one's on a thread of its own. A worker that is
  // free takes the next item in order. An Error of its device (device, compile, memory) retires the worker, and another
  // does the item. Anything else that is thrown ends it all.
  std::function<void(std::size_t worker, std::size_t item)> work = {};
  // Told when all items up to this one are done: in order, one at a time, on any worker's thread. May be empty. What it
  // throws ends it all.
  std::function<void(std::size_t item)> done = {};
  // Told when a worker retires with an item that others do; one at a time. May be empty.
  std::function<void(std::size_t worker, std::size_t item, const Error& error)> lost = {};
};

// Waits for all. Rethrows what ended it, of several that of the first item; with no worker left the last one's error.
// Items that were begun then are finished and told first, as far as all before them are.
void share_out(const ShareOut& shared);

}  // namespace vsplat
