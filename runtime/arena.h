// Planned device memory. Each context has one arena. It hands out pieces (sub-buffers) of a few large slabs, best fit
// first, and takes a piece back as soon as its last handle is gone, on any thread; the caller must have waited for
// everything that still reads the piece. The same code runs with or without memory behind it: a *virtual* arena follows
// a dry run of the model and learns how large the slabs must be, `commit` then allocates them, and the real run fits
// exactly. Without a plan an arena grows slab by slab.
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

// A piece of device memory, given back to its arena on destruction.
class Block {
 public:
  // The arena has already reserved `size` bytes (red zones included) at `offset`; `what` asked for `bytes` of them.
  Block(std::shared_ptr<ArenaState> arena, std::size_t slab, std::size_t offset, std::size_t size, std::size_t bytes,
        const std::string& what);
  // A part of another block: `bytes` from `first` on, a multiple of the arena's `align`. The memory belongs to `whole`,
  // which lives as long as its parts do. There are no red zones between parts.
  Block(std::shared_ptr<Block> whole, std::size_t first, std::size_t bytes);
  // A buffer of `bytes` bytes that belongs to another owner, not to an arena.
  Block(std::unique_ptr<cl::Buffer> theirs, std::size_t bytes);
  ~Block();
  Block(const Block&) = delete;
  Block& operator=(const Block&) = delete;

  const cl::Buffer* buffer() const { return buffer_.get(); }  // null in a virtual arena
  std::size_t size() const { return size_; }

  // The place of a piece between red zones, without the zones, and what asked for how many bytes.
  const cl::Buffer* slab() const;
  std::size_t offset() const { return offset_; }
  std::size_t guard() const { return guard_; }
  std::size_t bytes() const { return bytes_; }
  const std::string& what() const { return what_; }

 private:
  void make_buffer(const cl::Buffer& slab);

  std::shared_ptr<ArenaState> arena_;
  std::shared_ptr<Block> whole_;  // the block that this is a part of; null: not a part
  std::size_t slab_, offset_, size_, guard_, bytes_;
  std::string what_;  // set only with red zones
  std::unique_ptr<cl::Buffer> buffer_;
};

struct ArenaLimits {
  std::size_t total = 0;      // limit of all slabs together, bytes
  std::size_t max_alloc = 0;  // bytes of the largest slab
  std::size_t align = 128;    // bytes
  // Width of the red zones on either side of a piece, for debugging (runtime/launch_checks.h): bytes, a multiple of
  // `align`.
  std::size_t guard = 0;
  bool on_host = false;                  // a CPU device: slabs also count against the host's memory
  std::shared_ptr<DeviceMemory> device;  // shared by the arenas whose sum `total` limits; null: this arena alone
};

class Arena {
 public:
  // A null `context` makes the arena virtual from the start. With a queue, which must outlive the arena's growth, each
  // new slab is made resident on the device at once (see arena.cpp).
  Arena(const cl::Context* context, ArenaLimits limits, const cl::CommandQueue* queue = nullptr);

  // Throws Error(memory), which names `what`, the bytes requested and available, and the limit.
  std::shared_ptr<Block> allocate(std::size_t bytes, const std::string& what);

  // A virtual copy with the current slabs and live blocks, which only counts further growth. Growth of a virtual arena
  // is fixed in its copy, as if committed, so a plan of the second half can follow a plan of the first. Without limits
  // it learns what would be used if memory were unlimited.
  Arena plan(bool limited = true) const;
  // Allocates the slabs that `planned` (from plan()) needs beyond the current ones.
  void commit(const Arena& planned);
  // Frees the slabs after the last one with a live piece.
  void trim();

  std::size_t reserved() const;   // bytes of all slabs now
  std::size_t live() const;       // bytes in use now
  std::size_t peak() const;       // most bytes of slabs since the start or reset_peak()
  std::size_t peak_live() const;  // most bytes in use since the start or reset_peak()
  void reset_peak();
  bool is_virtual() const;
  const ArenaLimits& limits() const;
  // The pieces with red zones, in the order of their addresses.
  std::vector<const Block*> guarded() const;

 private:
  friend class RoundedSizes;
  explicit Arena(std::shared_ptr<ArenaState> state) : state_(std::move(state)) {}
  std::shared_ptr<ArenaState> state_;
};

// While this object lives, pieces are rounded up by at most an eighth, so that sizes that vary a little between runs
// fit into the same places.
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
