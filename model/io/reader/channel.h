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

// Handle of a file or of the socket.
using Descriptor = sys::Handle;

// Thrown if the other end is closed.
struct Closed : std::runtime_error {
  using std::runtime_error::runtime_error;
};
// Thrown if the deadline has passed.
struct Late : std::runtime_error {
  using std::runtime_error::runtime_error;
};

class Channel {
 public:
  using Clock = std::chrono::steady_clock;
  explicit Channel(Descriptor socket) : socket_(std::move(socket)) {}

  // Waiting ends with Late at `at`. While waiting, `look`, if set, is called every few milliseconds.
  void expect_by(Clock::time_point at) { deadline_ = at; }
  Clock::time_point deadline() const { return deadline_.value_or(Clock::time_point::max()); }
  void while_waiting(std::function<void()> look) { look_ = std::move(look); }

  // Sends a message, with a file if `file` is a descriptor.
  void send(Kind kind, const Packer& body, int file = -1);

  // Receives a message's header; read() then gets its body. BadMessage if it is no header or claims a body larger than
  // `most`. A file sent with it is stored in `file`; without that, no file is accepted.
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
