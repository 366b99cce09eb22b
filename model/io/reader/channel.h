// One end of the socket between the library and its reader.
#pragma once
#include <chrono>
#include <functional>
#include <optional>
#include <stdexcept>
#include <utility>

#include "model/io/reader/message.h"
#include "runtime/system/system_channel.h"

namespace vsplat::read {

// A file's, or the socket's.
using Descriptor = sys::Handle;

// The other end is closed.
struct Closed : std::runtime_error {
  using std::runtime_error::runtime_error;
};
// The deadline has passed.
struct Late : std::runtime_error {
  using std::runtime_error::runtime_error;
};

class Channel {
 public:
  using Clock = std::chrono::steady_clock;
  explicit Channel(Descriptor socket) : socket_(std::move(socket)) {}

  // Waiting ends with Late at `at`. While it waits, `look`, where given, is called every few milliseconds.
  void expect_by(Clock::time_point at) { deadline_ = at; }
  Clock::time_point deadline() const { return deadline_.value_or(Clock::time_point::max()); }
  void while_waiting(std::function<void()> look) { look_ = std::move(look); }

  // With a file, where `file` is its descriptor.
  void send(Kind kind, const Packer& body, int file = -1);

  // The beginning of a message; read() its body next. BadMessage where it is none, or the body is larger than `most`.
  // A file that comes with it goes to `file`; without that, none is taken.
  Header receive(std::size_t most, Descriptor* file = nullptr);
  void read(void* to, std::size_t size);
  Message receive_whole(std::size_t most, Descriptor* file = nullptr);

 private:
  void wait(sys::Way way);

  Descriptor socket_;
  std::optional<Clock::time_point> deadline_;
  std::function<void()> look_;
};

}  // namespace vsplat::read
