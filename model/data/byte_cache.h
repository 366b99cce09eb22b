// A least-recently-used cache limited by bytes. Thread-safe.
#pragma once
#include <cstddef>
#include <list>
#include <map>
#include <memory>
#include <mutex>

namespace vsplat {

template <class Key, class Value>
class ByteCache {
 public:
  explicit ByteCache(std::size_t most) : most_(most) {}

  // Null if the key is not cached.
  std::shared_ptr<const Value> find(const Key& key) {
    const std::lock_guard lock(mutex_);
    const auto at = where_.find(key);
    if (at == where_.end()) return nullptr;
    entries_.splice(entries_.begin(), entries_, at->second);
    return at->second->value;
  }

  // Evicts the least recently used entries until `bytes` more fit. A value larger than the whole cache is not stored.
  void put(const Key& key, std::shared_ptr<const Value> value, std::size_t bytes) {
    const std::lock_guard lock(mutex_);
    if (bytes > most_ || where_.count(key) != 0) return;
    while (bytes_ + bytes > most_) {
      bytes_ -= entries_.back().bytes;
      where_.erase(entries_.back().key);
      entries_.pop_back();
    }
    entries_.push_front({key, std::move(value), bytes});
    where_[key] = entries_.begin();
    bytes_ += bytes;
  }

  std::size_t bytes() const {
    const std::lock_guard lock(mutex_);
    return bytes_;
  }

 private:
  struct Entry {
    Key key;
    std::shared_ptr<const Value> value;
    std::size_t bytes;
  };
  mutable std::mutex mutex_;
  const std::size_t most_;
  std::size_t bytes_ = 0;
  std::list<Entry> entries_;  // most recently used first
  std::map<Key, typename std::list<Entry>::iterator> where_;
};

}  // namespace vsplat
