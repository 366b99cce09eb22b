#include "isolated.h"

#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <system_error>
#include <thread>

#include "runtime/system/system_process.h"

namespace command {
namespace {

namespace sys = vsplat::sys;

constexpr int kUnheard = 97;   // exit code of a process that Patience ended
constexpr int kMostEnds = 40;  // several for each flavour and for its replacements

std::atomic<double> last_heard{0};

sys::ProgramEnd wait_for(int process) {
  bool passed_on = false;
  for (;;) {
    const sys::ProgramEnd end = sys::end_of(process, sys::Wait::no);
    if (end.state != sys::ProgramEnd::State::runs) return end;
    if (interrupted() && !passed_on) sys::stop_program(process), passed_on = true;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

}  // namespace

void Patience::heard() { last_heard = elapsed_seconds(); }

void Patience::begin(double seconds) {
  heard();
  std::thread([seconds] {
    while (elapsed_seconds() - last_heard < seconds) std::this_thread::sleep_for(std::chrono::milliseconds(100));
    std::_Exit(kUnheard);
  }).detach();
}

std::string in_another_process(const Common& common, const std::string& called) {
  std::string ended;
  for (int ends = 0;; ++ends) {
    std::fflush(nullptr);
    std::error_code error;
    const int process = sys::split_process(error);
    if (process < 0) throw std::runtime_error(called + ": no process of its own to be had: " + error.message());
    if (process == 0) {
      catch_interrupts();
      return ended;
    }
    const sys::ProgramEnd end = wait_for(process);
    const bool by_itself = end.state != sys::ProgramEnd::State::ended || (end.signal == 0 && end.exit_code != kUnheard);
    if (by_itself) std::_Exit(end.exit_code < 0 ? 1 : end.exit_code);
    if (interrupted()) std::_Exit(interrupt_code());
    ended = end.signal == 0 ? std::string("nothing was heard of it any more")
                            : "signal " + std::to_string(end.signal) + ", " + sys::signal_name(end.signal);
    clear_progress();
    if (end.signal != 0 && !end.fault)  // out of memory, for example: that says nothing about the work
      throw std::runtime_error(called + ": its process was ended from outside (" + ended + ")");
    if (ends == kMostEnds) throw std::runtime_error(called + ": its process was ended again and again: " + ended);
    say(common, called + ": its process was ended (" + ended + "); again, without what it was doing");
  }
}

}  // namespace command
