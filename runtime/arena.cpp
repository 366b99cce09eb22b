#include "runtime/arena.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <deque>
#include <limits>
#include <mutex>

#include "runtime/device_memory.h"
#include "runtime/fail.h"
#include "runtime/opencl.h"
#include "runtime/option.h"
#include "runtime/rounding.h"
#include "runtime/system/host_memory.h"
#include "runtime/units.h"

namespace vsplat {

namespace {

// Pieces lie below `top`, with holes where some were given back. Holes are filled first, then `top` moves up. A virtual
// slab follows the same rule as the real one that is made from it, so a run allocates exactly as planned.
struct Slab {
  std::size_t capacity = 0;  // of a growing slab: its largest size so far
  std::size_t top = 0;
  bool growing = false;    // virtual: counted only
  std::size_t blocks = 0;  // alive
  std::unique_ptr<cl::Buffer> buffer;
  HostMemory reserved;
  DeviceShare share;
  std::map<std::size_t, std::size_t> free;  // the holes: offset -> size, neighbours merged

  void give_back(std::size_t offset, std::size_t size) {
    auto next = free.lower_bound(offset);
    if (next != free.end() && offset + size == next->first) {
      size += next->second;
      next = free.erase(next);
    }
    if (next != free.begin()) {
      const auto before = std::prev(next);
      if (before->first + before->second == offset) {
        offset = before->first;
        size += before->second;
        free.erase(before);
      }
    }
    if (offset + size == top)
      top = offset;
    else
      free.emplace(offset, size);
  }
};

// Slabs without a plan are at least this large, so that small tensors share one.
constexpr std::size_t least_slab = std::size_t{4} << 20;

}  // namespace

struct ArenaState {
  mutable std::mutex mutex;
  const cl::Context* context = nullptr;
  const cl::CommandQueue* queue = nullptr;
  bool is_virtual = false;
  ArenaLimits limits;
  std::deque<Slab> slabs;
  std::size_t live = 0, peak = 0, peak_live = 0;
  bool rounded = false;
  std::map<std::pair<std::size_t, std::size_t>, const Block*> guarded;  // by slab and offset

  std::size_t reserved() const {
    std::size_t sum = 0;
    for (const Slab& slab : slabs) sum += slab.capacity;
    return sum;
  }

  // Bytes that the device's other arenas use.
  std::size_t others() const { return limits.device ? limits.device->used() - reserved() : 0; }

  void note_peaks() {
    peak = std::max(peak, reserved());
    peak_live = std::max(peak_live, live);
  }

  void release(std::size_t slab, std::size_t offset, std::size_t size) {
    slabs[slab].give_back(offset, size);
    --slabs[slab].blocks;
    live -= size;
  }

  void make_buffer(Slab& slab, const std::string& what) const {
    if (limits.device) {
      if (!limits.device->take(slab.capacity, limits.total)) refuse(slab.capacity, what);
      slab.share = DeviceShare(limits.device, slab.capacity);
    }
    if (limits.on_host) slab.reserved = HostMemory("a buffer of the CPU device", static_cast<double>(slab.capacity));
    try {
      slab.buffer = std::make_unique<cl::Buffer>(*context, CL_MEM_READ_WRITE, slab.capacity);
      // A driver may allocate device memory for a buffer only when a command first uses it, and allocate separate
      // memory for a sub-buffer that is used before that. NVIDIA's driver 580 does so: releasing a 32 MiB sub-buffer
      // took 36 ms on an H100, but takes 1 us once a command has used the whole buffer.
      if (queue) queue->enqueueFillBuffer(*slab.buffer, cl_uint{0}, 0, std::min(slab.capacity, sizeof(cl_uint)));
    } catch (const cl::Error& e) {
      fail_cl(e, fmt::format("allocating {:.4g} GiB on the device", gib(slab.capacity)));
    }
  }

  [[noreturn]] void refuse(std::size_t size, const std::string& what) const {
    fail(Status::memory,
         "not enough device memory: {} needs {:.4g} GiB beside the {:.4g} GiB already reserved; {:.4g} GiB in all and "
         "{:.4g} GiB in one buffer may be used ({}, a smaller model or another device)",
         what, gib(size), gib(reserved() + others()), gib(limits.total), gib(limits.max_alloc), Option::max_memory);
  }

