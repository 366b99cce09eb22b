#include "runtime/log.h"

#include <fmt/format.h>

#include <mutex>

namespace vsplat {
namespace {

std::mutex& sink_mutex() {
  static std::mutex mutex;
  return mutex;
}

std::function<void(LogLevel, const std::string&)>& sink() {
  static std::function<void(LogLevel, const std::string&)> function;
  return function;
}

}  // namespace

void set_log_sink(std::function<void(LogLevel, const std::string&)> function) {
  const std::lock_guard lock(sink_mutex());
  sink() = std::move(function);
}

void log_message(LogLevel level, const std::string& text) {
  const std::lock_guard lock(sink_mutex());
  if (sink()) sink()(level, text);
}

void log_formatted(LogLevel level, fmt::string_view text, fmt::format_args args) {
  log_message(level, fmt::vformat(text, args));
}

}  // namespace vsplat
