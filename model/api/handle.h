// What all handles of the C interface share: reference counts, statuses from exceptions, and structs of older or newer
// callers.
#pragma once
#include <array>
#include <atomic>
#include <cstddef>
#include <cstring>
#include <functional>
#include <new>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "model/api/struct_fields.h"
#include "runtime/fail.h"
#include "runtime/host_span.h"
#include "vsplat/vsplat.h"

namespace vsplat::api {

struct Counted {
  std::atomic<int> count{1};
};

// True for the types that handles point to. (Listed by name, since most sources see only their declarations.)
template <class T>
inline constexpr bool is_handle = false;
#define VSPLAT_HANDLE(T) \
  template <>            \
  inline constexpr bool is_handle<T> = true
VSPLAT_HANDLE(vsplat_animation_impl);
VSPLAT_HANDLE(vsplat_cameras_impl);
VSPLAT_HANDLE(vsplat_dataset_impl);
VSPLAT_HANDLE(vsplat_device_impl);
VSPLAT_HANDLE(vsplat_evaluation_impl);
VSPLAT_HANDLE(vsplat_input_impl);
VSPLAT_HANDLE(vsplat_job_impl);
VSPLAT_HANDLE(vsplat_mesh_impl);
VSPLAT_HANDLE(vsplat_model_impl);
VSPLAT_HANDLE(vsplat_fit_impl);
VSPLAT_HANDLE(vsplat_scene_impl);
VSPLAT_HANDLE(vsplat_sheet_impl);
VSPLAT_HANDLE(vsplat_views_impl);
#undef VSPLAT_HANDLE

template <class Handle>
void retain(Handle handle) {
  if (handle) handle->count.fetch_add(1, std::memory_order_relaxed);
}

template <class Handle>
void release(Handle handle) {
  if (handle && handle->count.fetch_sub(1, std::memory_order_acq_rel) == 1) delete handle;
}

// Keeps a handle alive.
template <class T, void (*Retain)(T), void (*Release)(T)>
class HandleRef {
 public:
  HandleRef() = default;
  explicit HandleRef(T handle) : handle_(handle) { Retain(handle_); }
  HandleRef(const HandleRef& other) : HandleRef(other.handle_) {}
  HandleRef& operator=(const HandleRef&) = delete;
  HandleRef& operator=(T handle) {
    Retain(handle);
    Release(handle_);
    handle_ = handle;
    return *this;
  }
  ~HandleRef() { Release(handle_); }
  T get() const { return handle_; }

 private:
  T handle_ = nullptr;
};

// Holds the handles passed to a call until it returns, even if a callback or another thread releases them meanwhile.
// guarded() makes one for each call; need() adds the handles.
class Holding {
 public:
  Holding() noexcept : outer_(innermost()) { innermost() = this; }
  ~Holding() {
    while (count_ > 0) drop_last();
    innermost() = outer_;
  }
  Holding(const Holding&) = delete;
  Holding& operator=(const Holding&) = delete;

  // Adds to this thread's innermost call; outside of calls nothing is held.
  template <class Impl>
  static void hold(Impl* handle) {
    if (Holding* const call = innermost()) call->add(handle, [](void* held) { release(static_cast<Impl*>(held)); });
  }

 private:
  using Held = std::pair<void*, void (*)(void*)>;
  static Holding*& innermost() noexcept;
  template <class Impl>
  void add(Impl* handle, void (*drop)(void*)) {
    if (count_ < few_.size())
      few_[count_] = {handle, drop};
    else
      more_.emplace_back(handle, drop);
    ++count_;
    retain(handle);
  }
  void drop_last() {
    --count_;
    const Held last = count_ < few_.size() ? few_[count_] : more_.back();
    if (count_ >= few_.size()) more_.pop_back();
    last.second(last.first);
  }

  Holding* outer_;
  std::size_t count_ = 0;
  std::array<Held, 6> few_{};
  std::vector<Held> more_;
};

void set_last_error(const char* text) noexcept;

// A function's name in profiles: "vsplat_views_load" becomes "views load".
std::string name_in_profiles(const char* function);

// Runs `body` and turns every exception into a status. The caller's name is recorded in profiles.
template <class F>
vsplat_status guarded(const F& body, const char* caller = __builtin_FUNCTION()) noexcept {
  const Holding held;
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

// Like need() above, for a handle: also holds it until the call returns.
template <class T>
void need(T* pointer, const char* what) {
  if (!pointer) fail(Status::usage, "{} is null", what);
  if constexpr (is_handle<T>) Holding::hold(pointer);
}

// Fails if so many elements of so many bytes cannot be in memory.
void check_count(std::size_t count, std::size_t bytes, const char* what);

// Checks a pointer to an array of `count` elements.
template <class T>
void need_array(const T* pointer, std::size_t count, const char* what) {
  if (!pointer && count) fail(Status::usage, "{} is null, but its count is {}", what, count);
  // An array may be one of handles, which are pointers.
  if constexpr (!std::is_void_v<T>) check_count(count, sizeof(T), what);  // NOLINT(bugprone-sizeof-expression)
}

// Checks the size of a caller's struct. It may be older or newer than this library's, but its size may not end within a
// field.
template <class T>
void check_size(const T& from, const char* what) {
  check_struct_size(from.size, sizeof(T), long_fields<T>(), what);
}

// Copies the caller's struct, whatever its size, over this library's defaults.
template <class T>
T taken(const T* from, const T& defaults, const char* what) {
  T out = defaults;
  if (!from) return out;
  check_size(*from, what);
  std::memcpy(&out, from, from->size < sizeof(T) ? from->size : sizeof(T));
  out.size = sizeof(T);
  return out;
}

// Checks a caller's array of structs: all have the first one's size, which is the stride.
template <class T>
void need_structs(const T* first, std::size_t count, const char* what) {
  need_array(first, count, what);
  if (count == 0) return;
  check_size(*first, what);
  check_count(count, first->size, what);
}

// The i-th struct of such an array.
template <class T>
const T& element(const T* first, std::size_t i, const char* what) {
  const T& out = *reinterpret_cast<const T*>(reinterpret_cast<const char*>(first) + i * first->size);
  if (out.size != first->size)
    fail(Status::usage, "{0}[{1}].size is {2}: {3} expected, which is {0}[0].size", what, i, out.size, first->size);
  return out;
}

// Checks that give() will have memory to write to, before its value is computed.
template <class T>
void require_output(const T* out, const char* what) {
  need(out, what);
  check_size(*out, what);
}

// Writes as many fields as the caller's struct holds; its size field is unchanged.
template <class T>
void give(T* out, const T& value, const char* what) {
  require_output(out, what);
  const std::size_t size = out->size;
  std::memcpy(out, &value, size < sizeof(T) ? size : sizeof(T));
  out->size = size;
}

// The number in a C caller's enum. It may not be one of the enum's values, and then C++ may not even load it as the
// enum.
template <class E>
int value_of(const E& from) {
  static_assert(sizeof(E) == sizeof(int));
  int out = 0;
  std::memcpy(&out, &from, sizeof out);
  return out;
}

// Copies text; vsplat_text_free frees it.
char* new_text(const std::string& text);

// Runs `write`, given a name for errors, and returns the bytes of the file that it would write; vsplat_text_free frees
// them.
void give_bytes(const std::function<void(const std::string& name)>& write, const char* name, char** out_bytes,
                std::size_t* out_size);

}  // namespace vsplat::api
