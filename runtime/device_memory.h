// How much memory all arenas of one opened device use; each stream of it has its own arena. Thread-safe.
#pragma once
#include <atomic>
#include <cstddef>
#include <memory>
#include <utility>

namespace vsplat {

class DeviceMemory {
 public:
  std::size_t used() const { return used_.load(std::memory_order_relaxed); }
  // Reserves `bytes` and returns true if the sum stays within `total`.
  bool take(std::size_t bytes, std::size_t total) {
    std::size_t now = used();
    do {
      if (bytes > total || now > total - bytes) return false;
    } while (!used_.compare_exchange_weak(now, now + bytes, std::memory_order_relaxed));
    return true;
  }
  void give_back(std::size_t bytes) { used_.fetch_sub(bytes, std::memory_order_relaxed); }

 private:
  std::atomic<std::size_t> used_{0};
};

// A reserved share of a device's memory, given back on destruction.
class DeviceShare {
 public:
  DeviceShare() = default;
  // Adopts bytes that take() has already reserved.
  DeviceShare(std::shared_ptr<DeviceMemory> memory, std::size_t bytes) : memory_(std::move(memory)), bytes_(bytes) {}
  DeviceShare(DeviceShare&& other) noexcept { swap(other); }
  DeviceShare& operator=(DeviceShare&& other) noexcept {
    DeviceShare taken(std::move(other));
    swap(taken);
    return *this;
  }
  DeviceShare(const DeviceShare&) = delete;
  DeviceShare& operator=(const DeviceShare&) = delete;
  ~DeviceShare() {
    if (memory_) memory_->give_back(bytes_);
  }

 private:
  void swap(DeviceShare& other) noexcept {
    std::swap(memory_, other.memory_);
    std::swap(bytes_, other.bytes_);
  }

  std::shared_ptr<DeviceMemory> memory_;
  std::size_t bytes_ = 0;
};

}  // namespace vsplat
