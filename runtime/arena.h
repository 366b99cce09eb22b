// Planned device memory. One arena per context hands out pieces (sub-buffers) of a few large slabs, best fit first,
// and takes them back as soon as their last handle is gone, on whichever thread: what others still read of it must have
// been waited for. The same code runs with or without memory behind it:
// a *virtual* arena follows a dry run of the model and so learns how large the slabs must be; `commit` then makes
// them, and the real run fits exactly. Without a plan an arena grows slab by slab.
#pragma once
#include <cstddef>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace cl {
class Buffer;
class CommandQueue;
class Context;
}  // namespace cl

namespace vsplat {

class DeviceMemory;
struct ArenaState;

// A piece of device memory; gives itself back when destroyed.
class Block {
 public:
  // `size`, red zones with it, is taken at `offset` already; `bytes` of it were asked for, by `what`.
  Block(std::shared_ptr<ArenaState> arena, std::size_t slab, std::size_t offset, std::size_t size, std::size_t bytes,
        const std::string& what);
  // `bytes` of another from `first` on, a multiple of the arena's `align`. They stay that one's, which lives as long as
  // its parts do; there are no red zones between these.
  Block(std::shared_ptr<Block> whole, std::size_t first, std::size_t bytes);
  // Another's buffer, of so many bytes: no arena's.
  Block(std::unique_ptr<cl::Buffer> theirs, std::size_t bytes);
  ~Block();
  Block(const Block&) = delete;
  Block& operator=(const Block&) = delete;

  const cl::Buffer* buffer() const { return buffer_.get(); }  // null in a virtual arena
  std::size_t size() const { return size_; }

  // Of a piece between red zones: where it lies, without them, and who asked for how much.
  const cl::Buffer* slab() const;
  std::size_t offset() const { return offset_; }
  std::size_t guard() const { return guard_; }
  std::size_t bytes() const { return bytes_; }
  const std::string& what() const { return what_; }

 private:
  void make_buffer(const cl::Buffer& slab);

  std::shared_ptr<ArenaState> arena_;
  std::shared_ptr<Block> whole_;  // of which this is a part; null: a piece of its own
  std::size_t slab_, offset_, size_, guard_, bytes_;
  std::string what_;  // kept between red zones only
  std::unique_ptr<cl::Buffer> buffer_;
};

struct ArenaLimits {
  std::size_t total = 0;      // bytes in all that may be used
  std::size_t max_alloc = 0;  // bytes of the largest slab
  std::size_t align = 128;    // bytes
  // Bytes on either side of a piece that belong to nobody: red zones, for debugging (runtime/launch_checks.h). A
  // multiple of `align`.
  std::size_t guard = 0;
  bool on_host = false;                  // a CPU's: slabs are reserved of the host's memory, too
  std::shared_ptr<DeviceMemory> device;  // of which `total` is, with other arenas; null: with none
};

class Arena {
 public:
  // `context` null: virtual from the start. With a queue, which must outlive the arena's growth, each new slab is made
  // resident on the device at once: see the .cpp.
  Arena(const cl::Context* context, ArenaLimits limits, const cl::CommandQueue* queue = nullptr);

  // Throws Error(memory), naming `what`, both figures and the limit.
  std::shared_ptr<Block> allocate(std::size_t bytes, const std::string& what);

  // A virtual copy with today's slabs and live blocks, whose further growth is only counted. What a virtual arena had
  // grown to stands fixed in the copy, as it would in a run that committed it: a plan of the second half follows one of
  // the first. Without limits: to learn what would be taken where there were enough.
  Arena plan(bool limited = true) const;
  // Makes the slabs that `planned` (from plan()) came to need beyond today's.
  void commit(const Arena& planned);
  // Gives back the slabs behind the last one in which something lives.
  void trim();

  std::size_t reserved() const;   // bytes of all slabs now
  std::size_t live() const;       // bytes in use now
  std::size_t peak() const;       // most bytes of slabs since the start or reset_peak()
  std::size_t peak_live() const;  // most bytes in use since the start or reset_peak()
  void reset_peak();
  bool is_virtual() const;
  const ArenaLimits& limits() const;
  // The pieces between red zones, in the order in which they lie.
  std::vector<const Block*> guarded() const;

 private:
  friend class RoundedSizes;
  explicit Arena(std::shared_ptr<ArenaState> state) : state_(std::move(state)) {}
  std::shared_ptr<ArenaState> state_;
};

// While it lives, pieces are made up to an eighth larger than asked for: sizes that differ little from one time to the
// next fit where the first ones were.
class RoundedSizes {
 public:
  explicit RoundedSizes(Arena& arena);
  ~RoundedSizes();
  RoundedSizes(const RoundedSizes&) = delete;
  RoundedSizes& operator=(const RoundedSizes&) = delete;

 private:
  std::shared_ptr<ArenaState> arena_;
  bool before_;
};

}  // namespace vsplat
