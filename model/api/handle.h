// What every handle of the C interface shares: a count, statuses from exceptions, and structs of either side's size.
#pragma once
#include <atomic>
#include <cstddef>
#include <cstring>
#include <new>
#include <string>

#include "runtime/fail.h"
#include "runtime/host_span.h"
#include "vsplat/vsplat.h"

namespace vsplat::api {

struct Counted {
  std::atomic<int> count{1};
};

template <class Handle>
void retain(Handle handle) {
  if (handle) handle->count.fetch_add(1, std::memory_order_relaxed);
}

template <class Handle>
void release(Handle handle) {
  if (handle && handle->count.fetch_sub(1, std::memory_order_acq_rel) == 1) delete handle;
}

// A handle that is kept alive.
template <class T, void (*Retain)(T), void (*Release)(T)>
class Kept {
 public:
  Kept() = default;
  explicit Kept(T handle) : handle_(handle) { Retain(handle_); }
  Kept(const Kept& other) : Kept(other.handle_) {}
  Kept& operator=(const Kept&) = delete;
  Kept& operator=(T handle) {
    Retain(handle);
    Release(handle_);
    handle_ = handle;
    return *this;
  }
  ~Kept() { Release(handle_); }
  T get() const { return handle_; }

 private:
  T handle_ = nullptr;
};

void set_last_error(const char* text) noexcept;

// What profiles call a function of the interface: "vsplat_views_load" is "views load".
std::string name_in_profiles(const char* function);

// Runs `body`; nothing that it throws gets past here. The caller's name is for profiles.
template <class F>
vsplat_status guarded(const F& body, const char* caller = __builtin_FUNCTION()) noexcept {
  try {
    const HostSpan span(HostKind::host, HostLog::of_process().on() ? name_in_profiles(caller) : "");
    body();
    return VSPLAT_OK;
  } catch (const Error& e) {
    set_last_error(e.what());
    return static_cast<vsplat_status>(e.status());
  } catch (const std::bad_alloc&) {
    set_last_error("not enough host memory");
    return VSPLAT_ERROR_MEMORY;
  } catch (const std::exception& e) {
    set_last_error(e.what());
    return VSPLAT_ERROR_INTERNAL;
  } catch (...) {
    set_last_error("an unknown exception");
    return VSPLAT_ERROR_INTERNAL;
  }
}

template <class T>
void need(const T* pointer, const char* what) {
  if (!pointer) fail(Status::usage, "{} is null", what);
}

// A pointer that comes in as an array of `count`.
template <class T>
void need_array(const T* pointer, std::size_t count, const char* what) {
  if (!pointer && count) fail(Status::usage, "{} is null, but its count is {}", what, count);
}

template <class T>
void check_size(const T& from, const char* what) {
  if (from.size < 2 * sizeof(std::size_t))
    fail(Status::usage, "{}.size is {}: start from the struct's _INIT macro", what, from.size);
}

// The caller's struct, whatever its size, over the defaults of this library's.
template <class T>
T taken(const T* from, const T& defaults, const char* what) {
  T out = defaults;
  if (!from) return out;
  check_size(*from, what);
  std::memcpy(&out, from, from->size < sizeof(T) ? from->size : sizeof(T));
  out.size = sizeof(T);
  return out;
}

// The i-th of a caller's structs, whose first one's size is the stride.
template <class T>
const T& element(const T* first, std::size_t i) {
  return *reinterpret_cast<const T*>(reinterpret_cast<const char*>(first) + i * first->size);
}

// That give() will have somewhere to write to; asked before what it gives is computed.
template <class T>
void need_room(const T* out, const char* what) {
  need(out, what);
  check_size(*out, what);
}

// What the caller's struct has room for; its size stays.
template <class T>
void give(T* out, const T& value, const char* what) {
  need_room(out, what);
  const std::size_t size = out->size;
  std::memcpy(out, &value, size < sizeof(T) ? size : sizeof(T));
  out->size = size;
}

// What a caller in C has put into an enum, which may be none of its values: C++ may not even load those as the enum.
template <class E>
int value_of(const E& from) {
  static_assert(sizeof(E) == sizeof(int));
  int out = 0;
  std::memcpy(&out, &from, sizeof out);
  return out;
}

// A copy that vsplat_text_free frees.
char* new_text(const std::string& text);

}  // namespace vsplat::api
