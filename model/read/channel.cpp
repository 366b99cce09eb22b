#include "model/read/channel.h"

#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

namespace vsplat::read {
namespace {

constexpr int slice = 20;  // milliseconds between two looks

}  // namespace

Descriptor::~Descriptor() {
  if (number_ >= 0) ::close(number_);
}

void Channel::wait(short events) {
  for (;;) {
    int most = look_ ? slice : -1;
    if (deadline_) {
      const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(*deadline_ - Clock::now()).count() + 1;
      if (left <= 0) throw Late("late");
      if (most < 0 || left < most) most = static_cast<int>(std::min<long>(left, 60'000));
    }
    pollfd what{socket_.number(), events, 0};
    const int ready = ::poll(&what, 1, most);
    if (ready > 0) return;
    if (ready < 0 && errno != EINTR) throw Closed("poll fails");
    if (look_) look_();
  }
}

void Channel::send(Kind kind, const Packer& body, int file) {
  Header header{magic, kind, body.body().size()};
  std::size_t sent = 0;  // of header and body together
  const std::size_t all = sizeof header + body.body().size();
  while (sent < all) {
    const bool in_header = sent < sizeof header;
    const char* from =
        in_header ? reinterpret_cast<const char*>(&header) + sent : body.body().data() + (sent - sizeof header);
    iovec piece{const_cast<char*>(from), in_header ? sizeof header - sent : all - sent};
    msghdr message{};
    message.msg_iov = &piece, message.msg_iovlen = 1;
    alignas(cmsghdr) char control[CMSG_SPACE(sizeof file)] = {};
    if (sent == 0 && file >= 0) {
      message.msg_control = control, message.msg_controllen = sizeof control;
      cmsghdr* with = CMSG_FIRSTHDR(&message);
      with->cmsg_level = SOL_SOCKET, with->cmsg_type = SCM_RIGHTS, with->cmsg_len = CMSG_LEN(sizeof file);
      std::memcpy(CMSG_DATA(with), &file, sizeof file);
    }
    wait(POLLOUT);
    const ssize_t n = ::sendmsg(socket_.number(), &message, MSG_NOSIGNAL | MSG_DONTWAIT);
    if (n < 0 && errno != EINTR && errno != EAGAIN) throw Closed("the other end takes no more");
    if (n > 0) sent += static_cast<std::size_t>(n);
  }
}

void Channel::read(void* to, std::size_t size) {
  auto* at = static_cast<char*>(to);
  while (size > 0) {
    wait(POLLIN);
    const ssize_t n = ::recv(socket_.number(), at, size, MSG_DONTWAIT);
    if (n == 0 || (n < 0 && errno != EINTR && errno != EAGAIN)) throw Closed("the other end says no more");
    if (n > 0) at += n, size -= static_cast<std::size_t>(n);
  }
}

Header Channel::receive(std::size_t most, Descriptor* file) {
  Header out{};
  std::size_t have = 0;
  while (file && have == 0) {  // a file comes with the first byte
    wait(POLLIN);
    iovec piece{&out, sizeof out};
    int number = -1;
    alignas(cmsghdr) char control[CMSG_SPACE(sizeof number)] = {};
    msghdr message{};
    message.msg_iov = &piece, message.msg_iovlen = 1;
    message.msg_control = control, message.msg_controllen = sizeof control;
    const ssize_t n = ::recvmsg(socket_.number(), &message, MSG_DONTWAIT | MSG_CMSG_CLOEXEC);
    if (n == 0 || (n < 0 && errno != EINTR && errno != EAGAIN)) throw Closed("the other end says no more");
    if (n < 0) continue;
    have = static_cast<std::size_t>(n);
    const cmsghdr* with = CMSG_FIRSTHDR(&message);
    if (with && with->cmsg_level == SOL_SOCKET && with->cmsg_type == SCM_RIGHTS &&
        with->cmsg_len == CMSG_LEN(sizeof number)) {
      std::memcpy(&number, CMSG_DATA(with), sizeof number);
      *file = Descriptor(number);
    }
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
