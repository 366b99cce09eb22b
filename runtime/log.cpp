#include "runtime/log.h"

#include <memory>
#include <mutex>

#include "runtime/message_text.h"

namespace vsplat {
namespace {

using Sink = std::function<void(LogLevel, const std::string&)>;

// A sink may call the library, which may log, or set another sink, so the mutex is recursive and a sink is kept for as
// long as it runs. Both outlive every thread.
std::recursive_mutex& sink_mutex() {
  static auto& mutex = *new std::recursive_mutex;
  return mutex;
}

std::shared_ptr<const Sink>& sink() {
  static auto& function = *new std::shared_ptr<const Sink>;
  return function;
}

// Whether the sink runs on this thread: messages that it logs itself are dropped, to prevent endless recursion.
thread_local bool in_sink = false;

}  // namespace

void set_log_sink(std::function<void(LogLevel, const std::string&)> function) {
  const std::lock_guard lock(sink_mutex());
  sink() = function ? std::make_shared<const Sink>(std::move(function)) : nullptr;
}

void log_message(LogLevel level, const std::string& text) {
  if (in_sink) return;
  const std::lock_guard lock(sink_mutex());
  const std::shared_ptr<const Sink> function = sink();
  if (!function) return;
  in_sink = true;
  try {
    (*function)(level, text);
  } catch (...) {
    in_sink = false;
    throw;
  }
  in_sink = false;
}

void log_formatted(LogLevel level, fmt::string_view text, fmt::format_args args) {
  log_message(level, message_text(text, args));
}

}  // namespace vsplat
