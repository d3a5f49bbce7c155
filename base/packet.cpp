// SPDX-License-Identifier: Apache-2.0
#include "base/packet.h"

#include <sys/socket.h>

#include <array>
#include <cerrno>
#include <cstring>

namespace lenticule {
namespace {

using Control = std::array<char, CMSG_SPACE(sizeof(int))>;

}  // namespace

bool send_packet(int socket, const void* bytes, size_t count, int descriptor, int flags) noexcept {
  iovec part{.iov_base = const_cast<void*>(bytes), .iov_len = count};
  alignas(cmsghdr) Control control{};
  msghdr header{};
  header.msg_iov = &part;
  header.msg_iovlen = 1;
  if (descriptor >= 0) {
    header.msg_control = control.data();
    header.msg_controllen = control.size();
    cmsghdr* const passed = CMSG_FIRSTHDR(&header);
    passed->cmsg_level = SOL_SOCKET;
    passed->cmsg_type = SCM_RIGHTS;
    passed->cmsg_len = CMSG_LEN(sizeof descriptor);
    std::memcpy(CMSG_DATA(passed), &descriptor, sizeof descriptor);
  }
  ssize_t n = 0;
  do {
    n = ::sendmsg(socket, &header, flags | MSG_NOSIGNAL);
  } while (n < 0 && errno == EINTR);
  return n == static_cast<ssize_t>(count);
}

ssize_t receive_packet(int socket, void* bytes, size_t count, UniqueFd* descriptor,
                       int flags) noexcept {
  iovec part{.iov_base = bytes, .iov_len = count};
  alignas(cmsghdr) Control control{};
  msghdr header{};
  header.msg_iov = &part;
  header.msg_iovlen = 1;
  if (descriptor != nullptr) {
    header.msg_control = control.data();
    // Not CMSG_SPACE, whose padding has room for a second descriptor that nothing would close.
    header.msg_controllen = CMSG_LEN(sizeof(int));
  }
  ssize_t n = 0;
  do {
    n = ::recvmsg(socket, &header, flags | MSG_CMSG_CLOEXEC | MSG_TRUNC);
  } while (n < 0 && errno == EINTR);
  const cmsghdr* const passed = n >= 0 ? CMSG_FIRSTHDR(&header) : nullptr;
  if (passed != nullptr && passed->cmsg_level == SOL_SOCKET && passed->cmsg_type == SCM_RIGHTS) {
    int received = -1;
    std::memcpy(&received, CMSG_DATA(passed), sizeof received);
    *descriptor = UniqueFd(received);
  }
  return n;
}

}  // namespace lenticule
