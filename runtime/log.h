// Messages for people. The library prints nothing by itself: whoever embeds it sets a sink.
#pragma once
#include <fmt/format.h>

#include <functional>
#include <string>

namespace vsplat {

enum class LogLevel : int { warning = 1, info = 2, verbose = 3 };

// Replaces the process-wide sink; an empty function silences. Thread-safe.
void set_log_sink(std::function<void(LogLevel, const std::string&)> sink);
void log_message(LogLevel level, const std::string& text);

template <class... Args>
void warn(fmt::format_string<Args...> text, Args&&... args) {
  log_message(LogLevel::warning, fmt::format(text, std::forward<Args>(args)...));
}
template <class... Args>
void info(fmt::format_string<Args...> text, Args&&... args) {
  log_message(LogLevel::info, fmt::format(text, std::forward<Args>(args)...));
}
template <class... Args>
void verbose(fmt::format_string<Args...> text, Args&&... args) {
  log_message(LogLevel::verbose, fmt::format(text, std::forward<Args>(args)...));
}

}  // namespace vsplat
