// Lambdas in place of the C interface's functions. An exception in a lambda ends the call, which then rethrows it. Part
// of vsplat.hpp, which includes this file.
#ifndef VSPLAT_CALLBACKS_HPP
#define VSPLAT_CALLBACKS_HPP

#include <vsplat/vsplat.h>

#include <exception>
#include <functional>
#include <utility>
#include <vsplat/handle.hpp>

namespace vsplat {
inline namespace cxx {

// Called during a computation, see vsplat_progress_function: `stage`, and the share done. Return false to stop: the
// call throws Error(VSPLAT_ERROR_CANCELLED).
using Progress = std::function<bool(const char* stage, double done)>;
// Receives messages, see vsplat_log_set: called from any thread, one call at a time.
using Log = std::function<void(vsplat_log_level level, const char* text)>;

namespace detail {

// Holds a lambda's exception until the call that it was passed to returns.
class Caught {
 public:
  // Returns whether `f` threw nothing.
  template <class F>
  bool run(const F& f) noexcept {
    try {
      f();
      return true;
    } catch (...) {
      if (!thrown_) thrown_ = std::current_exception();
      return false;
    }
  }
  bool any() const { return thrown_ != nullptr; }
  // Throws the held exception, else the status's Error.
  void check(vsplat_status status) const {
    if (thrown_) std::rethrow_exception(thrown_);
    cxx::check(status);
  }

 private:
  std::exception_ptr thrown_;
};

// Wraps a progress function for options with the fields `progress` and `user`, during this object's lifetime.
class ProgressCall {
 public:
  explicit ProgressCall(const Progress& function) : function_(function) {}
  ProgressCall(const ProgressCall&) = delete;
  ProgressCall& operator=(const ProgressCall&) = delete;

  template <class Options>
  Options of(Options options) {
    if (!function_) return options;
    options.progress = call;
    options.user = this;
    return options;
  }
  void check(vsplat_status status) const { caught_.check(status); }

 private:
  static int32_t call(void* user, const char* stage, double done) {
    auto* self = static_cast<ProgressCall*>(user);
    bool on = false;
    self->caught_.run([&] { on = self->function_(stage, done); });
    return on ? 1 : 0;
  }

  const Progress& function_;
  Caught caught_;
};

inline Log& log() {
  static Log out;
  return out;
}

}  // namespace detail

// Sets where the library's messages go, for the whole process; an empty function silences them. No call may be in
// progress, and the function may neither throw nor call the library.
inline void log_to(Log function) {
  vsplat_log_set(nullptr, nullptr);
  detail::log() = std::move(function);
  if (detail::log())
    vsplat_log_set([](void*, vsplat_log_level level, const char* text) noexcept { detail::log()(level, text); },
                   nullptr);
}

}  // namespace cxx
}  // namespace vsplat

#endif
