#include "model/io/reader/channel.h"

#include <fmt/format.h>

#include <algorithm>

namespace vsplat::read {
namespace {

constexpr int slice = 20;  // milliseconds between two calls of look_

}  // namespace

void Channel::wait(sys::Way way) {
  for (;;) {
    int most = look_ ? slice : -1;
    if (deadline_) {
      const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(*deadline_ - Clock::now()).count() + 1;
      if (left <= 0) throw Late("late");
      if (most < 0 || left < most) most = static_cast<int>(std::min<long>(left, 60'000));
    }
    const sys::Ready ready = sys::wait_for(socket_, way, most);
    if (ready == sys::Ready::yes) return;
    if (ready == sys::Ready::failed) throw Closed("poll fails");
    if (look_) look_();
  }
}

void Channel::send(Kind kind, const Packer& body, int file) {
  Header header{magic, kind, body.body().size()};
  std::size_t sent = 0;  // bytes of header and body together
  const std::size_t all = sizeof header + body.body().size();
  while (sent < all) {
    const bool in_header = sent < sizeof header;
    const char* from =
        in_header ? reinterpret_cast<const char*>(&header) + sent : body.body().data() + (sent - sizeof header);
    wait(sys::Way::out);
    const sys::Moved moved =
        sys::send_some(socket_, from, in_header ? sizeof header - sent : all - sent, sent == 0 ? file : -1);
    if (!moved.open) throw Closed("the other end accepts no more data");
    sent += moved.bytes;
  }
}

void Channel::read(void* to, std::size_t size) {
  auto* at = static_cast<char*>(to);
  while (size > 0) {
    wait(sys::Way::in);
    const sys::Moved moved = sys::receive_some(socket_, at, size);
    if (!moved.open) throw Closed("the other end sends no more data");
    at += moved.bytes, size -= moved.bytes;
  }
}

Header Channel::receive(std::size_t most, Descriptor* file) {
  Header out{};
  std::size_t have = 0;
  while (file && have == 0) {  // a file comes with the first byte
    wait(sys::Way::in);
    const sys::Moved moved = sys::receive_some(socket_, &out, sizeof out, file);
    if (!moved.open) throw Closed("the other end sends no more data");
    have = moved.bytes;
  }
  read(reinterpret_cast<char*>(&out) + have, sizeof out - have);
  if (out.magic != magic) throw BadMessage("it does not begin as one");
  if (out.size > most)
    throw BadMessage(fmt::format("{} bytes of kind {}, at most {} are possible", out.size,
                                 static_cast<std::uint32_t>(out.kind), most));
  return out;
}

Message Channel::receive_whole(std::size_t most, Descriptor* file) {
  const Header header = receive(most, file);
  Message out{header.kind, std::vector<char>(static_cast<std::size_t>(header.size))};
  read(out.body.data(), out.body.size());
  return out;
}

}  // namespace vsplat::read
