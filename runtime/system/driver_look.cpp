#include "runtime/system/driver_look.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <sstream>

#include "runtime/fail.h"
#include "runtime/library_programs.h"
#include "runtime/printable.h"
#include "runtime/system/system.h"
#include "runtime/system/watched_process.h"

namespace vsplat {
namespace {

std::vector<std::string> fields_of(const std::string& line) {
  std::vector<std::string> out;
  std::istringstream in(line);
  for (std::string field; std::getline(in, field, '\t');) out.push_back(field);
  out.resize(std::max<std::size_t>(out.size(), 6));  // trailing fields may be empty
  return out;
}

std::string last_line(const std::string& text) {
  std::string out;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);)
    if (line.find_first_not_of(" \t\r") != std::string::npos) out = line;
  return printable(out);
}

// Takes one fact from vsplat-look. Returns whether it was the last one.
bool take_fact(const std::vector<std::string>& fact, SeenDriver& out) {
  const std::string& what = fact[0];
  if (what == "loaded") {
    out.path = fact[1];
    out.doing = "when it is asked for its platforms";
  } else if (what == "not loaded") {
    out.state = SeenDriver::State::not_loaded;
    out.error = fact[1];
    return true;
  } else if (what == "no driver") {
    out.state = SeenDriver::State::no_driver;
    out.error = fact[1];
  } else if (what == "platform") {
    out.platforms.push_back({printable(fact[1]), printable(fact[2]), {}});
    out.doing = "when it is asked for its devices";
  } else if (what == "device" && !out.platforms.empty()) {
    out.platforms.back().devices.push_back({printable(fact[1]), printable(fact[2]), printable(fact[3]),
                                            printable(fact[4]), std::strtoull(fact[5].c_str(), nullptr, 10)});
  }
  return what == "done";
}

SeenDriver look(const char* what, const char* when, const std::string& library, double seconds) {
  const std::string program = library_program("vsplat-look");
  const WatchedEnd end = run_watched(program, {what, when, library, std::to_string(sys::process_id())}, seconds);
  SeenDriver out;
  out.doing = "when it is loaded";
  bool whole = false;
  std::istringstream lines(end.report);
  for (std::string line; std::getline(lines, line);) whole = take_fact(fields_of(line), out) || whole;
  if (whole && !end.too_late && (end.exit_code == 0 || end.unknown)) {
    out.doing.clear();
    return out;
  }
  out.said = last_line(end.said);
  out.state = end.too_late ? SeenDriver::State::too_late : SeenDriver::State::crashed;
  if (end.too_late)
    out.error = fmt::format("not done after {:g} s", seconds);
  else if (end.unknown)
    out.error = "how is not known here, where SIGCHLD is ignored";
  else if (end.signal != 0)
    out.error = fmt::format("signal {}, {}", end.signal, sys::signal_name(end.signal));
  else
    out.error = fmt::format("exit code {}", end.exit_code);
  return out;
}

}  // namespace

std::size_t SeenDriver::devices() const {
  std::size_t out = 0;
  for (const SeenPlatform& platform : platforms) out += platform.devices.size();
  return out;
}

SeenDriver look_at_driver(const std::string& library, bool now, double seconds) {
  return look("driver", now ? "now" : "lazy", library, seconds);
}

SeenDriver look_at_loader(const std::string& loader, double seconds) { return look("loader", "lazy", loader, seconds); }

}  // namespace vsplat
