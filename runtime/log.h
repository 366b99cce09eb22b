// Messages for people. The library itself prints nothing: the embedding program sets a sink.
#pragma once
#include <fmt/core.h>

#include <functional>
#include <string>

namespace vsplat {

enum class LogLevel : int { warning = 1, info = 2, verbose = 3 };

// Replaces the process-wide sink; an empty function silences all messages. Thread-safe.
void set_log_sink(std::function<void(LogLevel, const std::string&)> sink);
void log_message(LogLevel level, const std::string& text);
// Not inline, so that the formatting code is compiled once.
void log_formatted(LogLevel level, fmt::string_view text, fmt::format_args args);

template <class... Args>
void warn(fmt::format_string<Args...> text, Args&&... args) {
  log_formatted(LogLevel::warning, text, fmt::make_format_args(args...));
}
template <class... Args>
void info(fmt::format_string<Args...> text, Args&&... args) {
  log_formatted(LogLevel::info, text, fmt::make_format_args(args...));
}
template <class... Args>
void verbose(fmt::format_string<Args...> text, Args&&... args) {
  log_formatted(LogLevel::verbose, text, fmt::make_format_args(args...));
}

}  // namespace vsplat