  void check_total(std::size_t more, const std::string& what) const {
    if (more > limits.max_alloc || others() + reserved() + more > limits.total) refuse(more, what);
  }
};

Block::Block(std::shared_ptr<ArenaState> arena, std::size_t slab, std::size_t offset, std::size_t size,
             std::size_t bytes, const std::string& what)
    : arena_(std::move(arena)), slab_(slab), guard_(arena_->limits.guard), bytes_(bytes) {
  offset_ = offset + guard_;
  size_ = size - 2 * guard_;
  Slab& home = arena_->slabs[slab];
  ++home.blocks;
  arena_->live += size;
  arena_->note_peaks();
  if (!home.buffer) return;
  try {
    make_buffer(*home.buffer);
  } catch (const Error&) {
    arena_->release(slab, offset, size);
    throw;
  }
  if (guard_) {
    what_ = what;
    arena_->guarded[{slab_, offset_}] = this;
  }
}

Block::Block(std::shared_ptr<Block> whole, std::size_t first, std::size_t bytes)
    : arena_(whole->arena_), whole_(std::move(whole)), slab_(whole_->slab_), guard_(0), bytes_(bytes) {
  offset_ = whole_->offset_ + first;
  size_ = std::max<std::size_t>(bytes, 1);
  if (first % arena_->limits.align != 0 || first + size_ > whole_->size_)
    fail(Status::internal, "{} bytes from {} on of a piece of {}", size_, first, whole_->size_);
  if (slab()) make_buffer(*slab());
}

Block::Block(std::unique_ptr<cl::Buffer> theirs, std::size_t bytes)
    : slab_(0), offset_(0), size_(bytes), guard_(0), bytes_(bytes), buffer_(std::move(theirs)) {}

void Block::make_buffer(const cl::Buffer& slab) {
  const cl_buffer_region region{offset_, size_};
  try {
    // A sub-buffer of the slab, since OpenCL has no sub-buffers of sub-buffers.
    buffer_ = std::make_unique<cl::Buffer>(
        cl::Buffer(slab).createSubBuffer(CL_MEM_READ_WRITE, CL_BUFFER_CREATE_TYPE_REGION, &region));
  } catch (const cl::Error& e) {
    fail_cl(e, fmt::format("a sub-buffer of {} bytes at {}", size_, offset_));
  }
}

Block::~Block() {
  if (whole_ || !arena_) return;
  const std::lock_guard lock(arena_->mutex);
  if (guard_) arena_->guarded.erase({slab_, offset_});
  arena_->release(slab_, offset_ - guard_, size_ + 2 * guard_);
}

const cl::Buffer* Block::slab() const {
  if (!arena_) return nullptr;
  const std::lock_guard lock(arena_->mutex);
  return arena_->slabs[slab_].buffer.get();
}

Arena::Arena(const cl::Context* context, ArenaLimits limits, const cl::CommandQueue* queue)
    : state_(std::make_shared<ArenaState>()) {
  state_->context = context;
  state_->queue = queue;
  state_->is_virtual = context == nullptr;
  state_->limits = limits;
}

std::shared_ptr<Block> Arena::allocate(std::size_t bytes, const std::string& what) {
  ArenaState& s = *state_;
  const std::lock_guard lock(s.mutex);
  const std::size_t eighth = s.rounded ? std::bit_floor(bytes) / 8 : 0;
  std::size_t size = round_up(std::max<std::size_t>(bytes, 1), std::max(s.limits.align, eighth));
  if (size > s.limits.max_alloc) size = round_up(bytes, s.limits.align);
  if (bytes > s.limits.max_alloc) s.refuse(bytes, what);
  size += 2 * s.limits.guard;
  const auto piece = [&](std::size_t slab, std::size_t offset) {
    return std::make_shared<Block>(state_, slab, offset, size, bytes, what);
  };

  // Best fit over all slabs; of equal ones the first, so that a plan and its run choose alike.
  std::size_t best_slab = 0, best_offset = 0, best_size = 0;

  for (std::size_t i = 0; i < s.slabs.size(); ++i)
    for (const auto& [offset, length] : s.slabs[i].free)
      if (length >= size && (best_size == 0 || length < best_size))
        best_slab = i, best_offset = offset, best_size = length;
  if (best_size) {
    auto& free = s.slabs[best_slab].free;
    free.erase(best_offset);
    if (best_size > size) free.emplace(best_offset + size, best_size - size);
    return piece(best_slab, best_offset);
  }

  for (std::size_t i = 0; i < s.slabs.size(); ++i) {
    Slab& slab = s.slabs[i];
    const std::size_t offset = slab.top;
    if (offset + size > (slab.growing ? s.limits.max_alloc : slab.capacity)) continue;
    slab.top = offset + size;
    slab.capacity = std::max(slab.capacity, slab.top);
    return piece(i, offset);
  }

  if (s.is_virtual) {
    Slab slab;
    slab.growing = true;
    slab.capacity = slab.top = size;
    s.slabs.push_back(std::move(slab));
    return piece(s.slabs.size() - 1, 0);
  }

  std::size_t capacity = std::max(size, least_slab);
  if (capacity > s.limits.max_alloc || s.others() + s.reserved() + capacity > s.limits.total) capacity = size;
  s.check_total(capacity, what);
  Slab slab;
  slab.capacity = capacity;
  slab.top = size;
  s.make_buffer(slab, what);
  s.slabs.push_back(std::move(slab));
  return piece(s.slabs.size() - 1, 0);
}

Arena Arena::plan(bool limited) const {
  auto copy = std::make_shared<ArenaState>();
  const std::lock_guard lock(state_->mutex);
  copy->is_virtual = true;
  copy->limits = state_->limits;
  copy->limits.device.reset();
  copy->limits.total -= std::min(state_->others(), copy->limits.total);
  if (!limited) copy->limits.total = copy->limits.max_alloc = std::numeric_limits<std::size_t>::max() / 4;
  copy->rounded = state_->rounded;
  copy->live = copy->peak_live = state_->live;
  for (const Slab& slab : state_->slabs) {
    Slab twin;
    twin.capacity = slab.capacity;
    twin.top = slab.top;
    twin.blocks = slab.blocks;
    twin.free = slab.free;
    copy->slabs.push_back(std::move(twin));
  }
  copy->peak = copy->reserved();
  return Arena(std::move(copy));
}

void Arena::commit(const Arena& planned) {
  ArenaState& s = *state_;
  const std::lock_guard lock(s.mutex);
  const auto& wanted = planned.state_->slabs;
  if (s.is_virtual)
    for (Slab& slab : s.slabs) slab.growing = false;  // as in the plan, so that the run takes the planned places
  std::size_t more = 0;
  for (std::size_t i = s.slabs.size(); i < wanted.size(); ++i) more += wanted[i].capacity;
  if (!s.is_virtual && s.others() + s.reserved() + more > s.limits.total) s.refuse(more, "the run");
  for (std::size_t i = s.slabs.size(); i < wanted.size(); ++i) {
    Slab slab;
    slab.capacity = wanted[i].capacity;
    if (!s.is_virtual) s.make_buffer(slab, "the run");
    s.slabs.push_back(std::move(slab));
  }
  s.note_peaks();
}

void Arena::trim() {
  // Blocks refer to slabs by index, so only trailing slabs are removed.
  const std::lock_guard lock(state_->mutex);
  auto& slabs = state_->slabs;
  while (!slabs.empty() && slabs.back().blocks == 0) slabs.pop_back();
}

std::size_t Arena::reserved() const {
  const std::lock_guard lock(state_->mutex);
  return state_->reserved();
}
std::size_t Arena::live() const {
  const std::lock_guard lock(state_->mutex);
  return state_->live;
}
std::size_t Arena::peak() const { return state_->peak; }
std::size_t Arena::peak_live() const { return state_->peak_live; }
void Arena::reset_peak() {
  const std::lock_guard lock(state_->mutex);
  state_->peak = state_->reserved();
  state_->peak_live = state_->live;
}
bool Arena::is_virtual() const { return state_->is_virtual; }
const ArenaLimits& Arena::limits() const { return state_->limits; }
std::vector<const Block*> Arena::guarded() const {
  std::vector<const Block*> out;
  for (const auto& [place, block] : state_->guarded) out.push_back(block);
  return out;
}

RoundedSizes::RoundedSizes(Arena& arena) : arena_(arena.state_), before_(arena_->rounded) { arena_->rounded = true; }
RoundedSizes::~RoundedSizes() { arena_->rounded = before_; }

}  // namespace vsplat
