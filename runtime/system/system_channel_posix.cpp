// Channels on POSIX: pairs of sockets.
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "runtime/system/system_channel.h"

namespace vsplat::sys {
namespace {

Moved moved(ssize_t result, bool none_is_the_end) {
  if (result > 0) return {true, static_cast<std::size_t>(result)};
  if (result == 0) return {!none_is_the_end, 0};
  return {errno == EINTR || errno == EAGAIN, 0};
}

}  // namespace

Handle::~Handle() {
  if (number_ >= 0) ::close(number_);
}

std::error_code make_channel(Handle& one, Handle& other) {
  int ends[2] = {-1, -1};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) return {errno, std::generic_category()};
  one = Handle(ends[0]), other = Handle(ends[1]);
  return {};
}

Ready wait_for(const Handle& end, Way way, int milliseconds) {
  pollfd what{end.number(), static_cast<short>(way == Way::in ? POLLIN : POLLOUT), 0};
  const int ready = ::poll(&what, 1, milliseconds);
  return ready > 0 ? Ready::yes : ready < 0 && errno != EINTR ? Ready::failed : Ready::not_yet;
}

Moved send_some(const Handle& end, const void* from, std::size_t bytes, int file) {
  iovec piece{const_cast<void*>(from), bytes};
  msghdr message{};
  message.msg_iov = &piece, message.msg_iovlen = 1;
  alignas(cmsghdr) char control[CMSG_SPACE(sizeof file)] = {};
  if (file >= 0) {
    message.msg_control = control, message.msg_controllen = sizeof control;
    cmsghdr* with = CMSG_FIRSTHDR(&message);
    with->cmsg_level = SOL_SOCKET, with->cmsg_type = SCM_RIGHTS, with->cmsg_len = CMSG_LEN(sizeof file);
    std::memcpy(CMSG_DATA(with), &file, sizeof file);
  }
  return moved(::sendmsg(end.number(), &message, MSG_NOSIGNAL | MSG_DONTWAIT), false);
}

Moved receive_some(const Handle& end, void* to, std::size_t bytes, Handle* file) {
  if (!file) return moved(::recv(end.number(), to, bytes, MSG_DONTWAIT), true);
  iovec piece{to, bytes};
  int number = -1;
  alignas(cmsghdr) char control[CMSG_SPACE(sizeof number)] = {};
  msghdr message{};
  message.msg_iov = &piece, message.msg_iovlen = 1;
  message.msg_control = control, message.msg_controllen = sizeof control;
  const Moved out = moved(::recvmsg(end.number(), &message, MSG_DONTWAIT | MSG_CMSG_CLOEXEC), true);
  if (out.bytes == 0) return out;
  const cmsghdr* with = CMSG_FIRSTHDR(&message);
  if (with && with->cmsg_level == SOL_SOCKET && with->cmsg_type == SCM_RIGHTS &&
      with->cmsg_len == CMSG_LEN(sizeof number)) {
    std::memcpy(&number, CMSG_DATA(with), sizeof number);
    *file = Handle(number);
  }
  return out;
}

}  // namespace vsplat::sys
